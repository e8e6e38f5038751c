"""Predictions of methods that are written outside of this package, judged as protocols judge."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.arguments import file_path, quoted
from vehiclemor.exceptions import CorruptError, FileError, InputError
from vehiclemor.metrics import max_abs, rms, signal_range
from vehiclemor.netcdf_file import opened, read_dataset
from vehiclemor.study.plans.choice import outcomes
from vehiclemor.study.plans.results import judged_part
from vehiclemor.study.plans.study_file import Bound, StudyFile
from vehiclemor.study.store import combined_path

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

# What a file of predictions must have from the test set that it predicts.
SAME = ("model", "test_set_digest")
# Variables on the runs that it may have: whether a run is to be trusted, and what it has taken.
TRUSTED, SECONDS = "trusted", "seconds"


def judge(file: str | Path, dataset: str | Path, results: str | Path = "results") -> pd.DataFrame:
    """Judge predictions of the test runs that `dataset` has written.

    Parameters
    ----------
    file
        netCDF file or Zarr folder with the attributes `model` and `test_set_digest` of the test
        set, and one variable (samples,) for each bounded output, by its name and in its unit, in
        the order of the test set.  May have: `trusted` (runs,), 0 where the method warns;
        `seconds` (runs,); and the attribute `method`.
    dataset
        Folder that `dataset` has written.
    results
        Results folder: `replay` and the chosen method stand below, if its protocol was run there.

    Returns
    -------
    pandas.DataFrame
        Rows of two kinds: `method`, then `output` for each bounded output.  Of the `runs`, `missed`
        ones violate a bound, `undetected` ones without a warning; errors `worst` and `median` are
        multiples of the bound, infinite of a run with values that are not finite.

    Raises
    ------
    VehiclemorError
        If a file can't be read, is of another test set, or lacks values.
    """
    import pandas as pd

    path, folder = file_path("file", file), file_path("dataset", dataset)
    places = [folder / "test.nc", folder / "test.zarr"]
    known = next((place for place in places if place.exists()), None)
    if known is None:
        raise FileError(f"{folder}: no test.nc; vehiclemor dataset MODEL writes such a folder")
    truth, found = _read(known, "test set"), _read(path, "file of predictions")
    if missing := {*SAME, "study", "outputs", "configuration"} - set(truth.attrs):
        raise FileError(f"{known}: no test set of this package, it has no {min(missing)}")
    bounds = StudyFile.model_validate_json(truth.attrs["configuration"]).bounds
    _check(path, found, truth, bounds)
    judged = np.flatnonzero(truth["judged"].values)
    if not len(judged):
        raise InputError(f"{known}: no run is judged")
    label = str(found.attrs.get("method", path.stem))
    part = _measured(found, truth, bounds).isel(scenario=judged)
    scores = {output: _row(label, part, {output: bound}) for output, bound in bounds.items()}
    rows = [{"kind": "method"} | _row(label, part, bounds)]
    rows += [{"kind": "method"} | row for row in _stored(truth, judged, bounds, results)]
    for output, row in scores.items():
        meaning = {"measure": bounds[output].measure, "bound": bounds[output].bound}
        units = truth[output].attrs["units"]
        rows.append({"kind": "output"} | row | {"output": output, "unit": units} | meaning)
    return pd.DataFrame(rows)


def _read(path: Path, kind: str) -> xr.Dataset:
    import xarray as xr
    from xarray.backends import NetCDF4DataStore

    if not path.is_dir():
        with opened(path, kind) as file:
            return xr.open_dataset(NetCDF4DataStore(file), decode_times=False).load()
    try:
        return xr.open_zarr(path, consolidated=False, decode_times=False).load()
    except (ImportError, LookupError, OSError, TypeError, ValueError) as error:
        raise CorruptError(f"not a readable {kind} ({quoted(error)})", path) from None


def _check(path: Path, found: xr.Dataset, truth: xr.Dataset, bounds: Mapping[str, Bound]) -> None:
    """Raise `InputError` if a file is not of predictions of this test set."""
    for name in SAME:
        if (given := found.attrs.get(name)) != (wanted := truth.attrs[name]):
            raise InputError(
                f"{path}: {name} is {quoted(given)}; of this test set it is {wanted!r}"
            )
    if missing := [output for output in bounds if output not in found]:
        raise InputError(f"{path}: has no {missing[0]}; needed are {', '.join(bounds)}")
    sizes = dict.fromkeys(bounds, truth.sizes["sample"])
    sizes |= {name: truth.sizes["run"] for name in (TRUSTED, SECONDS) if name in found}
    for name, size in sizes.items():
        if found[name].shape != (size,) or found[name].dtype.kind not in "biuf":
            given = f"shape {found[name].shape} of {found[name].dtype}"
            raise InputError(f"{path}: {name} has {given}; needed are {size} numbers")


def _measured(found: xr.Dataset, truth: xr.Dataset, bounds: Mapping[str, Bound]) -> xr.Dataset:
    """Errors of all runs, as a protocol has them of a method."""
    import xarray as xr

    names = truth.attrs["outputs"].split()
    guesses, given = list(bounds), {name: found[name].values for name in found}
    errors, ranges = [], []
    ends = np.cumsum(truth["row_size"].values)
    for end, size in zip(ends, truth["row_size"].values, strict=True):
        full = {name: truth[name].values[end - size : end] for name in names}
        error = [given[name][end - size : end] - full[name] for name in guesses]
        # An error may be too large to be squared.
        with np.errstate(all="ignore"):
            errors.append([measure(np.transpose(error)) for measure in (rms, max_abs)])
        ranges.append(signal_range(np.transpose([*full.values()])))
    finite = np.isfinite(errors).all(axis=(1, 2))
    trusted = given.get(TRUSTED, np.ones(len(finite))) > 0
    status = np.where(finite, np.where(trusted, "ok", "untrusted"), "diverged")
    dimensions = "scenario", "output"
    measured = {
        name: (dimensions, column)
        for name, column in zip(
            ("rms_error", "max_error"), np.moveaxis(np.array(errors), 1, 0), strict=True
        )
    }
    result = xr.Dataset(measured, {"output": guesses}).reindex(output=names)
    return result.assign(
        signal_range=(dimensions, np.array(ranges)),
        output_unit=("output", [truth[name].attrs["units"] for name in names]),
        status=("scenario", status),
        trusted_until=("scenario", np.full(len(status), np.inf)),
        seconds=("scenario", given.get(SECONDS, np.full(len(status), np.nan))),
    )


def _row(label: str, part: xr.Dataset, bounds: Mapping[str, Bound]) -> dict[str, Any]:
    """How the runs of a method keep some bounds."""
    found = outcomes(part, bounds)
    by_output = {name: outcomes(part, {name: bounds[name]}).scores.max() for name in bounds}
    return {
        "label": label,
        "runs": len(found.scores),
        "missed": int(found.missed.sum()),
        "undetected": int(found.undetected.sum()),
        "warned": int(found.warned.sum()),
        "worst": float(found.scores.max()),
        "median": float(np.median(found.scores)),
        "output": max(by_output, key=lambda name: by_output[name]),
        "seconds": float(part["seconds"].mean()),
    }


def _stored(
    truth: xr.Dataset, judged: Sequence[int] | np.ndarray, bounds: Mapping[str, Bound], results: Any
) -> Iterator[dict[str, Any]]:
    """Replay and the chosen method, if a protocol's stored result is of the same runs."""
    path = combined_path(file_path("results", results), truth.attrs["study"])
    if not path.exists():
        return
    part = judged_part(read_dataset(path, "source", "vehiclemor"))
    if part["scenario"].values.tolist() == truth["label"].values[judged].tolist():
        for label in part["label"].values.tolist():
            row = part.sel(label=label)
            if row["winner"] or row["method"] == "replay":
                yield _row(label, row, bounds)
