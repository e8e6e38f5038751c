"""Numbers of open-loop steering tests: steady turn, step, sweep, weave, sine with dwell."""

from typing import NamedTuple

import numpy as np

from vehiclemor.handling.motion import Motion, first_time, slope

# m/s^2: gradients of a steady turn are those between these lateral accelerations.
LINEAR_RANGE = (1.0, 3.0)
# Length (s) of the end of a step's run, whose mean is the steady value.
STEADY = 1.0
# Hz: where the sweep moves the steering.
FREQUENCIES = np.arange(3, 16) / 10.0
# Order of the difference equation of a frequency response, and its step in s.
ORDER, DELAY = 4, 0.1
# Part of the largest steering around the centre, where on-centre gains are taken; part from which
# on steering has begun.
ON_CENTRE, BEGUN = 0.2, 0.05
# Ratio of the yaw rate to its peak: time after the steering in s, largest ratio that is allowed.
RATIOS = {"early_yaw_rate_ratio": (1.0, 0.35), "late_yaw_rate_ratio": (1.75, 0.2)}
# s after the beginning of the steering.
DISPLACEMENT_TIME = 1.07


def steady_turn(motion: Motion) -> dict[str, float]:
    """Gradients of a slow ramp: straight lines over the lateral acceleration."""
    size = np.abs(motion.lateral_acceleration)
    within = (size >= LINEAR_RANGE[0]) & (size <= LINEAR_RANGE[1])
    acceleration = motion.lateral_acceleration[within]
    ackermann = motion.wheelbase * motion.yaw_rate / motion.speed
    return {
        "understeer_gradient": slope(acceleration, (motion.wheel_angle - ackermann)[within]),
        "roll_gradient": slope(acceleration, motion.roll[within]),
        "sideslip_gradient": slope(acceleration, motion.sideslip[within]),
    }


def step(motion: Motion) -> dict[str, float]:
    """Response to a step, whose time counts from half of the steering on."""
    times = motion.times
    steady = times >= times[-1] - STEADY
    half = first_time(times, motion.steering / np.mean(motion.steering[steady]), 0.5)
    yaw_rate = float(np.mean(motion.yaw_rate[steady]))
    response = motion.yaw_rate / yaw_rate
    lateral = motion.lateral_acceleration / np.mean(motion.lateral_acceleration[steady])
    peak, largest = _peak(times, response)
    return {
        "yaw_rate_gain": yaw_rate / float(np.mean(motion.wheel_angle[steady])),
        "yaw_rate_response_time": first_time(times, response, 0.9) - half,
        "yaw_rate_peak_time": peak - half,
        "yaw_rate_overshoot": largest - 1.0,
        "lateral_acceleration_response_time": first_time(times, lateral, 0.9) - half,
    }


def _peak(times: np.ndarray, signal: np.ndarray) -> tuple[float, float]:
    """Time and value of the largest of a signal (n,), of a parabola through three samples."""
    k = int(np.argmax(signal))
    if not 0 < k < len(signal) - 1:
        return float(times[k]), float(signal[k])
    before, at, after = signal[k - 1 : k + 2]
    bend = before - 2.0 * at + after
    part = 0.5 * (before - after) / bend if bend else 0.0
    time = times[k] + part * (times[k + 1] - times[k])
    return float(time), float(at - 0.25 * part * (before - after))


def frequency_response(motion: Motion) -> dict[str, np.ndarray]:
    """Gain and phase of yaw rate and lateral acceleration over the angle of the wheels."""
    numbers: dict[str, np.ndarray] = {}
    for name in ("yaw_rate", "lateral_acceleration"):
        response = transfer_function(motion.times, motion.wheel_angle, getattr(motion, name))
        numbers[f"{name}_gain"] = np.abs(response)
        numbers[f"{name}_phase"] = np.unwrap(np.angle(response))
    return numbers


