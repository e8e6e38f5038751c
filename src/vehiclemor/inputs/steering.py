"""Open-loop steering of the vehicles: lane change, straight ahead, and tests of the standards.

Each shape is smooth to its second derivative, since a steering rack whose velocity jumps would need
an infinite force.  ISO 7401 (lateral transient response): a step to a lateral acceleration of
4 m/s^2, sine sweeps, and signals of several frequencies.  The amplitudes give 4 m/s^2 (step) and
about 2 m/s^2 (sweep, multisine) at 20 m/s.

ISO 4138 (steady turn): steering that rises slowly, to about 4 m/s^2.  ISO 13674-1 (on-centre
handling): weave at 0.2 Hz and 1 m/s^2.  49 CFR 571.126 (FMVSS 126) and UN R140 (stability control):
one period of a sine of 0.7 Hz that dwells at its second peak for 0.5 s; the amplitude factor counts
multiples of the steering that gives 0.3 g in a slow ramp at 80 km/h.

The cars coast from the speed of the parameter `initial_speed`, 20 m/s by default; the standards
ask for 80 km/h (ISO 7401, FMVSS 126) and 100 km/h (ISO 13674-1).
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vehiclemor.inputs.maneuver import Maneuver, smooth

BEGIN = 1.0
# Single lane change, a pulse that is smooth to its second derivative.  The amplitudes are
# calibrated: 3.5 m to the left at 20 m/s, of the 14-DOF vehicle after 25 s by the steering angle
# (rad), of the high-fidelity vehicle after 10 s by the rack (m, negative to the left).
LANE_CHANGE_LENGTH = 2.5
LANE_CHANGE_AMPLITUDE = 0.0300768
RACK_AMPLITUDE = -0.0046903
LANE_CHANGE_DURATION = 25.0
# Length (s) of the ramp of a step, and of the ramp at which a periodic signal sets in.
STEP_RAMP = 0.2
ONSET = 1.0
STEP_DURATION = 5.0
DURATION = 10.0
# Output times per second.
RATE = 50
# Sizes as parts of the lane change's amplitude.
STEP_SIZE = 0.9
SWEEP_SIZE = 0.4
MULTISINE_SIZE = 0.16
WEAVE_SIZE = 0.22
DWELL_SIZE = 0.56
# Frequencies (Hz) of sweep and multisine.
SWEEP_FIRST, SWEEP_LAST = 0.2, 1.6
MULTISINE = np.array([0.15, 0.35, 0.6, 0.95, 1.4])
# Phases after M. R. Schroeder, IEEE Trans. Inf. Theory 16 (1970), 85-89: a low peak.
PHASES = -np.pi * np.arange(5) * np.arange(1, 6) / 5
# Slow ramp: size after a second.  Weave: frequency in Hz.
RAMP_RATE, RAMP_DURATION = 0.05, 21.0
WEAVE_FREQUENCY, WEAVE_DURATION = 0.2, 22.0
# Sine with dwell: frequency in Hz, length of the dwell, of the transition into and out of it (s).
DWELL_FREQUENCY, DWELL, TRANSITION, DWELL_DURATION = 0.7, 0.5, 0.1, 6.0
# Periods of the sine before the dwell.
BEFORE_DWELL = 0.75

# (Times (n,) in s, frequency factor) -> signal (n, 3) with first and second derivatives.
Shape = Callable[[np.ndarray, float], np.ndarray]


def _pulse(times: np.ndarray, frequency: float) -> np.ndarray:
    """Pulse of the lane change, of about unit size."""
    part = (times - BEGIN) * frequency / LANE_CHANGE_LENGTH
    angle = 2.0 * np.pi * np.clip(part, 0.0, 1.0)
    rate = 2.0 * np.pi * frequency / LANE_CHANGE_LENGTH
    value = np.sin(angle) - 0.5 * np.sin(2.0 * angle)
    slope = rate * (np.cos(angle) - np.cos(2.0 * angle))
    change = rate**2 * (2.0 * np.sin(2.0 * angle) - np.sin(angle))
    inside = (part > 0.0) & (part < 1.0)
    return np.where(inside[:, None], np.column_stack([value, slope, change]), 0.0)


def ramp(part: np.ndarray, length: float) -> np.ndarray:
    """Quintic from 0 to 1 while `part` (n,) goes from 0 to 1, with derivatives (n, 3) in time."""
    z = np.clip(part, 0.0, 1.0)
    value = z**3 * (10.0 - 15.0 * z + 6.0 * z**2)
    slope = 30.0 * z**2 * (1.0 - z) ** 2 / length
    change = 60.0 * z * (1.0 - z) * (1.0 - 2.0 * z) / length**2
    return np.column_stack([value, slope, change])


def _slope(times: np.ndarray, length: float) -> np.ndarray:
    """Integral (n, 3) of `ramp` over times in s: from 0 on it rises, after `length` at rate 1."""
    z = np.clip(times / length, 0.0, 1.0)
    risen = length * z**4 * (2.5 - 3.0 * z + z**2) + np.maximum(times - length, 0.0)
    return np.column_stack([risen, ramp(times / length, length)[:, :2]])


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Product of two signals (n, 3) with first and second derivatives."""
    (a0, a1, a2), (b0, b1, b2) = a.T, b.T
    return np.column_stack([a0 * b0, a1 * b0 + a0 * b1, a2 * b0 + 2.0 * a1 * b1 + a0 * b2])


