"""Time histories and paths of any model: full order beside reduced models, and their errors."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vehiclemor.report.criteria.finding import at_point
from vehiclemor.report.figures.lines import (
    CROSS,
    FULL,
    Results,
    Style,
    legend_above,
    letter,
    styles,
)
from vehiclemor.report.labels import axis_label, error_label
from vehiclemor.report.published import rms_numbers

PUBLISHED = "published RMS error"
STARTS = {"equilibrium": "start in equilibrium", "dropped": "dropped start"}


class Line(NamedTuple):
    """A method in a study: its label there, its text in the legend and its style."""

    method: str
    text: str
    style: Style


class Panel(NamedTuple):
    """One output of a study from one start, and the reduced models that are drawn."""

    dataset: xr.Dataset
    output: str
    lines: Sequence[Line]


class Look(NamedTuple):
    """How histories are drawn.

    Attributes
    ----------
    rows
        What each output has a row of: `history`, `error` (over the time, beside the RMS error of
        the best approximation) or `largest error` (in each control period, beside the published).
    place
        Place in the study's grid.
    shown, marks
        Time up to which the runs are shown, and times of vertical lines, in s.
    whole
        Draw lines in full, instead of up to where they leave the full-order signal's range.
    limits
        Of the axes of the largest errors.
    height, columns
        Of the figure, in inches, and of the legend.
    """

    rows: Sequence[str] = ("history",)
    place: Mapping[str, object] = MappingProxyType({})
    shown: float | None = None
    marks: Sequence[float] = ()
    whole: bool = False
    limits: Sequence[float] | None = None
    height: float = 4.4
    columns: int = 4


def figure_histories(
    results: Results, *, outputs: Sequence[str], methods: Mapping[str, str], **options: Any
) -> Figure:
    """Rows of panels for each output, one column for each start; `options` are those of `Look`.

    `methods` are labels of reduced models in the study with their texts in the legend.
    """
    look = Look(**options)
    (dataset,) = results.values()
    dataset = dataset.sel(dict(look.place))
    lines = _lines(dataset, methods)
    starts = [str(start) for start in dataset["start"].values]
    shape = len(outputs) * len(look.rows), len(starts)
    figure, axes = plt.subplots(*shape, sharex=True, squeeze=False, figsize=(6.7, look.height))
    ended: dict[str, str] = {}
    contents = [
        (output, content, start) for output in outputs for content in look.rows for start in starts
    ]
    for number, (axis, (output, content, start)) in enumerate(
        zip(axes.flat, contents, strict=True)
    ):
        panel = Panel(dataset.sel(start=start), output, lines)
        if content == "history":
            ended |= _draw_history(axis, panel, look.whole)
        elif content == "error":
            _draw_errors(axis, panel)
        else:
            ended |= _draw_largest_errors(axis, panel, look.limits)
        for moment in look.marks:
            axis.axvline(moment, color="#999999", linewidth=0.8, linestyle=(0, (1, 3)))
        several = f" {STARTS.get(start, start)}" if len(starts) > 1 else ""
        axis.set_title(letter(number) + several)
    last = float(dataset["time"][-1])
    for axis in axes[-1]:
        part = f", first {look.shown:g} s of {last:g} s" if look.shown else ""
        axis.set_xlabel(f"time (s){part}")
        axis.set_xlim(0.0, look.shown or last)
    for text, color in ended.items():
        axes[0, 0].plot([], [], color=color, label=text, **CROSS)
    if "history" in look.rows and "largest error" in look.rows:
        # The legend is that of the first panel.
        axes[0, 0].plot([], [], color="black", linestyle=":", label=PUBLISHED)
    legend_above(figure, axes[0, 0], look.columns)
    return figure


def _lines(dataset: xr.Dataset, methods: Mapping[str, str]) -> list[Line]:
    known = [method for method in methods if method in dataset["method"].values]
    return [Line(m, methods[m], style) for m, style in styles(known).items()]


def _draw_history(axis: Axes, panel: Panel, whole: bool) -> dict[str, str]:
    """One output of the full and the reduced models; what the crosses mean -> their colour."""
    dataset, output, lines = panel
    full = at_point(dataset, "full_order")["outputs"].sel(output=output)
    axis.plot(full.time, full, label="full order", **FULL)
    axis.set_ylabel(axis_label(dataset, output))
    low, high = float(full.min()), float(full.max())
    margin = 0.25 * (high - low)
    if not whole and margin > 0.0:
        axis.set_ylim(low - margin, high + margin)
    left: dict[str, str] = {}
    for method, text, style in lines:
        history = at_point(dataset, method)["outputs"].sel(output=output)
        if whole:
            axis.plot(full.time, history, label=text, **style)
        elif _plot_until_it_leaves(axis, history, text, style):
            left["leaves the axes"] = style["color"]
    axis.ticklabel_format(style="plain")
    if not whole:
        axis.locator_params(axis="y", nbins=5)
    return left


def _plot_until_it_leaves(axis: Axes, history: xr.DataArray, text: str, style: Style) -> bool:
    """Draw a history up to the first point outside the axes, and a cross there."""
    low, high = axis.get_ylim()
    time, values = history["time"].values, history.values.copy()
    outside = np.flatnonzero(~((values >= low) & (values <= high)))
    if outside.size:
        first = int(outside[0])
        # A run that has diverged ends without a value.
        seen = first if np.isfinite(values[first]) else max(first - 1, 0)
        place = (time[seen], np.clip(values[seen], low, high))
        axis.plot(*place, color=style["color"], clip_on=False, **CROSS)
        values[first + 1 :] = np.nan
    axis.plot(time, values, label=text, **style)
    return bool(outside.size)


def _draw_errors(axis: Axes, panel: Panel) -> None:
    """Errors over the time, and the RMS error of the best approximation by the first method."""
    dataset, output, lines = panel
    for method, text, style in lines:
        run = at_point(dataset, method)
        error = (run["outputs"] - run["reference_outputs"]).sel(output=output)
        axis.plot(run.time, error, label=text, **style)
    floors = (
        at_point(dataset, line.method)["floor_rms_error"].sel(output=output) for line in lines
    )
    floor = next((float(value) for value in floors if np.isfinite(value)), None)
    if floor is not None:
        shade = {"color": "#BBBBBB", "alpha": 0.5, "label": "RMS of the best approximation"}
        axis.axhspan(-floor, floor, **shade)
    axis.set_ylabel(error_label(dataset, "error", output))


def _draw_largest_errors(
    axis: Axes, panel: Panel, limits: Sequence[float] | None
) -> dict[str, str]:
    """Largest error in each of the published control periods; the meaning of crosses."""
    dataset, output, lines = panel
    published = rms_numbers(str(dataset.attrs["model"])).get(output)
    last = float(dataset["time"][-1])
    period = published.control_period if published else None
    ended: dict[str, str] = {}
    for method, text, style in lines:
        run = at_point(dataset, method)
        error = abs(run["outputs"] - run["reference_outputs"]).sel(output=output)
        edges, largest = _largest(error, period or last / 50.0)
        axis.semilogy(edges, largest, label=text, drawstyle="steps-post", **style)
        missing = np.flatnonzero(np.isnan(largest))
        if missing.size:
            ended["has diverged"] = style["color"]
            place = edges[missing[0]], largest[max(missing[0] - 1, 0)]
            axis.plot(*place, color=style["color"], **CROSS)
    if published:
        axis.axhline(published.value, color="black", linestyle=":", label=PUBLISHED)
    if limits:
        axis.set_ylim(*limits)
    axis.set_ylabel(error_label(dataset, "largest error", output).replace(" of ", "\nof "))
    return ended


def _largest(error: xr.DataArray, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Starts of the periods (n,) in s and the largest error in each."""
    # A sample between two periods belongs to the one that ends there.
    window = np.maximum(np.ceil(error["time"].values / period - 1e-9).astype(int) - 1, 0)
    starts = np.unique(window)
    return period * starts, np.array([np.fmax.reduce(error.values[window == k]) for k in starts])


