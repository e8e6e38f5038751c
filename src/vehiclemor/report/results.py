"""Results: which run is meant, a row for each run, and files of other formats."""

import itertools
import os
from collections import Counter
from collections.abc import Mapping
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import pandas as pd
import xarray as xr

from vehiclemor.arguments import file_path, quoted
from vehiclemor.error_measures import errors
from vehiclemor.exceptions import FileError, InputError
from vehiclemor.files import begins_with, replaceable, write_text, write_whole
from vehiclemor.netcdf_file import read_dataset
from vehiclemor.registry import choice, component
from vehiclemor.report.labels import Format, Kind, trained_runs
from vehiclemor.report.printing import ends_text, format_value
from vehiclemor.simulation.trajectory import EVALUATIONS, FINISHED, Trajectory
from vehiclemor.study.plans.loading import content_hash, is_study, load_studies
from vehiclemor.study.plans.study_runs import FACTORS
from vehiclemor.study.store import combined_path, result_path

# Kinds of pictures of a run, or of a point of a grid.
KINDS: tuple[str, ...] = get_args(Kind)
# Values of a dimension that an error lists.
MOST_NAMED = 12
# Kind of the rows of a grid in a comparison, and of what they have the median.
ERRORS = "errors"
MEDIANS = ("seconds", "offline_seconds", "evaluations")
# Package that writes a format, of the extra `convert`.
ENGINES = {"zarr": "zarr", "parquet": "pyarrow"}


def result_kind(dataset: xr.Dataset) -> Literal["protocol", "grid", "other"]:
    """What a result is of; `other` is a timing, or a run without errors and outputs."""
    if "scenario_set" in dataset.coords:
        return "protocol"
    return "grid" if dataset.sizes.get("output") else "other"


def stored_result(name: str, results: Path) -> xr.Dataset:
    """A netCDF file, or the stored result of a study, by its name or by that of the result."""
    path = file_path("result", name)
    if path.suffix == ".nc":
        return read_dataset(path)
    path = file_path("result", combined_path(results, name))
    if is_study(name) or not path.exists():
        members = load_studies(name)
        if len(members) > 1:
            raise InputError(f"{name} is a collection: name one of {', '.join(members)}")
        ((study, definition),) = members.items()
        path = combined_path(results, study)
        if result_path(results, study, content_hash(definition)) is None:
            raise InputError(f"{path}: no such result; vehiclemor run {name} makes it")
    return read_dataset(path, stored=True)


def select_point(
    dataset: xr.Dataset, kind: str, chosen: Mapping[str, object]
) -> tuple[xr.Dataset, str]:
    """What of a result is drawn: one point of a study's grid with all methods, and its name.

    A dimension that is not chosen is at its nominal or first value, but errors are drawn over it.
    The point stands in the title.
    """
    grid = check_point(dataset, kind, chosen)
    parts: list[str] = []
    for dimension in grid:
        values = dataset[dimension].values.tolist()
        if dimension not in chosen and (dimension == "label" or kind == "errors"):
            continue
        default = 1.0 if dimension in FACTORS and 1.0 in values else values[0]
        value: Any = chosen.get(dimension, default)
        dataset = dataset.isel({dimension: _index_of(dimension, values, value)})
        if len(values) > 1:
            parts.append(f"{dimension} {value}")
    point = ", ".join(parts)
    if point:
        title = f"{dataset.attrs.get('title', '')}\nat {point}".strip()
        dataset = dataset.assign_attrs(title=title)
    return dataset, point


def check_point(dataset: xr.Dataset, kind: str, chosen: Mapping[str, object]) -> list[str]:
    """Dimensions of a grid of methods, if this kind can be drawn where it is `chosen`."""
    choice("kind of plot", kind, KINDS)
    if "status" not in dataset:
        raise InputError("neither a run nor a study that can be drawn")
    dimensions = [str(name) for name in dataset["status"].dims]
    for key in chosen:
        if not dimensions:
            raise InputError(f"a single run has no dimension to choose, such as {key!r}")
        choice("dimension of the result", key, dimensions)
    # What has no methods, such as a timing, is refused where it is drawn.
    return dimensions if "label" in dimensions else []


def _index_of(dimension: str, values: list[Any], value: Any) -> int:
    for index, known in enumerate(values):
        # An array equals no value.
        if np.array_equal([known], [value]):
            return index
    listed = ", ".join(map(str, values[:MOST_NAMED]))
    if len(values) > MOST_NAMED:
        listed += ", ..."
    raise InputError(f"{dimension} is {quoted(value)}, not one of {listed}")


def at_point(dataset: xr.Dataset, label: str, **point: object) -> xr.Dataset:
    """One method at one point of the grid, without dimensions that have one value."""
    chosen = dataset.sel({"label": label, **point})
    single = [d for d in chosen["status"].dims if chosen.sizes[d] == 1]
    return chosen.squeeze(single, drop=True)


