"""Wheel travel and rack of the suspension: the paper's, and inputs that fill a rectangle.

The paper's is a sine of 0.1 m at a fixed rack (Masoudi et al., 2015, section 3.2).  At an amplitude
factor of 1 the others stay within 0.1 m of the design height and 0.03 m of rack: six times a lane
change at 20 m/s, and half of what parking takes.  All are smooth.
"""

from dataclasses import replace

import numpy as np

from vehiclemor.inputs.maneuver import Maneuver, smooth
from vehiclemor.inputs.steering import MULTISINE, PHASES

# Masoudi et al. (2015), section 3.2: z(t) = 0.1 sin(2 pi 0.1 t) m for 10 s.
TRAVEL_AMPLITUDE = 0.1
TRAVEL_FREQUENCY = 0.1
CHIRP_LAST_FREQUENCY = 0.4
RACK_AMPLITUDE = 0.03
# The golden ratio is the number that fractions approach worst: the two sines never repeat.
RACK_FREQUENCY = TRAVEL_FREQUENCY * 0.5 * (1.0 + np.sqrt(5.0))
# First and last frequencies (Hz) of the sweeps, which cross.
TRAVEL_SWEEP = TRAVEL_FREQUENCY, CHIRP_LAST_FREQUENCY
RACK_SWEEP = 0.5, RACK_FREQUENCY
# Frequencies (Hz) beside those of steering.
RACK_SINES = np.array([0.1, 0.25, 0.45, 0.7, 1.1])


def _travel(times: np.ndarray, phase: np.ndarray, amplitude: float) -> np.ndarray:
    """Sine of a phase (n,) as wheel travel; the rack is fixed."""
    return np.column_stack([amplitude * TRAVEL_AMPLITUDE * np.sin(phase), np.zeros_like(times)])


def _sine_travel(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
    return _travel(times, 2.0 * np.pi * frequency * TRAVEL_FREQUENCY * times, amplitude)


def _chirp_travel(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
    rate = (CHIRP_LAST_FREQUENCY - TRAVEL_FREQUENCY) / 10.0
    phase = 2.0 * np.pi * frequency * (TRAVEL_FREQUENCY + 0.5 * rate * times) * times
    return _travel(times, phase, amplitude)


sine_travel = Maneuver(
    "sine_travel",
    "wheel travel 0.1 m x sin(2 pi 0.1 Hz t), rack fixed, 10 s (paper, section 3.2)",
    _sine_travel,
    ("z", "s0"),
    duration=10.0,
    samples=1001,
    corners=smooth,
    linear_in_amplitude=True,
)
chirp_travel = replace(
    sine_travel,
    name="chirp_travel",
    summary="wheel travel 0.1 m, sine swept from 0.1 to 0.4 Hz, rack fixed, 10 s",
    signal=_chirp_travel,
)


def _scaled(travel: np.ndarray, rack: np.ndarray, amplitude: float) -> np.ndarray:
    """Inputs from shapes (n,) that stay within 1."""
    return amplitude * np.column_stack([TRAVEL_AMPLITUDE * travel, RACK_AMPLITUDE * rack])


def _sines(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
    angle = 2.0 * np.pi * frequency * times
    return _scaled(np.sin(TRAVEL_FREQUENCY * angle), np.sin(RACK_FREQUENCY * angle), amplitude)


def _sweeps(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
    angle = 2.0 * np.pi * frequency * times

    def wave(first: float, last: float) -> np.ndarray:
        return np.sin((first + 0.5 * (last - first) * times / sine_travel.duration) * angle)

    return _scaled(wave(*TRAVEL_SWEEP), wave(*RACK_SWEEP), amplitude)


def _multisines(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
    angle = 2.0 * np.pi * frequency * times[:, None]

    def waves(hertz: np.ndarray) -> np.ndarray:
        return np.sin(hertz * angle + PHASES).mean(axis=1)

    return _scaled(waves(MULTISINE), waves(RACK_SINES), amplitude)


travel_and_rack = replace(
    sine_travel,
    name="travel_and_rack",
    summary="wheel travel 0.1 m at 0.1 Hz, rack 0.03 m at 0.16 Hz, sines that never repeat, 10 s",
    signal=_sines,
)
travel_and_rack_sweep = replace(
    sine_travel,
    name="travel_and_rack_sweep",
    summary="wheel travel 0.1 m swept from 0.1 to 0.4 Hz, rack 0.03 m from 0.5 to 0.16 Hz, 10 s",
    signal=_sweeps,
)
travel_and_rack_multisine = replace(
    sine_travel,
    name="travel_and_rack_multisine",
    summary="wheel travel within 0.1 m at five frequencies up to 1.4 Hz, rack within 0.03 m, 10 s",
    signal=_multisines,
)
