"""Predictions of methods that are written outside of this package, judged as protocols judge."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from vehiclemor.arguments import file_path, quoted
from vehiclemor.error_measures import max_abs, rms, signal_range
from vehiclemor.exceptions import FileError, InputError, printable
from vehiclemor.netcdf_file import opened, read_dataset
from vehiclemor.study.plans.choice import outcomes
from vehiclemor.study.plans.results import judged_part
from vehiclemor.study.plans.study_file import Bound, ProtocolFile
from vehiclemor.study.store import combined_path

Bounds = Mapping[str, Bound]


def judge(file: str | Path, dataset: str | Path, results: str | Path = "results") -> pd.DataFrame:
    """Judge predictions of the test runs that `dataset` has written.

    Parameters
    ----------
    file
        netCDF file: attributes `model` and `test_set_digest` of the test set, and
        each bounded output (samples,) by its name and in its unit, in the order of the test set.
        It may have `trusted` (runs,), 0 where the method warns, `seconds` (runs,) and `method`.
    dataset
        Folder that `dataset` has written.
    results
        Results folder: `replay` and the chosen method stand below, if the study was run there.

    Returns
    -------
    pandas.DataFrame
        By `kind`: `method`, then `output`.  Of the `runs`, `misses` violate a bound, `silent` ones
        without a warning; `score` and `median_score` of the errors are multiples of the bound, and
        infinite of a run that is not finite.

    Raises
    ------
    VehiclemorError
        If a file can't be read, is of another test set, or lacks values.
    """
    path, folder = file_path("file", file), file_path("dataset", dataset)
    known = folder / "test.nc"
    if not known.exists():
        raise FileError(f"{folder}: has no test.nc; vehiclemor dataset MODEL writes such a folder")
    truth, predictions = _read(known, "test set"), _read(path, "file of predictions")
    if "configuration" not in truth.attrs or "apart" not in truth:
        raise FileError(f"{known}: not the test set of a dataset of this package")
    bounds = ProtocolFile.model_validate_json(truth.attrs["configuration"]).bounds
    _check(path, predictions, truth, bounds)
    counts = truth["apart"].values == ""
    if not counts.any():
        raise InputError(f"{known}: no run can be judged")
    label = printable(str(predictions.attrs.get("method", path.stem)))
    part = _measured(predictions, truth, bounds).isel(scenario=counts)
    rows = [_row(label, part, bounds)]
    stored = combined_path(file_path("results", results), truth.attrs["study"])
    if stored.exists():
        other = judged_part(read_dataset(stored, "source", "vehiclemor", stored=True))
        if np.array_equal(other["scenario"].values, truth["label"].values[counts]):
            shown = other["winner"].values | (other["method"].values == "replay")
            names = other["label"].values[shown].tolist()
            rows += [_row(name, other.sel(label=name), bounds) for name in names]
    for output, bound in bounds.items():
        row = _row(label, part, {output: bound})
        row |= {"kind": "output", "measure": bound.measure, "bound": bound.bound}
        rows.append(row | {"unit": truth[output].units})
    return pd.DataFrame(rows)


def _read(path: Path, kind: str) -> xr.Dataset:
    from xarray.backends import NetCDF4DataStore

    with opened(path, kind) as file:
        return xr.open_dataset(NetCDF4DataStore(file), decode_times=False).load()


def _check(path: Path, predictions: xr.Dataset, truth: xr.Dataset, bounds: Bounds) -> None:
    """Raise `InputError` if a file is not of predictions of this test set."""
    for name in ("model", "test_set_digest"):
        value, wanted = str(predictions.attrs.get(name, "missing")), truth.attrs[name]
        if value != wanted:
            raise InputError(f"{path}: {name} is {quoted(value)}; the test set has {wanted!r}")
    if missing := [output for output in bounds if output not in predictions]:
        raise InputError(f"{path}: has no {missing[0]}; needed are {', '.join(bounds)}")
    sizes = dict.fromkeys(bounds, truth.sizes["sample"])
    sizes |= {name: truth.sizes["run"] for name in ("trusted", "seconds") if name in predictions}
    for name, size in sizes.items():
        values = predictions[name]
        if values.shape != (size,) or values.dtype.kind not in "biuf":
            has = f"shape {values.shape} and type {values.dtype}"
            raise InputError(f"{path}: {name} has {has}; needed are {size} numbers")


def _measured(predictions: xr.Dataset, truth: xr.Dataset, bounds: Bounds) -> xr.Dataset:
    """Errors and ends of all runs, as a protocol has them of a method."""
    names, ends = truth.attrs["outputs"].split(), np.cumsum(truth["row_size"].values)[:-1]
    full = np.transpose([truth[name].values for name in names])
    bounded = [names.index(name) for name in bounds]
    predicted = np.transpose([predictions[name].values for name in bounds])
    error = np.full(full.shape, np.nan)
    error[:, bounded] = predicted - full[:, bounded]

    def by_run(measure: Callable[[np.ndarray], np.ndarray], histories: np.ndarray) -> tuple:
        # What is finite may be too large to be squared.
        with np.errstate(over="ignore", invalid="ignore"):
            parts = np.array([measure(part) for part in np.split(histories, ends)])
        return ("scenario", "output"), parts

    finite = np.isfinite(by_run(max_abs, error)[1][:, bounded]).all(axis=1)
    missing = np.full(len(finite), np.nan)
    trusted = predictions["trusted"].values > 0 if "trusted" in predictions else True
    seconds = predictions["seconds"].values if "seconds" in predictions else missing
    status = np.where(finite, np.where(trusted, "ok", "untrusted"), "diverged")
    return xr.Dataset(
        {
            "rms_error": by_run(rms, error),
            "max_error": by_run(max_abs, error),
            "signal_range": by_run(signal_range, full),
            "status": ("scenario", status),
            "trusted_until": ("scenario", missing),
            "seconds": ("scenario", seconds),
        },
        {"output": names, "output_unit": ("output", [truth[name].units for name in names])},
    )


def _row(label: str, part: xr.Dataset, bounds: Bounds) -> dict[str, Any]:
    """How the runs of a method keep some bounds."""
    ends = outcomes(part, bounds)
    worst = {name: outcomes(part, {name: bounds[name]}).scores.max() for name in bounds}
    return {
        "kind": "method",
        "label": label,
        **ends.counts,
        "score": float(ends.scores.max()),
        "median_score": float(np.median(ends.scores)),
        "output": max(worst, key=lambda name: worst[name]),
        "seconds": float(part["seconds"].mean()),
    }
