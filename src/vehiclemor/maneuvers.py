"""Maneuvers: input time histories that studies scale in frequency and amplitude; wheel travel."""

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


def _travel(times: np.ndarray, phase: np.ndarray, amplitude: float) -> np.ndarray:
    """Sine of a phase (n,) as wheel travel; the rack is fixed."""
    return np.column_stack([amplitude * TRAVEL_AMPLITUDE * np.sin(phase), np.zeros_like(times)])


def _sine_travel(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
    return _travel(times, 2.0 * np.pi * frequency * TRAVEL_FREQUENCY * times, amplitude)


def _chirp_travel(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
    rate = (CHIRP_LAST_FREQUENCY - TRAVEL_FREQUENCY) / 10.0
    phase = 2.0 * np.pi * frequency * (TRAVEL_FREQUENCY + 0.5 * rate * times) * times
    return _travel(times, phase, amplitude)


def smooth(frequency: float) -> tuple[float, ...]:
    """No corners."""
    del frequency
    return ()


sine_travel = Maneuver(
    "sine_travel",
    "wheel travel 0.1 m x sin(2 pi 0.1 Hz t), rack fixed, 10 s (paper, section 3.2)",
    _sine_travel,
    ("z", "s0"),
    duration=10.0,
    samples=1001,
    corners=smooth,
)
chirp_travel = replace(
    sine_travel,
    name="chirp_travel",
    summary="wheel travel 0.1 m, sine swept from 0.1 to 0.4 Hz, rack fixed, 10 s",
    signal=_chirp_travel,
)