def transfer_function(times: np.ndarray, given: np.ndarray, response: np.ndarray) -> np.ndarray:
    """Complex ratio (frequencies,) of two signals (samples,) at `FREQUENCIES`.

    A difference equation with delays of `DELAY` is fitted to all samples.  Fourier spectra of a
    sweep that ends in motion are wrong by 10 %.
    """
    delay = max(round(DELAY * (len(times) - 1) / (times[-1] - times[0])), 1)
    rows = np.arange(ORDER * delay, len(times))
    if len(rows) < 2 * ORDER + 1:
        return np.full(len(FREQUENCIES), np.nan + 0j)
    past = [response[rows - k * delay] for k in range(1, ORDER + 1)]
    driven = [given[rows - k * delay] for k in range(ORDER + 1)]
    fitted = np.linalg.lstsq(np.column_stack(past + driven), response[rows], rcond=None)[0]
    back = np.exp(-2j * np.pi * FREQUENCIES * delay * (times[1] - times[0]))
    remembered = np.polyval(np.append(0.0, fitted[:ORDER])[::-1], back)
    return np.polyval(fitted[ORDER:][::-1], back) / (1.0 - remembered)


def weave(motion: Motion) -> dict[str, float]:
    """On-centre gain and hysteresis of whole periods, without the first, which sets in."""
    begins = np.flatnonzero((motion.steering[:-1] < 0.0) & (motion.steering[1:] >= 0.0))
    cycles = slice(begins[0], begins[-1] + 1) if len(begins) > 1 else slice(0)
    numbers: dict[str, float] = {}
    for name in ("yaw_rate", "lateral_acceleration"):
        steering, response = motion.wheel_angle[cycles], getattr(motion, name)[cycles]
        near = np.abs(steering) <= ON_CENTRE * np.abs(steering).max(initial=0.0)
        numbers[f"{name}_gain"] = slope(steering[near], response[near])
        numbers[f"{name}_hysteresis"] = _loop_width(steering, response)
    return numbers


def _loop_width(steering: np.ndarray, response: np.ndarray) -> float:
    """Steering between the branches of a loop, where the response is zero."""
    rises = _at_zero(steering, response)
    falls = _at_zero(steering, -response)
    if not len(rises) or not len(falls):
        return np.nan
    return float(rises.mean() - falls.mean())


def _at_zero(steering: np.ndarray, response: np.ndarray) -> np.ndarray:
    """Steering wherever the response rises through zero, linear between the samples."""
    before = np.flatnonzero((response[:-1] < 0.0) & (response[1:] >= 0.0))
    part = -response[before] / (response[before + 1] - response[before])
    return steering[before] + part * (steering[before + 1] - steering[before])


class Dwell(NamedTuple):
    """A sine of steering with its yaw rate.

    It begins and ends, in s, where the steering passes `BEGUN` of its largest value.  The first
    side is 1 on the left, -1 on the right; the peak is the largest yaw rate towards the other side
    between the reversal of the steering and its end, in rad/s.
    """

    begin: float
    end: float
    side: float
    peak: float


def dwell_of(motion: Motion) -> Dwell:
    """Times, side and peak of a sine with dwell."""
    times, size = motion.times, np.abs(motion.steering)
    threshold = BEGUN * size.max()
    begin = first_time(times, size, threshold)
    end = -first_time(-times[::-1], size[::-1], threshold)
    first = np.sign(np.interp(begin, times, motion.steering))
    back = np.where(times > begin, -first * motion.steering, -threshold)
    turned_back = (times >= first_time(times, back, 0.0)) & (times <= end)
    side = float(np.sign(np.interp(begin, times, motion.wheel_angle)))
    peak = float(np.max(-side * motion.yaw_rate, where=turned_back, initial=0.0))
    return Dwell(begin, end, side, peak or np.nan)


def sine_with_dwell(motion: Motion) -> dict[str, float]:
    """Ratios of the yaw rate after the steering, displacement after its beginning."""
    dwell = dwell_of(motion)

    def at(signal: np.ndarray, time: float) -> float:
        return float(np.interp(time, motion.times, signal, right=np.nan))

    heading, then = at(motion.yaw, dwell.begin), dwell.begin + DISPLACEMENT_TIME
    ahead = at(motion.x, then) - at(motion.x, dwell.begin)
    aside = at(motion.y, then) - at(motion.y, dwell.begin)
    displacement = aside * np.cos(heading) - ahead * np.sin(heading)
    numbers = {
        name: -dwell.side * at(motion.yaw_rate, dwell.end + after) / dwell.peak
        for name, (after, _) in RATIOS.items()
    }
    return numbers | {"lateral_displacement": float(dwell.side * displacement)}
