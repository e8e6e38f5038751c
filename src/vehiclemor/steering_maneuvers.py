"""Open-loop steering tests of the vehicles: step, sine sweep, multisine.

Each shape is smooth to its second derivative, since a steering rack whose velocity jumps would need
an infinite force.  ISO 7401 (lateral transient response): a step to a lateral acceleration of
4 m/s^2, sine sweeps, and signals of several frequencies.  The amplitudes give 4 m/s^2 (step) and
about 2 m/s^2 (sweep, multisine) at 20 m/s.
"""

from collections.abc import Callable

import numpy as np

from vehiclemor.maneuvers import (
    LANE_CHANGE_AMPLITUDE,
    LANE_CHANGE_START,
    RACK_AMPLITUDE,
    Maneuver,
)

BEGIN = LANE_CHANGE_START
# Length (s) of the ramp of a step, and of the ramp at which a periodic signal sets in.
STEP_RAMP = 0.2
ONSET = 1.0
STEP_DURATION = 5.0
DURATION = 10.0
# Output times per second, as of the lane change.
RATE = 50
# Sizes as parts of the lane change's amplitude.
STEP_SIZE = 0.9
SWEEP_SIZE = 0.4
MULTISINE_SIZE = 0.16
# Frequencies (Hz) of sweep and multisine.
SWEEP_FIRST, SWEEP_LAST = 0.2, 1.6
MULTISINE = np.array([0.15, 0.35, 0.6, 0.95, 1.4])
# Phases after M. R. Schroeder, IEEE Trans. Inf. Theory 16 (1970), 85-89: a low peak.
PHASES = -np.pi * np.arange(5) * np.arange(1, 6) / 5

Shape = Callable[[np.ndarray, float], np.ndarray]


def _ramp(part: np.ndarray, length: float) -> np.ndarray:
    """Quintic from 0 to 1 while `part` (n,) goes from 0 to 1, with derivatives (n, 3) in time."""
    z = np.clip(part, 0.0, 1.0)
    return np.column_stack(
        [
            z**3 * (10.0 - 15.0 * z + 6.0 * z**2),
            30.0 * z**2 * (1.0 - z) ** 2 / length,
            60.0 * z * (1.0 - z) * (1.0 - 2.0 * z) / length**2,
        ]
    )


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Product of two signals (n, 3) with first and second derivatives."""
    return np.column_stack(
        [
            a[:, 0] * b[:, 0],
            a[:, 1] * b[:, 0] + a[:, 0] * b[:, 1],
            a[:, 2] * b[:, 0] + 2.0 * a[:, 1] * b[:, 1] + a[:, 0] * b[:, 2],
        ]
    )


def _sine(phase: np.ndarray, rate: np.ndarray, change: float | np.ndarray) -> np.ndarray:
    """Sine of a phase (n,) with given first and second derivatives, (n, 3)."""
    sine, cosine = np.sin(phase), np.cos(phase)
    return np.column_stack([sine, rate * cosine, change * cosine - rate**2 * sine])


def _step(times: np.ndarray, frequency: float) -> np.ndarray:
    length = STEP_RAMP / frequency
    return STEP_SIZE * _ramp((times - BEGIN) / length, length)


def _sweep(times: np.ndarray, frequency: float) -> np.ndarray:
    t = times - BEGIN
    growth = (SWEEP_LAST - SWEEP_FIRST) / (DURATION - BEGIN)
    circle = 2.0 * np.pi * frequency
    phase = circle * (SWEEP_FIRST + 0.5 * growth * t) * t
    wave = _sine(phase, circle * (SWEEP_FIRST + growth * t), circle * growth)
    return SWEEP_SIZE * _product(_ramp(t / ONSET, ONSET), wave)


def _multisine(times: np.ndarray, frequency: float) -> np.ndarray:
    t = times - BEGIN
    waves = np.zeros((len(t), 3))
    for hertz, phase in zip(MULTISINE * frequency, PHASES, strict=True):
        rate = np.full(len(t), 2.0 * np.pi * hertz)
        waves += _sine(rate * t + phase, rate, 0.0)
    return MULTISINE_SIZE * _product(_ramp(t / ONSET, ONSET), waves)


def _step_corners(frequency: float) -> tuple[float, ...]:
    return BEGIN, BEGIN + STEP_RAMP / frequency


def _periodic_corners(frequency: float) -> tuple[float, ...]:
    del frequency
    return BEGIN, BEGIN + ONSET


def _steered(shape: Shape) -> Callable[[np.ndarray, float, float], np.ndarray]:
    """Steering angle (n, 1) of the 14-DOF vehicle."""

    def signal(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
        return amplitude * LANE_CHANGE_AMPLITUDE * shape(times, frequency)[:, :1]

    return signal


def _racked(shape: Shape) -> Callable[[np.ndarray, float, float], np.ndarray]:
    """Displacement, velocity and acceleration (n, 3) of the steering rack."""

    def signal(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
        return amplitude * RACK_AMPLITUDE * shape(times, frequency)

    return signal


def _pair(
    name: str, summary: str, shape: Shape, corners: Callable, duration: float
) -> tuple[Maneuver, Maneuver]:
    """The maneuver for the steered wheels and for the rack."""
    samples = round(duration * RATE) + 1
    steered = Maneuver(
        name, summary, _steered(shape), ("delta",), duration, samples, corners=corners
    )
    racked = Maneuver(
        f"rack_{name}",
        f"{summary}, of the rack",
        _racked(shape),
        ("s", "s_dot", "s_ddot"),
        duration,
        samples,
        corners=corners,
    )
    return steered, racked


step_steer, rack_step_steer = _pair(
    "step_steer",
    "step of the steering to 4 m/s^2 at 20 m/s within 0.2 s, 5 s",
    _step,
    _step_corners,
    STEP_DURATION,
)
sine_sweep, rack_sine_sweep = _pair(
    "sine_sweep",
    "steering swept from 0.2 to 1.6 Hz, 10 s",
    _sweep,
    _periodic_corners,
    DURATION,
)
multisine, rack_multisine = _pair(
    "multisine",
    "steering at five frequencies from 0.15 to 1.4 Hz, 10 s",
    _multisine,
    _periodic_corners,
    DURATION,
)
