"""Results: which run is meant, of a file or at a point of a study's grid."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
import xarray as xr

from vehiclemor.arguments import file_path, quoted
from vehiclemor.error_measures import errors
from vehiclemor.exceptions import InputError
from vehiclemor.netcdf_file import read_dataset
from vehiclemor.registry import choice
from vehiclemor.report.labels import Kind
from vehiclemor.study.plans.loading import content_hash, is_study, load_studies
from vehiclemor.study.plans.study_runs import FACTORS
from vehiclemor.study.store import combined_path, result_path

if TYPE_CHECKING:
    from vehiclemor.simulation.trajectory import Trajectory

# Kinds of pictures of a run, or of a point of a grid.
KINDS: tuple[str, ...] = get_args(Kind)
# Values of a dimension that an error lists.
MOST_NAMED = 12


def result_kind(dataset: xr.Dataset) -> Literal["protocol", "grid", "other"]:
    """What a result is of; `other` is a timing, or a run without errors and outputs."""
    if "scenario_set" in dataset.coords:
        return "protocol"
    return "grid" if dataset.sizes.get("output") else "other"


def stored_result(name: str, results: Path) -> xr.Dataset:
    """A netCDF file, or the stored result of a study, by its name or by that of the result."""
    path = file_path("result", name)
    stored = path.suffix != ".nc"
    if stored:
        path = file_path("result", results / "studies" / f"{name}.nc")
        if is_study(name) or not path.exists():
            members = load_studies(name)
            if len(members) > 1:
                raise InputError(f"{name} is a collection: name one of {', '.join(members)}")
            ((study, definition),) = members.items()
            stored_path = result_path(results, study, content_hash(definition))
            if stored_path is None:
                path = combined_path(results, study)
                raise InputError(f"{path}: no such result; vehiclemor run {name} makes it")
            path = stored_path
    return read_dataset(path, stored)


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


def dataset_of(run: Trajectory, full: Trajectory | None = None) -> xr.Dataset:
    """A run as a dataset, with the outputs of the full-order run."""
    dataset = run.dataset()
    if full is None:
        return dataset
    reference = {"reference_outputs": (("time", "output"), full.chosen(run.names).outputs)}
    return dataset.assign(reference).assign(errors(run, full).data_vars)