def _sine(phase: np.ndarray, rate: np.ndarray, change: float | np.ndarray) -> np.ndarray:
    """Sine of a phase (n,) with given first and second derivatives, (n, 3)."""
    sine, cosine = np.sin(phase), np.cos(phase)
    return np.column_stack([sine, rate * cosine, change * cosine - rate**2 * sine])


def _step(times: np.ndarray, frequency: float) -> np.ndarray:
    length = STEP_RAMP / frequency
    return STEP_SIZE * ramp((times - BEGIN) / length, length)


def _sweep(times: np.ndarray, frequency: float) -> np.ndarray:
    t = times - BEGIN
    growth = (SWEEP_LAST - SWEEP_FIRST) / (DURATION - BEGIN)
    circle = 2.0 * np.pi * frequency
    phase = circle * (SWEEP_FIRST + 0.5 * growth * t) * t
    wave = _sine(phase, circle * (SWEEP_FIRST + growth * t), circle * growth)
    return SWEEP_SIZE * _product(ramp(t / ONSET, ONSET), wave)


def _multisine(times: np.ndarray, frequency: float) -> np.ndarray:
    t = times - BEGIN
    waves = np.zeros((len(t), 3))
    for hertz, phase in zip(MULTISINE * frequency, PHASES, strict=True):
        rate = np.full(len(t), 2.0 * np.pi * hertz)
        waves += _sine(rate * t + phase, rate, 0.0)
    return MULTISINE_SIZE * _product(ramp(t / ONSET, ONSET), waves)


def _slow_ramp(times: np.ndarray, frequency: float) -> np.ndarray:
    return RAMP_RATE * frequency * _slope(times - BEGIN, ONSET)


def _weave(times: np.ndarray, frequency: float) -> np.ndarray:
    t, rate = times - BEGIN, np.full(len(times), 2.0 * np.pi * WEAVE_FREQUENCY * frequency)
    return WEAVE_SIZE * _product(ramp(t / ONSET, ONSET), _sine(rate * t, rate, 0.0))


def _dwell_times(frequency: float) -> np.ndarray:
    """Times (4,) in s at which the sine begins, dwells, goes on and ends."""
    peak, end = BEFORE_DWELL / DWELL_FREQUENCY, 1.0 / DWELL_FREQUENCY + DWELL
    return BEGIN + np.array([0.0, peak, peak + DWELL, end]) / frequency


