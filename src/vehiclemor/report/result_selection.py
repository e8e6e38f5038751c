"""Results: which run is meant, of a file or at a point of a study's grid; they draw themselves."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
import xarray as xr

from vehiclemor.arguments import file_path, quoted
from vehiclemor.exceptions import InputError
from vehiclemor.metrics import errors
from vehiclemor.netcdf_file import read_dataset
from vehiclemor.registry import unknown
from vehiclemor.report.labels import Kind
from vehiclemor.study.plans.loading import content_hash, is_study, load_studies
from vehiclemor.study.plans.study_runs import FACTORS
from vehiclemor.study.store import combined_path, result_path

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vehiclemor.simulation.trajectory import Trajectory

KINDS: tuple[str, ...] = get_args(Kind)
# Values of a dimension that an error lists.
MOST_NAMED = 12


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
            found = result_path(results, study, content_hash(definition))
            if found is None:
                path = combined_path(results, study)
                raise InputError(f"{path}: no such result; vehiclemor run {name} makes it")
            path = found
    return read_dataset(path, "source", "vehiclemor", stored)


def select_point(
    dataset: xr.Dataset, kind: str, chosen: Mapping[str, object]
) -> tuple[xr.Dataset, str]:
    """What of a result is drawn: one point of a study's grid with all methods, and its name.

    A dimension that is not chosen is at its nominal or first value, but errors are drawn over it.
    The point stands in the title.
    """
    if not isinstance(kind, str) or kind not in KINDS:
        raise unknown("kind of plot", kind, KINDS)
    if "status" not in dataset:
        raise InputError("neither a run nor a study that can be drawn")
    grid = [str(d) for d in dataset["status"].dims]
    for key in chosen:
        if not grid:
            raise InputError(f"a single run has no dimension to choose, such as {quoted(key)}")
        if key not in grid:
            raise unknown("dimension of the result", key, grid)
    parts = []
    # A grid has methods; what has none, such as a timing, is refused where it is drawn.
    for dimension in grid if "label" in grid else ():
        values = dataset[dimension].values.tolist()
        if dimension not in chosen and (dimension == "label" or kind == "errors"):
            continue
        default = 1.0 if dimension in FACTORS and 1.0 in values else values[0]
        value: Any = chosen.get(dimension, default)
        # An array equals no value.
        places = [k for k, known in enumerate(values) if np.array_equal([known], [value])]
        if not places:
            known = ", ".join(map(str, values[:MOST_NAMED])) + ", ..." * (len(values) > MOST_NAMED)
            raise InputError(f"{dimension} is {quoted(value)}, not one of {known}")
        dataset = dataset.isel({dimension: places[0]})
        if len(values) > 1:
            parts.append(f"{dimension} {value}")
    point = ", ".join(parts)
    if point:
        title = f"{dataset.attrs.get('title', '')}\nat {point}".strip()
        dataset = dataset.assign_attrs(title=title)
    return dataset, point


@xr.register_dataset_accessor("vehiclemor")
class ResultAccessor:
    """What a result of this package can do beyond xarray."""

    def __init__(self, dataset: xr.Dataset) -> None:
        self._dataset = dataset

    def plot(self, kind: str = "histories", out: str | Path | None = None, **at: object) -> Figure:
        """Draw the result; see `vehiclemor.plot`."""
        from vehiclemor.report.figures.result_plot import plot_result

        dataset, _ = select_point(self._dataset, kind, at)
        return plot_result(dataset, None if out is None else file_path("out", out), kind)


def dataset_of(run: Trajectory, full: Trajectory | None = None) -> xr.Dataset:
    """A run as a dataset, with the outputs of the full-order run."""
    dataset = run.dataset()
    if full is None:
        return dataset
    found = errors(run, full)
    of_full = {"reference_outputs": (("time", "output"), full.chosen(run.names).outputs)}
    return dataset.assign(of_full).assign(found.data_vars)