def dataset_of(run: Trajectory, full: Trajectory | None = None) -> xr.Dataset:
    """A run as a dataset, with the outputs of the full-order run."""
    dataset = run.dataset()
    if full is None:
        return dataset
    reference = {"reference_outputs": (("time", "output"), full.chosen(run.names).outputs)}
    return dataset.assign(reference).assign(errors(run, full).data_vars)


# Rows.


def frame(dataset: xr.Dataset) -> pd.DataFrame:
    """A row for each run, in the order of the grid; histories are left out.

    Columns are what varies (factors, parameters, start, label and its method, scenario), then the
    variables; one with further dimensions has a column for each of their values: `rms_error.toe`.
    """
    like = dataset["status"]
    columns: dict[str, np.ndarray] = {}
    dimensions = _further_dimensions(dataset)
    coordinates = [name for name in dimensions if name in dataset.coords]
    variables = [name for name in dimensions if name not in dataset.coords]
    for name in (*coordinates, *variables):
        further = dimensions[name]
        complete, _ = xr.broadcast(dataset[name], like)
        values = complete.transpose(*like.dims, *further).values.reshape(like.size, -1)
        columns |= zip(_names(dataset, name, further), values.T, strict=True)
    return pd.DataFrame(columns)


def _further_dimensions(dataset: xr.Dataset) -> dict[str, list[str]]:
    """Variable of a frame -> its dimensions beyond the runs'."""
    runs = set(dataset["status"].dims)
    dimensions: dict[str, list[str]] = {}
    for name, variable in dataset.variables.items():
        further = [str(d) for d in variable.dims if d not in runs]
        is_shown = name not in dataset.coords or (not further and variable.dims)
        if is_shown and not {"time", "input"} & set(further):
            dimensions[str(name)] = further
    return dimensions


def _names(dataset: xr.Dataset, name: str, further: list[str]) -> list[str]:
    labels = itertools.product(*(dataset[d].values.astype(str).tolist() for d in further))
    return [".".join((name, *label)) for label in labels]


def column_meanings(dataset: xr.Dataset) -> pd.DataFrame:
    """Name, unit and meaning of every column of a dataset's frame."""
    rows: list[dict[str, str]] = []
    for name, further in _further_dimensions(dataset).items():
        attributes, names = dataset[name].attrs, _names(dataset, name, further)
        units = [attributes.get("units", "")] * len(names)
        # Outputs may have different units.
        if "units" not in attributes and len(further) == 1:
            unit_of_each = dataset.coords.get(f"{further[0]}_unit")
            units = units if unit_of_each is None else unit_of_each.values.tolist()
        meaning = str(attributes.get("long_name", ""))
        pairs = zip(names, units, strict=True)
        rows += [{"column": column, "unit": unit, "meaning": meaning} for column, unit in pairs]
    return pd.DataFrame(rows)


