"""Maneuvers: input time histories that studies scale in frequency and amplitude."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from vehiclemor.errors import InputError


@dataclass(frozen=True)
class Maneuver:
    """Inputs u(t) of a model over a fixed duration.

    Attributes
    ----------
    name, summary
        Registered name and one line.
    signal
        (time (n,) in s, frequency factor, amplitude factor) -> inputs (n, number of inputs), SI.
    inputs
        Names of the inputs, equal to the model's.
    duration
        Length in s; it does not change with the factors.
    samples
        Number of equidistant output times, both ends included.
    corners
        Frequency factor -> times (s) at which the inputs are not smooth.
    frequency_factor, amplitude_factor
        Perturbation; 1 is the nominal maneuver.
    """

    name: str
    summary: str
    signal: Callable[[np.ndarray, float, float], np.ndarray]
    inputs: tuple[str, ...]
    duration: float
    samples: int
    corners: Callable[[float], tuple[float, ...]]
    frequency_factor: float = 1.0
    amplitude_factor: float = 1.0

    @property
    def times(self) -> np.ndarray:
        """Equidistant output times (samples,) in s."""
        return np.linspace(0.0, self.duration, self.samples)

    @property
    def break_points(self) -> tuple[float, ...]:
        """Times in s inside the run at which the inputs are not smooth."""
        return self.corners(self.frequency_factor)

    def at(self, times: np.ndarray) -> np.ndarray:
        """Inputs (n, number of inputs) at the given times (n,) in s."""
        return self.signal(
            np.asarray(times, dtype=float), self.frequency_factor, self.amplitude_factor
        )

    def perturbed(self, frequency: float = 1.0, amplitude: float = 1.0) -> "Maneuver":
        """The maneuver with its factors set.

        Raises
        ------
        InputError
            If a factor is not finite, or the frequency factor is not positive.
        """
        for name, factor in (("frequency", frequency), ("amplitude", amplitude)):
            if isinstance(factor, bool) or not isinstance(factor, int | float | np.number):
                raise InputError(f"{name} factor: {factor!r} is not a number")
            if not math.isfinite(factor):
                raise InputError(f"{name} factor: {factor} is not finite")
            if abs(factor) > LARGEST_FACTOR:
                raise InputError(f"{name} factor: {factor:g} is above {LARGEST_FACTOR:g}")
        if frequency <= 0.0:
            raise InputError(f"frequency factor: {frequency:g} is not positive")
        return replace(self, frequency_factor=float(frequency), amplitude_factor=float(amplitude))


# Far beyond anything that is meant.
LARGEST_FACTOR = 1e6
# Masoudi et al. (2015), section 3.2: z(t) = 0.1 sin(2 pi 0.1 t) m for 10 s.
TRAVEL_AMPLITUDE = 0.1
TRAVEL_FREQUENCY = 0.1
CHIRP_LAST_FREQUENCY = 0.4
# Single lane change, a steering pulse that is smooth to its second derivative.  The amplitude is
# calibrated on the 14-DOF vehicle: 3.5 m to the left after 25 s at 20 m/s.
LANE_CHANGE_START = 1.0
LANE_CHANGE_LENGTH = 2.5
LANE_CHANGE_AMPLITUDE = 0.0300768
LANE_CHANGE_DURATION = 25.0
LANE_CHANGE_SAMPLES = 1251
# The same pulse of the steering rack (m), negative to the left; calibrated on the high-fidelity
# vehicle: 3.5 m to the left after 10 s at 20 m/s.
RACK_AMPLITUDE = -0.0046903
RACK_DURATION = 10.0
RACK_SAMPLES = 501


def _sine_travel(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
    phase = 2.0 * np.pi * frequency * TRAVEL_FREQUENCY * times
    return np.column_stack([amplitude * TRAVEL_AMPLITUDE * np.sin(phase), np.zeros_like(times)])


def _chirp_travel(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
    rate = (CHIRP_LAST_FREQUENCY - TRAVEL_FREQUENCY) / 10.0
    phase = 2.0 * np.pi * frequency * (TRAVEL_FREQUENCY + 0.5 * rate * times) * times
    return np.column_stack([amplitude * TRAVEL_AMPLITUDE * np.sin(phase), np.zeros_like(times)])


def _smooth(frequency: float) -> tuple[float, ...]:
    del frequency
    return ()


sine_travel = Maneuver(
    "sine_travel",
    "wheel travel 0.1 m x sin(2 pi 0.1 Hz t), rack fixed, 10 s (paper, section 3.2)",
    _sine_travel,
    ("z", "s0"),
    duration=10.0,
    samples=1001,
    corners=_smooth,
)

chirp_travel = Maneuver(
    "chirp_travel",
    "wheel travel 0.1 m, sine swept from 0.1 to 0.4 Hz, rack fixed, 10 s",
    _chirp_travel,
    ("z", "s0"),
    duration=10.0,
    samples=1001,
    corners=_smooth,
)


def _pulse(times: np.ndarray, frequency: float) -> np.ndarray:
    """Pulse of the lane change (n, 3) of about unit size, with its first and second derivatives."""
    part = (times - LANE_CHANGE_START) * frequency / LANE_CHANGE_LENGTH
    angle = 2.0 * np.pi * np.clip(part, 0.0, 1.0)
    rate = 2.0 * np.pi * frequency / LANE_CHANGE_LENGTH
    pulse = np.column_stack(
        [
            np.sin(angle) - 0.5 * np.sin(2.0 * angle),
            rate * (np.cos(angle) - np.cos(2.0 * angle)),
            rate**2 * (2.0 * np.sin(2.0 * angle) - np.sin(angle)),
        ]
    )
    inside = (part > 0.0) & (part < 1.0)
    return np.where(inside[:, None], pulse, 0.0)


def _lane_change(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
    return amplitude * LANE_CHANGE_AMPLITUDE * _pulse(times, frequency)[:, :1]


def _lane_change_corners(frequency: float) -> tuple[float, ...]:
    return LANE_CHANGE_START, LANE_CHANGE_START + LANE_CHANGE_LENGTH / frequency


def _straight_ahead(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
    del frequency, amplitude
    return np.zeros((len(times), 1))


lane_change = Maneuver(
    "lane_change",
    "single lane change of 3.5 m at 20 m/s, a steering pulse of 2.5 s from 1 s on, 25 s",
    _lane_change,
    ("delta",),
    duration=LANE_CHANGE_DURATION,
    samples=LANE_CHANGE_SAMPLES,
    corners=_lane_change_corners,
)

straight_ahead = Maneuver(
    "straight_ahead",
    "no steering, 25 s",
    _straight_ahead,
    ("delta",),
    duration=LANE_CHANGE_DURATION,
    samples=LANE_CHANGE_SAMPLES,
    corners=_smooth,
)


def _rack_lane_change(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
    return amplitude * RACK_AMPLITUDE * _pulse(times, frequency)


def _rack_held(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
    del frequency, amplitude
    return np.zeros((len(times), 3))


rack_lane_change = Maneuver(
    "rack_lane_change",
    "single lane change of 3.5 m at 20 m/s, a pulse of the rack of 2.5 s from 1 s on, 10 s",
    _rack_lane_change,
    ("s", "s_dot", "s_ddot"),
    duration=RACK_DURATION,
    samples=RACK_SAMPLES,
    corners=_lane_change_corners,
)

rack_straight_ahead = Maneuver(
    "rack_straight_ahead",
    "rack held in the middle, 10 s",
    _rack_held,
    ("s", "s_dot", "s_ddot"),
    duration=RACK_DURATION,
    samples=RACK_SAMPLES,
    corners=_smooth,
)
