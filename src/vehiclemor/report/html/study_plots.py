"""Interactive plots of a study on a grid: paths y over x, and errors over the grid."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.report.criteria.finding import at_point
from vehiclemor.report.figures.curves import PATH, compared
from vehiclemor.report.figures.lines import FULL, styles
from vehiclemor.report.figures.result_plot import shown_outputs
from vehiclemor.report.html.interactive import (
    HINT,
    as_items,
    legend_name,
    look,
    new_figure,
    tapped,
    with_legend,
)
from vehiclemor.report.html.parts import Plot
from vehiclemor.report.html.study_table import sampled
from vehiclemor.report.labels import label_of, method_text, unit_of
from vehiclemor.report.result_selection import drawn
from vehiclemor.study.plans.study_file import FACTORS

if TYPE_CHECKING:
    import xarray as xr

# Points of a path, maps beside one another, and points of a map or of all curves.
ON_A_PATH, MAPS, POINTS = 500, 6, 20_000


def study_plots(dataset: xr.Dataset, name: str) -> list[Plot]:
    """What can be looked into of a study; nothing where there is neither a path nor a grid."""
    made = {"paths": _paths(dataset), "errors": _errors(dataset)}
    return [
        Plot(f"plot-{name}-{kind}", caption, as_items(*figures))
        for kind, (figures, caption) in made.items()
        if figures
    ]


def _paths(dataset: xr.Dataset) -> tuple[list[Any], str]:
    """Paths of all methods at one point of the grid, with the time at each place."""
    if not (set(PATH) <= set(dataset["output"].values) and dataset.sizes.get("time")):
        return [], ""
    point, words = drawn(dataset, "paths", {})
    point = point[["outputs", "reference_outputs", "status"]].load()
    told = {"": "@name", "time": "@time{0.00} s", "X": "@x{0.000} m", "Y": "@y{0.0000} m"}
    made = new_figure("X (m)", "Y (m), not to the scale of X", told)
    methods = [str(m) for m in point["method"].values]
    reduced = [m for m in methods if not m.startswith("full_order")]
    looks = styles(reduced)
    runs = {m: at_point(point, m) for m in methods}
    curves = {"full order": (compared(runs.values())["reference_outputs"], FULL)}
    curves |= {method_text(m): (runs[m]["outputs"], looks[m]) for m in reduced}
    every = slice(None, None, -(-point.sizes["time"] // ON_A_PATH))
    times = point["time"].values[every].astype("f4")
    for label, (outputs, style) in curves.items():
        x, y = (
            outputs.sel(output=list(PATH)).transpose("output", "time").values[:, every].astype("f4")
        )
        data: dict[str, Any] = {"x": x, "y": y, "time": times, "name": [label] * len(x)}
        made.line("x", "y", source=data, legend_label=legend_name(label), **look(style))
    at = f" at {words}" if words else ""
    return [with_legend(made)], f"Interactive: paths of all methods{at}. {HINT}"


def _errors(dataset: xr.Dataset) -> tuple[list[Any], str]:
    """RMS errors of the first shown output over the grid: curves over one axis, maps over two."""
    part, axes, words = _error_axes(dataset)
    methods = [str(m) for m in dataset["method"].values if not str(m).startswith("full_order")]
    if not axes or not methods:
        return [], ""
    output = shown_outputs(dataset)[0]
    label = f"{label_of(output).words}, RMS error ({unit_of(dataset, output)})"
    values = part["rms_error"].sel({"output": output, "method": methods}).load()
    keys = part.get("cell_key")
    if values.size > POINTS:
        return [], ""
    tables = {m: _table(values, keys, m, axes) for m in methods}
    tables = {m: source for m, source in tables.items() if len(source.data["error"])}
    if not tables:
        return [], ""
    at = f", at {', '.join(words)}" if words else ""
    if len(axes) == 1:
        # Samples have no order: the first of what differs between them stands for it.
        axis = [*sampled(dataset), *axes][0] if axes == ["sample"] else axes[0]
        caption = f"Interactive: {label} over {axis.replace('_', ' ')}{at}; a tap on a point "
        return [_curves(tables, axis, label)], f"{caption}leads to its cell. {HINT}"
    shown = dict(list(tables.items())[:MAPS])
    caption = (
        f"Interactive: {label} over the grid{at}; a tap leads to the cell, where it is listed."
    )
    return _maps(shown, axes), caption


def _error_axes(dataset: xr.Dataset) -> tuple[xr.Dataset, list[str], list[str]]:
    """Axes of the plot, both factors or the longest of numbers, and the place of all others.

    Returns
    -------
    dataset, list of str, list of str
        The dataset at one place of all other dimensions, the axes, and that place in words.
    """
    grid = {str(d): dataset.sizes[d] for d in dataset["status"].dims if d != "method"}
    grid = {d: size for d, size in grid.items() if size > 1}
    numbers = [d for d in grid if np.issubdtype(dataset[d].dtype, np.number)]
    axes = sorted(numbers, key=lambda d: grid[d])[-1:]
    axes = [str(f) for f in FACTORS] if set(FACTORS) <= set(numbers) else axes
    at = {
        d: 1.0 if d in FACTORS and 1.0 in dataset[d].values else dataset[d].values[0] for d in grid
    }
    at = {d: value for d, value in at.items() if d not in axes}
    return dataset.sel(at), axes, [f"{d.replace('_', ' ')} {value}" for d, value in at.items()]


def _table(values: xr.DataArray, keys: xr.DataArray | None, method: str, axes: list[str]) -> Any:
    """Columns of the points of a method that have an error above zero."""
    from bokeh.models import ColumnDataSource

    part = values.sel({"method": method}).squeeze(drop=True).stack(place=axes)
    part = part[np.isfinite(part.values) & (part.values > 0.0)]
    own = {
        str(n): c.values for n, c in part.coords.items() if n != "place" and c.dims == ("place",)
    }
    columns = own | {"error": part.values.astype("f4"), "name": [method_text(method)] * part.size}
    names: list[str] = [""] * part.size
    if keys is not None:
        found = keys.sel({"method": method}).squeeze(drop=True).stack(place=axes)
        names = [f"cell-{key}" for key in found.sel(place=part["place"]).values]
    columns["cell"] = names
    return ColumnDataSource(columns)


def _curves(tables: dict[str, Any], axis: str, label: str) -> Any:
    any_table = next(iter(tables.values()))
    told = {"": "@name", "error": "@error{0.00e}"}
    places = [n for n in any_table.column_names if n not in ("error", "name", "cell")]
    told |= {n.replace("_", " "): f"@{{{n}}}" for n in places} | {"at": "@cell"}
    made = new_figure(axis.replace("_", " "), label, told, y_axis_type="log")
    for (method, source), style in zip(tables.items(), styles(tables).values(), strict=True):
        common = {"source": source, "legend_label": legend_name(method_text(method))}
        if "sample" not in places:
            made.line(axis, "error", **common, **look(style))
        made.scatter(axis, "error", size=6, color=style["color"], **common)
        tapped(made, source)
    return with_legend(made)


def _maps(tables: dict[str, Any], axes: list[str]) -> list[Any]:
    """A map of the errors of each method, all in the same colours."""
    from bokeh.models import ColorBar, LogColorMapper
    from bokeh.transform import transform

    errors = np.concatenate([source.data["error"] for source in tables.values()])
    low, high = float(errors.min()), float(errors.max())
    made = []
    for method, source in tables.items():
        colors = LogColorMapper(palette="Viridis256", low=low, high=high)
        told = {a.replace("_", " "): f"@{{{a}}}" for a in axes}
        told |= {"error": "@error{0.00e}", "at": "@cell"}
        x, y = axes
        figure = new_figure(
            x.replace("_", " "), y.replace("_", " "), told, height=320, title=method_text(method)
        )
        steps = [np.diff(np.unique(source.data[a])) for a in axes]
        # At unequal steps there are gaps, and no cell lies on another.
        sizes = [step.min() if step.size else 1.0 for step in steps]
        figure.rect(
            x, y, *sizes, source=source, fill_color=transform("error", colors), line_color=None
        )
        figure.grid.visible = False
        figure.add_layout(ColorBar(color_mapper=colors, width=10), "right")
        tapped(figure, source)
        made.append(figure)
    return made