def grid_rows(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """A row for each start, method and output of a combined dataset.

    `runs` are different ones; `failures` says how those that have `failed` ended, `reason` why.  Of
    those that have ended there are `median` and `largest` RMS errors over the grid, and at the
    point of the largest that of the best approximation (`floor`).  Seconds (of the compiled loop)
    and evaluations are medians.  `saturates_at` is the largest rank that the training allows, where
    more is asked for; else 0.
    """
    attributes = {key: str(dataset.attrs[key]) for key in ("study", "title", "model", "training")}
    head = {"kind": ERRORS, **attributes, "grid": _grid_text(dataset)}
    count = EVALUATIONS[component("model", head["model"]).kind]
    extended = dataset.assign(trained=trained_runs(dataset), evaluations=dataset[count])
    wanted = ["rms_error", "floor_rms_error", "cell_key", "status", "message", *MEDIANS]
    runs: Any = frame(extended[[*wanted, "effective_rank", "warned", "trained"]])
    # Points of the grid that a method does not depend on are one run.
    runs = runs.drop_duplicates(["start", "label", "cell_key"])
    saturated = saturated_ranks(dataset)
    rows: list[dict[str, Any]] = []
    for start, label in itertools.product(dataset["start"].values, dataset["label"].values):
        group = runs[(runs["start"] == start) & (runs["label"] == label)]
        about = head | {"start": str(start), "label": str(label)} | _counts(group)
        about["saturates_at"] = saturated.get(str(label), 0)
        varied = [str(d) for d in dataset["status"].dims if len(set(group[d])) > 1]
        ended = group[group["status"].isin(FINISHED)]
        for output, unit in dataset["output_unit"].to_series().items():
            errors = _errors(ended, str(output), varied)
            rows.append(about | {"output": str(output), "unit": unit} | errors)
    return rows


def saturated_ranks(dataset: xr.Dataset) -> dict[str, int]:
    """Label -> largest rank of its runs, where the grid asks for more than the training has."""
    wanted = ["effective_rank", "cell_key", "status"]
    if not {"rank", *wanted} <= set(dataset.variables) or "rank" not in dataset["status"].dims:
        return {}
    # A method that has no rank is one run at all ranks.
    runs: Any = frame(dataset[wanted]).drop_duplicates(["label", "cell_key"])
    runs = runs[runs["status"].isin(FINISHED)]
    ranks = runs.groupby("label", sort=False)["rank"].agg(["min", "max"])
    reached = runs.groupby("label", sort=False)["effective_rank"].max()
    less = reached[(ranks["min"] < ranks["max"]) & (reached < ranks["max"])]
    return {str(label): int(rank) for label, rank in less.items()}


def _counts(runs: Any) -> dict[str, Any]:
    """How runs have ended, and what they took."""
    failed = runs[~runs["status"].isin(FINISHED)]
    ended = runs.drop(failed.index).astype(dict.fromkeys(MEDIANS, float))
    ends = Counter(map(str, failed["status"])).most_common()
    counts: dict[str, Any] = {
        "effective_rank": int(runs["effective_rank"].max()),
        "runs": len(runs),
        "failed": len(failed),
        "failures": ", ".join(f"{n} {status}" for status, n in ends),
        "reason": next(iter(failed["message"]), ""),
        "warned": int(runs["warned"].sum()),
        "trained": int(runs["trained"].sum()),
    }
    for name in MEDIANS:
        counts[name] = float(ended[name][np.isfinite(ended[name])].median())
    return counts


def _errors(ended: Any, output: str, varied: list[str]) -> dict[str, Any]:
    """Errors of an output in the runs that have ended."""
    errors = ended[f"rms_error.{output}"].astype(float)
    errors = errors[np.isfinite(errors)]
    if errors.empty:
        return {"median": np.nan, "largest": np.nan, "largest_at": "", "floor": np.nan}
    worst, largest = ended.loc[errors.idxmax()], float(errors.max())
    point = [f"{d} {format_value(worst[d], '.4g')}" for d in varied]
    return {
        "median": float(errors.median()),
        "largest": largest,
        "largest_at": ", ".join(point) if largest > 0.0 else "",
        "floor": float(worst[f"floor_rms_error.{output}"]),
    }


def _grid_text(dataset: xr.Dataset) -> str:
    """The grid's dimensions with their values."""
    parts: list[str] = []
    for name in map(str, dataset["status"].dims):
        if name in ("label", "start"):
            continue
        values = [f"{v:g}" if isinstance(v, float) else str(v) for v in dataset[name].values]
        if len(values) > 8:
            parts.append(f"{name} {values[0]} to {values[-1]} ({len(values)})")
        elif values != ["1"]:
            parts.append(f"{name} {', '.join(values)}")
    return "; ".join(parts)


def counted_ends(dataset: xr.Dataset) -> str:
    """How the runs of a study have ended; a run that stands at several points counts once."""
    extended = dataset.assign(trained=trained_runs(dataset))
    wanted = {"status", "cell_key", "warned", "trained"} & set(extended)
    runs: Any = frame(extended[[*wanted]])
    # Runs of a protocol have no such files.
    if "cell_key" in wanted:
        runs = runs.drop_duplicates("cell_key")
    trained, warned = int(runs["trained"].sum()), runs["warned"] & (runs["status"] == "ok")
    note = f"; {trained} trained on the tested run" if trained else ""
    return ends_text(runs["status"], int(warned.sum())) + note


def convert(
    study: str | Path, to: Format, out: str | Path | None = None, results: str | Path = "results"
) -> Path:
    """Write the stored result of a study in another format.

    Parameters
    ----------
    study
        Name or file of a study that has been run, or a netCDF file of its result.
    to
        `zarr`: the whole dataset.  `parquet`, `csv`: a table with a row for each point of the grid,
        without histories; the columns of an output's errors are `rms_error.toe` and so on.  What
        columns mean and their units stand beside it in `NAME.columns.csv`.
    out
        New file or folder; under the study's name here by default.
    results
        Results folder.

    Raises
    ------
    VehiclemorError
        If there is no such result, a package is missing, or something is there already.
    """
    choice("format", to, get_args(Format))
    engine = ENGINES.get(to)
    if engine and not find_spec(engine):
        raise InputError(f"{to} needs the package {engine}: pip install 'vehiclemor[convert]'")
    name = str(file_path("study", study))
    path = Path(f"{Path(name).stem}.{to}") if out is None else file_path("out", out)
    if os.path.lexists(path):
        raise FileError(f"{path}: exists already; move it away")
    columns = path.with_suffix(".columns.csv")
    if not path.parent.is_dir():
        raise FileError(f"{path}: there is no such folder")
    dataset = stored_result(name, file_path("results", results))
    if "status" not in dataset:
        raise InputError(f"{name}: not the result of a study")
    if to == "zarr":
        # Texts of any length, as those of other chunks may be longer.
        texts = {n: v.astype(object) for n, v in dataset.variables.items() if v.dtype.kind == "U"}
        written = dataset.assign(texts).drop_encoding()
        return write_whole(path, partial(written.to_zarr, mode="w", consolidated=False))
    described = column_meanings(dataset).to_csv(index=False)
    # Those of another format of the same result are the same.
    replaceable(columns, "table of the same columns", begins_with(described.encode()))
    write_text(columns, described)
    rows = frame(dataset)
    write = rows.to_csv if to == "csv" else rows.to_parquet
    return write_whole(path, partial(write, index=False))
