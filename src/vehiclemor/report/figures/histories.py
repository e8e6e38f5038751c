"""Time histories of any model: full order beside reduced models, and their errors."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vehiclemor.report.criteria.finding import at_point
from vehiclemor.report.figures.curves import (
    BREAK,
    Curve,
    Panel,
    compared,
    draw_errors,
    draw_history,
    draw_largest_errors,
)
from vehiclemor.report.figures.lines import (
    CROSS,
    Results,
    Style,
    legend_outside,
    letter,
    panels,
    styles,
)
from vehiclemor.report.labels import marked
from vehiclemor.report.published import rms_numbers

STARTS = {"equilibrium": "start in equilibrium", "dropped": "dropped start"}


class Look(NamedTuple):
    """How histories are drawn.

    Attributes
    ----------
    rows
        What each output has: `history`, `error` (over the time, beside the RMS error of the best
        approximation) or `largest error` (in each control period, with the RMS error over the run
        beside the published one).
    beside
        Outputs stand beside each other, not below each other.
    place
        Place in the study's grid.
    shown, marks
        Time up to which the runs are shown, and times at which a control period ends, in s.
    reach
        How far around the full-order signal the others are shown, as a multiple of its range.
    limits
        Of the axes of the largest errors.
    height, columns
        Of the figure, in inches, and of the legend.
    """

    rows: Sequence[str] = ("history",)
    beside: bool = False
    place: Mapping[str, object] = MappingProxyType({})
    shown: float | None = None
    marks: Sequence[float] = ()
    reach: float = 0.25
    limits: Sequence[float] | None = None
    height: float = 4.4
    columns: int = 4


def figure_histories(
    results: Results, *, outputs: Sequence[str], methods: Mapping[str, str], **options: Any
) -> Figure:
    """Panels for each output, one column for each start; `options` are those of `Look`.

    `methods` are labels of reduced models in the study with their texts in the legend.
    """
    look = Look(**options)
    (dataset,) = results.values()
    dataset = dataset.sel(dict(look.place))
    starts = [str(start) for start in dataset["start"].values.ravel()]
    columns = outputs if look.beside else starts
    rows = [(o, c) for o in ([""] if look.beside else outputs) for c in look.rows]
    figure, axes = panels(len(rows), len(columns), (6.7, look.height), sharex=True)
    ended: dict[str, str] = {}
    for row, (output, content) in enumerate(rows):
        for column, name in enumerate(columns):
            axis = axes[row, column]
            chosen = (starts[0], name) if look.beside else (name, output)
            ended |= _draw(axis, content, _panel(dataset, methods, *chosen), look)
            several = f" {STARTS.get(name, name)}" if len(starts) > 1 else ""
            axis.set_title(letter(row * len(columns) + column) + several)
    last = float(dataset["time"][-1])
    for axis in axes[-1]:
        part = f", first {look.shown:g} s of {last:g} s" if look.shown else ""
        axis.set_xlabel(f"time (s){part}")
        axis.set_xlim(0.0, look.shown or last)
    for text, color in ended.items():
        axes[0, 0].plot([], [], color=color, label=text, **CROSS)
    legend_outside(figure, axes.flat, look.columns)
    return figure


def _panel(dataset: xr.Dataset, methods: Mapping[str, str], start: str, output: str) -> Panel:
    """One output from one start, in the unit that suits all starts."""
    known = [method for method in methods if method in dataset["label"].values]
    runs = dataset.sel(start=start) if "start" in dataset.dims else dataset
    shown = styles(known)
    points = {m: at_point(runs, m) for m in known}
    curves = [Curve(marked(methods[m], run), shown[m], run) for m, run in points.items()]
    of_all = abs(dataset["reference_outputs"].sel(output=output)).max()
    return Panel(output, compared(points.values()), curves, float(of_all))


def _draw(axis: Axes, content: str, panel: Panel, look: Look) -> dict[str, str]:
    """One panel; what the crosses mean -> their colour."""
    ended: dict[str, str] = {}
    if content == "history":
        ended = draw_history(axis, panel, look.reach)
    elif content == "error":
        draw_errors(axis, panel)
    else:
        published = rms_numbers(str(panel.full.attrs["model"])).get(panel.output)
        last = float(panel.full["time"][-1])
        period = (published.control_period if published else None) or last / 50.0
        ended = draw_largest_errors(axis, panel, period, look.limits)
        if published:
            line: Style = {"color": "black", "linestyle": ":", "label": "published RMS error"}
            axis.axhline(published.value, **line)
    for number, moment in enumerate(look.marks):
        axis.axvline(moment, label="" if number else "end of a control period", **BREAK)
    return ended
