"""Error measures of a trajectory against the full-order solution of the same input."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.arguments import quoted, real_array
from vehiclemor.exceptions import InputError
from vehiclemor.simulation.trajectory import Trajectory

if TYPE_CHECKING:
    import xarray as xr


# Hz: high pass and low pass (Butterworth), transition from acceleration to velocity, upward step.
HIGH_PASS, LOW_PASS, TRANSITION, STEP = 0.4, 100.0, 12.5, (2.37, 3.35)
# Resonant quality factors.
BUTTERWORTH, TRANSITION_QUALITY, STEP_QUALITY = 0.5**0.5, 0.63, 0.91


def rms(error: np.ndarray) -> np.ndarray:
    """Root mean square over the samples: (samples, k) -> (k,)."""
    return np.sqrt(np.mean(np.square(error), axis=0))


def max_abs(error: np.ndarray) -> np.ndarray:
    """Largest absolute value over the samples: (samples, k) -> (k,)."""
    return np.abs(error).max(axis=0)


def signal_range(signal: np.ndarray) -> np.ndarray:
    """Largest minus smallest value over the samples: (samples, k) -> (k,)."""
    return signal.max(axis=0) - signal.min(axis=0)


def errors(run: Trajectory, full: Trajectory) -> xr.Dataset:
    """Errors of a run against the full-order run of the same input, for each output of the run.

    Of a vehicle that stops they are those until the first of both runs has stopped.

    Parameters
    ----------
    run, full
        At the same output times; `full` has the outputs of `run`.

    Returns
    -------
    xarray.Dataset
        `rms_error`, `max_error` and `signal_range` of the full order by output, in its unit.

    Raises
    ------
    InputError
        If the runs have other inputs or output times, or an output is missing.
    """
    import xarray as xr

    for name, given in (("run", run), ("full", full)):
        if not isinstance(given, Trajectory):
            raise InputError(f"{name} is {quoted(given)}, not a run as `simulate` gives it")
    if not np.array_equal(run.times, full.times):
        raise InputError("the runs have other output times: simulate both with the same input")
    if run.inputs.shape != full.inputs.shape:
        raise InputError("the runs are of models with other inputs: compare runs of one model")
    if not np.allclose(run.inputs, full.inputs, rtol=1e-6, atol=1e-9 * np.abs(full.inputs).max()):
        raise InputError("the runs have other inputs: simulate both with the same")
    end = min(run.samples_to_stop, full.samples_to_stop)
    reference = full.chosen(run.names).outputs[:end]
    difference, size = run.outputs[:end] - reference, signal_range(reference)
    labels = run.chosen(run.names).dataset().drop_dims(["time", "input"])
    return xr.Dataset(
        {
            "rms_error": ("output", rms(difference), {"long_name": "root mean square error"}),
            "max_error": ("output", max_abs(difference), {"long_name": "largest error"}),
            "signal_range": ("output", size, {"long_name": "range of the full-order output"}),
        },
        labels.coords,
    )


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
