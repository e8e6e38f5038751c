"""Ride comfort of a vertical acceleration by ISO 2631-1."""

from typing import Any

import numpy as np

from vehiclemor.arguments import real_array
from vehiclemor.exceptions import InputError

# Hz: high pass and low pass (Butterworth), transition from acceleration to velocity, upward step.
HIGH_PASS, LOW_PASS, TRANSITION, STEP = 0.4, 100.0, 12.5, (2.37, 3.35)
# Resonant quality factors.
BUTTERWORTH, TRANSITION_QUALITY, STEP_QUALITY = 0.5**0.5, 0.63, 0.91


def weighted_rms(times: Any, acceleration: Any) -> float:
    """Frequency-weighted RMS of a vertical acceleration in m/s^2: ride comfort of a seated person.

    Weighting Wk of ISO 2631-1:1997 by its transfer functions (annex A), from 0.4 to 100 Hz: what is
    faster than half the sampling rate is not in it.

    Parameters
    ----------
    times
        Equidistant (n,) in s.
    acceleration
        At these times (n,) in m/s^2.

    Raises
    ------
    InputError
        If there are fewer than two samples, times aren't equidistant, or a value isn't finite.
    """
    try:
        t, a = real_array(times), real_array(acceleration)
    except (TypeError, ValueError):
        raise InputError("times and acceleration must be lists of numbers") from None
    if t.ndim != 1 or a.shape != t.shape or len(t) < 2:
        raise InputError(
            f"times of shape {t.shape} and acceleration of shape {a.shape}: "
            f"both must be (n,) with two samples at least"
        )
    if not (np.isfinite(t).all() and np.isfinite(a).all()):
        raise InputError("times and acceleration must be finite")
    step = (t[-1] - t[0]) / (len(t) - 1)
    if step <= 0.0 or np.abs(np.diff(t) - step).max() > 1e-6 * step:
        raise InputError("times must increase in equal steps")
    # Zeros after the end, so that nothing comes round to the beginning.
    padded = 2 * len(t)
    spectrum = np.fft.rfft(a, padded) * _weighting(np.fft.rfftfreq(padded, step))
    return float(np.sqrt(np.mean(np.fft.irfft(spectrum, padded)[: len(t)] ** 2)))


def _weighting(hertz: np.ndarray) -> np.ndarray:
    """Wk at frequencies (n,) in Hz, with its phase."""
    s = 1j * hertz

    def resonance(corner: float, quality: float) -> np.ndarray:
        return 1.0 + s / (quality * corner) + (s / corner) ** 2

    low, high = STEP
    limits = (s / HIGH_PASS) ** 2 / resonance(HIGH_PASS, BUTTERWORTH)
    limits /= resonance(LOW_PASS, BUTTERWORTH)
    transition = (1.0 + s / TRANSITION) / resonance(TRANSITION, TRANSITION_QUALITY)
    step = (low / high) ** 2 * resonance(low, STEP_QUALITY) / resonance(high, STEP_QUALITY)
    return limits * transition * step
