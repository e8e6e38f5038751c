"""Errors of any study over what it varies: curves, bands or maps.

Which of them follows from the dimensions of its grid, whatever model and methods it has.
"""

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vehiclemor.report.figures.error_map import figure_error_map
from vehiclemor.report.figures.lines import CROSS, Style, legend_outside, letter, panels, styles
from vehiclemor.report.figures.places import FEW_DECADES, Places, places_of, tick_decades
from vehiclemor.report.labels import (
    error_label,
    method_text,
    readable_unit,
    trained_runs,
    unit_of,
)
from vehiclemor.simulation.trajectory import FINISHED
from vehiclemor.study.plans.study_file import FACTORS, PARAMETER

# Lines of a panel, starts with panels of their own, columns of maps, and cells of a map with their
# number.
LINES, STARTS, MAPS, WRITTEN = 8, 3, 4, 100
# Without the marks of what a logarithmic axis can't show.
MARKERS = "os^D<>phP*d"
NONE: Style = {"marker": 7, "markersize": 6, "linestyle": "none"}


class Line(NamedTuple):
    """Errors of one line; infinite where a run has failed.

    Attributes
    ----------
    text, style
        What the legend says, and how it is drawn.
    errors
        On the dimensions output, start, the axis, and what bands are over.
    """

    text: str
    style: Style
    errors: xr.DataArray


def figure_grid_errors(dataset: xr.Dataset, outputs: Sequence[str]) -> Figure | None:
    """RMS errors over the grid, None if it is a single point.

    Curves over one axis, a line for each method and for each combination of what else there is,
    panels for each start; where that would be too many lines, a map over two axes, or medians with
    bands from the smallest to the largest error.
    """
    errors = dataset["rms_error"].where(dataset["status"].isin(FINISHED), np.inf)
    methods = [str(m) for m in dataset["label"].values]
    methods = [m for m in methods if not m.startswith("full_order")] or methods
    sizes = {str(d): dataset.sizes[d] for d in dataset["status"].dims if d != "label"}
    sizes = {name: size for name, size in sizes.items() if size > 1}
    if not sizes:
        return None
    numbers = [d for d in sizes if np.issubdtype(dataset[d].dtype, np.number)]
    axis = max(numbers or sizes, key=lambda d: (d in FACTORS, sizes[d]))
    starts = "start" if 1 < sizes.get("start", 1) <= STARTS and axis != "start" else ""
    others = [d for d in sizes if d not in (axis, starts)]
    if set(FACTORS) <= set(numbers):
        return _map(dataset, errors, (outputs, methods), FACTORS)
    found = {m: errors.sel(label=m, drop=True) for m in methods}
    # Name of a line -> its text, its errors.
    lines = {k: line for m in methods for k, line in _lines(m, found[m], others).items()}
    if len(lines) > max(LINES, len(methods)):
        if len(others) == 1 and others[0] in numbers and len(methods) <= MAPS:
            return _map(dataset, errors, (outputs, methods), (axis, others[0]))
        lines = {m: (method_text(m), found[m]) for m in methods}
    looks = styles(lines)
    drawn = [Line(text, looks[name], e) for name, (text, e) in lines.items()]
    return _curves(dataset, drawn, outputs, (axis, starts))


def _lines(
    method: str, errors: xr.DataArray, others: Sequence[str]
) -> dict[str, tuple[str, xr.DataArray]]:
    """A line for each combination of what this method's errors depend on."""
    own = [d for d in others if not bool((errors == errors.isel({d: 0})).all())]
    errors = errors.isel({d: 0 for d in others if d not in own}, drop=True)
    units = [str(errors[d].attrs.get("units", "")).removesuffix("1") for d in own]
    found = {}
    for place in itertools.product(*(errors[d].values.tolist() for d in own)):
        shown = [v if isinstance(v, str) else f"{v:g}" for v in place]
        parts = zip(map(_words, zip(own)), shown, units, strict=True)
        values = [" ".join(filter(None, part)) for part in parts]
        chosen = errors.sel(dict(zip(own, place, strict=True)), drop=True)
        name, text = (", ".join([m, *values]) for m in (method, method_text(method)))
        found[name] = text, chosen
    return found


