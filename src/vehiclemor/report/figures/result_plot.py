"""A picture of any result: histories of outputs, their errors, or a path."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.files import write_whole
from vehiclemor.registry import component, unknown
from vehiclemor.report.figures.lines import FULL, legend_above, styles
from vehiclemor.report.labels import axis_label, error_label

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

KINDS = ("histories", "errors", "paths")
# Panels of one picture.
MOST_OUTPUTS = 4


def plot_result(dataset: xr.Dataset, path: Path | None = None, kind: str = "histories") -> Figure:
    """Draw one run, or the runs of all methods at one point of a study's grid.

    Parameters
    ----------
    dataset
        With histories on `time`, and perhaps on `method`.
    path
        Picture to write.
    kind
        `histories` or `errors` of the outputs that tables show; `paths`: the second output over
        the first, which is the place of a vehicle or of a wheel.

    Raises
    ------
    InputError
        If the kind is unknown, or the result has no histories.
    """
    import matplotlib.style
    from matplotlib.figure import Figure

    if kind not in KINDS:
        raise unknown("kind of plot", kind, KINDS)
    if "time" not in dataset.dims:
        raise InputError("there are no histories to draw: this study keeps metrics alone")
    with matplotlib.style.context(Path(__file__).parents[1] / "style.mplstyle"):
        outputs = _shown(dataset) if kind != "paths" else dataset["output"].values[1:2]
        figure = Figure(figsize=(6.7, 1.4 + 1.5 * len(outputs)), layout="constrained")
        axes = figure.subplots(len(outputs), sharex=True, squeeze=False)[:, 0]
        for axis, output in zip(axes, outputs, strict=True):
            _draw(axis, dataset, str(output), kind)
        axes[-1].set_xlabel(
            axis_label(dataset, str(dataset["output"].values[0])) if kind == "paths" else "time (s)"
        )
        legend_above(figure, axes[0])
        if path is not None:
            write_whole(path, figure.savefig)
    return figure


def _shown(dataset: xr.Dataset) -> list[str]:
    model = json.loads(dataset.attrs["configuration"])["model"]
    return list(component("model", model).shown.outputs)[:MOST_OUTPUTS]


def _draw(axis: Axes, dataset: xr.Dataset, output: str, kind: str) -> None:
    """One output of the full-order run and of the reduced ones, or their errors."""
    several = "method" in dataset.dims
    labels = [str(m) for m in dataset["method"].values] if several else [dataset.attrs["title"]]
    runs = [dataset.sel({"method": m}) for m in labels] if several else [dataset]
    first = str(dataset["output"].values[0])
    full = runs[0]["reference_outputs"]
    across = full.sel(output=first) if kind == "paths" else dataset["time"]
    if kind != "errors":
        axis.plot(across, full.sel(output=output), label="full order", **FULL)
    for label, run, style in zip(labels, runs, styles(labels).values(), strict=True):
        if label.startswith("full_order"):
            continue
        values = run["outputs"].sel(output=output)
        if kind == "errors":
            values = np.abs(values - full.sel(output=output))
        elif kind == "paths":
            across = run["outputs"].sel(output=first)
        axis.plot(across, values, label=label.replace("_", " "), **style)
    axis.set_ylabel(axis_label(dataset, output))
    if kind == "errors":
        axis.set_ylabel(error_label(dataset, "error", output))
        axis.set_yscale("log", nonpositive="mask")