def figure_paths(results: Results, *, methods: Mapping[str, str], shown: Sequence[float]) -> Figure:
    """Path in the plane from equilibrium, one panel for each length (m) that is shown."""
    (dataset,) = results.values()
    figure, axes = plt.subplots(len(shown), 1)
    for number, (axis, furthest) in enumerate(zip(axes, shown, strict=True)):
        for method, text, style in _lines(dataset, {"full_order": "full order", **methods}):
            path = at_point(dataset, method, start="equilibrium")["outputs"]
            x, y = (path.sel(output=f"{way}_position") for way in ("longitudinal", "lateral"))
            axis.plot(x, y, label=text, **style)
        axis.set_xlim(0.0, furthest)
        axis.set_ylabel("Y (m)")
        axis.set_title(letter(number))
    axes[-1].set_xlabel("X (m), not to the scale of Y")
    legend_above(figure, axes[0])
    return figure


def figure_replayed_paths(
    results: Results, *, methods: Mapping[str, str], beside_replay: bool = False, columns: int = 4
) -> Figure:
    """Lateral position over the time without steering, bases from a lane change.

    With `beside_replay` a second panel shows what sets the reduced models apart from replay.
    """
    (dataset,) = results.values()
    panels, output = 2 if beside_replay else 1, "lateral_position"
    size = (6.7, 4.8 if beside_replay else 3.2)
    figure, axes = plt.subplots(panels, 1, sharex=True, squeeze=False, figsize=size)
    upper, lower = axes[0, 0], axes[-1, 0]
    runs = dataset["outputs"].sel(start="equilibrium", output=output).squeeze(drop=True)
    replay = runs.sel({"method": "replay"})
    for method, text, style in _lines(dataset, methods):
        run = runs.sel({"method": method})
        upper.plot(run.time, run, label=text, **style)
        if beside_replay and method not in ("full_order", "replay"):
            lower.plot(run.time, 1e3 * (run - replay), label=text, **style)
    upper.set_xlim(0.0, float(dataset["time"][-1]))
    upper.set_ylabel(axis_label(dataset, output))
    if beside_replay:
        upper.set_title("(a)")
        lower.set_title("(b)")
        lower.set_ylabel("Y minus replay's Y (mm)")
    lower.set_xlabel("time (s)")
    legend_above(figure, upper, columns)
    return figure