def _curves(
    dataset: xr.Dataset, lines: Sequence[Line], outputs: Sequence[str], axes: tuple[str, str]
) -> Figure:
    """A row of panels for each output, a column for each start."""
    axis, starts = axes
    columns = dataset[starts].values.tolist() if starts else [None]
    # Outputs beside each other where there is room.
    wide = 2 if len(columns) == 1 and len(outputs) > 1 else len(columns)
    rows = -(-len(outputs) * len(columns) // wide)
    figure, grid = panels(rows, wide, (6.7 if wide < 3 else 8.5, 2.5 * rows + 0.7), sharex=True)
    places = places_of(dataset, axis)
    contents = [(output, start) for output in outputs for start in columns]
    rest = sorted({str(d) for line in lines for d in line.errors.dims})
    rest = [d for d in rest if d not in (axis, starts, "output") and dataset.sizes[d] > 1]
    for number, (panel, (output, start)) in enumerate(zip(grid.flat, contents, strict=False)):
        place = {"output": output} | ({starts: start} if starts else {})
        chosen = [line._replace(errors=line.errors.sel(place)) for line in lines]
        factor, unit = _unit(chosen, unit_of(dataset, output))
        _draw(panel, places, [x._replace(errors=factor * x.errors) for x in chosen], axis)
        panel.set_ylabel(error_label(dataset, "RMS error", output, unit))
        panel.set_title(f"{letter(number)} {'' if start is None else f'start {start}'}")
    for panel in grid.flat[len(contents) :]:
        panel.remove()
        grid.flat[len(contents) - wide].tick_params(labelbottom=True)
        grid.flat[len(contents) - 1].tick_params(labelbottom=True)
    for panel in figure.axes[-wide:]:
        places.scale(panel)
    title = (
        f"medians over {_words(rest)}, bands from the smallest to the largest error" if rest else ""
    )
    figure.suptitle(titled(dataset, title))
    legend_outside(figure, figure.axes, 0, "lower")
    return figure


def titled(dataset: xr.Dataset, more: str) -> str:
    """Title of the result, and a line below it; which of its runs were trained on, if any."""
    runs = trained_runs(dataset)
    trained = f"{int(runs.sum())} of {runs.size} runs were in their own training"
    lines = str(dataset.attrs.get("title", "")), more, trained if bool(runs.any()) else ""
    return "\n".join(filter(None, lines))


def _unit(lines: Sequence[Line], unit: str) -> tuple[float, str]:
    """Factor and unit in which errors of few decades have few digits."""
    values = np.concatenate([line.errors.values.ravel() for line in lines])
    values = values[np.isfinite(values) & (values > 0.0)]
    # Axes are a tenth longer.
    if not values.size or 1.1 * np.log10(values.max() / values.min()) >= FEW_DECADES:
        return 1.0, unit
    return readable_unit(float(np.median(values)), unit)


def _draw(panel: Axes, where: Places, lines: Sequence[Line], axis: str) -> None:
    """Lines of one panel; crosses at its upper edge where runs have failed."""
    places = where.at
    for number, (text, style, errors) in enumerate(lines):
        values = errors.transpose(axis, ...).values.reshape(len(places), -1)
        known = np.where(np.isfinite(values) & (values > 0.0), values, np.nan)
        some = np.isfinite(known).any(axis=1)
        middle = np.full(len(places), np.nan)
        middle[some] = np.nanmedian(known[some], axis=1)
        # Names have no order that a line could follow.
        look: Style = {**style, "marker": MARKERS[number % len(MARKERS)], "markersize": 4}
        look |= {"linestyle": "none"} if where.names else {}
        panel.plot(places, middle, label=text, **look)
        if values.shape[1] > 1:
            low, high = (f(known[some], axis=1) for f in (np.nanmin, np.nanmax))
            band: Style = {"color": style["color"], "alpha": 0.15, "linewidth": 0.0}
            panel.fill_between(places[some], low, high, **band)
        draw_edges(panel, places, values, style["color"])
    scale_errors(panel)


def scale_errors(panel: Axes) -> None:
    """A logarithmic axis of errors, and last in the legend what it can't show."""
    panel.set_yscale("log")
    tick_decades(panel.yaxis, *panel.get_ylim())
    crosses, none = (
        any(line.get_marker() == look["marker"] for line in panel.lines) for look in (CROSS, NONE)
    )
    if crosses:
        panel.plot([], [], color="black", label="a run has failed", **CROSS)
    if none:
        panel.plot([], [], color="black", label="error 0, off the log axis", **NONE)


def draw_edges(panel: Axes, places: np.ndarray, values: np.ndarray, color: str) -> None:
    """What a logarithmic axis can't show: failed runs above it, errors that are 0 below it."""
    edge: Style = {"color": color, "transform": panel.get_xaxis_transform(), "clip_on": False}
    failed = places[np.isinf(values).any(axis=1) | np.isnan(values).any(axis=1)]
    if failed.size:
        panel.plot(failed, np.ones(failed.size), **(CROSS | edge))
    none = places[(values == 0.0).any(axis=1)]
    if none.size:
        panel.plot(none, np.zeros(none.size), **(NONE | edge))


def _map(
    dataset: xr.Dataset,
    errors: xr.DataArray,
    shown: tuple[Sequence[str], Sequence[str]],
    axes: tuple[str, str],
) -> Figure:
    """Errors over two axes, the largest over all others."""
    outputs, methods = shown
    rest = [str(d) for d in errors.dims if d not in (*axes, "output", "label")]
    largest = dataset.assign(rms_error=errors.max(rest))
    texts = {m: method_text(m) for m in methods}
    written = math.prod(dataset.sizes[d] for d in axes) <= WRITTEN
    options = {"outputs": outputs, "methods": texts, "values": written, "axes": axes}
    figure = figure_error_map({"": largest}, **options)
    crosses = ", a cross where a run has failed" if bool(np.isinf(errors).any()) else ""
    words = f"{largest_over(dataset, rest)}{crosses}".removeprefix(", ")
    figure.suptitle(titled(dataset, words))
    return figure


def largest_over(dataset: xr.Dataset, dimensions: Sequence[str]) -> str:
    """What is said of dimensions over which the largest error is drawn."""
    several = [d for d in dimensions if dataset.sizes[d] > 1]
    return f", the largest error over {_words(several)}" if several else ""


def _words(dimensions: Sequence[str]) -> str:
    *head, last = (d.removeprefix(PARAMETER).replace("_", " ") for d in dimensions or [""])
    return f"{', '.join(head)} and {last}" if head else last
