"""Error measures of a trajectory against the full-order solution of the same input."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vehiclemor.arguments import quoted
from vehiclemor.exceptions import InputError
from vehiclemor.simulation.trajectory import Trajectory

if TYPE_CHECKING:
    import xarray as xr


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

    They end where the first vehicle stops; of a run that stops early they are not numbers.

    Parameters
    ----------
    run, full
        Of the same input, at the same output times; `full` has the outputs of `run`.  Start and
        parameters are not compared: the difference of two cars may be wanted.

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
    end = full.samples_to_stop
    if not run.stops_early(full):
        end = min(run.samples_to_stop, end)
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