def _sine_with_dwell(times: np.ndarray, frequency: float) -> np.ndarray:
    """The phase goes on at a constant rate, but for the dwell, and starts and stops smoothly."""
    length = TRANSITION / frequency
    begin, dwell, go_on, end = (
        _slope(times - at + length / 2.0, length) for at in _dwell_times(frequency)
    )
    phase, rate, change = (
        2.0 * np.pi * DWELL_FREQUENCY * frequency * (begin - dwell + go_on - end).T
    )
    return DWELL_SIZE * _sine(phase, rate, change)


def _dwell_corners(frequency: float) -> tuple[float, ...]:
    half = TRANSITION / (2.0 * frequency)
    return tuple(np.add.outer(_dwell_times(frequency), [-half, half]).ravel().tolist())


def _steered(
    name: str,
    summary: str,
    shape: Shape,
    corners: Callable[[float], tuple[float, ...]],
    duration: float = DURATION,
    rack_summary: str = "",
    rack_duration: float = 0.0,
) -> tuple[Maneuver, Maneuver]:
    """Steering angle of the 14-DOF vehicle; the rack and its rates instead, as long by default."""

    def angle(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
        return amplitude * LANE_CHANGE_AMPLITUDE * shape(times, frequency)[:, :1]

    def rack(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
        return amplitude * RACK_AMPLITUDE * shape(times, frequency)

    samples = round(duration * RATE) + 1
    steered = Maneuver(name, summary, angle, ("delta",), duration, samples, corners)
    steered = replace(steered, linear_in_amplitude=True)
    duration = rack_duration or duration
    return steered, replace(
        steered,
        name=f"rack_{name}",
        summary=rack_summary or f"{summary}, of the rack",
        signal=rack,
        inputs=("s", "s_dot", "s_ddot"),
        duration=duration,
        samples=round(duration * RATE) + 1,
    )


def _onset(frequency: float) -> tuple[float, ...]:
    """Corners of a periodic signal."""
    del frequency
    return BEGIN, BEGIN + ONSET


lane_change, rack_lane_change = _steered(
    "lane_change",
    "single lane change of 3.5 m at 20 m/s, a steering pulse of 2.5 s from 1 s on, 25 s",
    _pulse,
    lambda frequency: (BEGIN, BEGIN + LANE_CHANGE_LENGTH / frequency),
    LANE_CHANGE_DURATION,
    "single lane change of 3.5 m at 20 m/s, a pulse of the rack of 2.5 s from 1 s on, 10 s",
    DURATION,
)
straight_ahead, rack_straight_ahead = _steered(
    "straight_ahead",
    "no steering, 25 s",
    lambda times, _: np.zeros((len(times), 3)),
    smooth,
    LANE_CHANGE_DURATION,
    "rack held in the middle, 10 s",
    DURATION,
)
step_steer, rack_step_steer = _steered(
    "step_steer",
    "step of the steering to 4 m/s^2 at 20 m/s within 0.2 s, 5 s",
    _step,
    lambda frequency: (BEGIN, BEGIN + STEP_RAMP / frequency),
    STEP_DURATION,
)
sine_sweep, rack_sine_sweep = _steered(
    "sine_sweep", "steering swept from 0.2 to 1.6 Hz, 10 s", _sweep, _onset
)
multisine, rack_multisine = _steered(
    "multisine", "steering at five frequencies from 0.15 to 1.4 Hz, 10 s", _multisine, _onset
)
slow_ramp_steer, rack_slow_ramp_steer = _steered(
    "slow_ramp_steer",
    "steering that rises slowly to about 4 m/s^2 at 20 m/s (ISO 4138), coasting, 21 s",
    _slow_ramp,
    _onset,
    RAMP_DURATION,
)
weave, rack_weave = _steered(
    "weave",
    "steering to and fro at 0.2 Hz to 1 m/s^2 at 20 m/s (ISO 13674-1), 22 s",
    _weave,
    _onset,
    WEAVE_DURATION,
)
sine_with_dwell, rack_sine_with_dwell = _steered(
    "sine_with_dwell",
    "sine of 0.7 Hz that dwells 0.5 s at its second peak (FMVSS 126, UN R140), 6 s",
    _sine_with_dwell,
    _dwell_corners,
    DWELL_DURATION,
)
