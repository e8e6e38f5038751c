"""Errors of any study over what it varies, or of one point.

Curves go over one dimension of the study's grid, whatever model and methods it has; where there
would be too many, they show the largest error over the others.  Of a protocol it is the worst error
over the time of a run.
"""

import itertools
import json
import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vehiclemor.exceptions import InputError
from vehiclemor.report import labels
from vehiclemor.report.figures import theme
from vehiclemor.report.figures.runs import legend_of, shown_outputs
from vehiclemor.report.figures.theme import Style, Ticks, tick_decades, ticks_of
from vehiclemor.report.published import rms_numbers
from vehiclemor.report.results import at_point, saturated_ranks
from vehiclemor.report.unseen import method_rows
from vehiclemor.simulation.trajectory import FINISHED
from vehiclemor.study.plans.protocol import FULL_ORDER
from vehiclemor.study.plans.study_runs import FACTORS, PARAMETER

# What a logarithmic axis can't show: mark, height as a share of the axes, text, which errors.
OFF: tuple[tuple[Style, float, str, Callable[[np.ndarray], np.ndarray]], ...] = (
    (theme.CROSS, 1.0, "a run has failed", lambda errors: ~np.isfinite(errors)),
    (theme.ZERO, 0.0, "error 0, off the log axis", lambda errors: errors == 0.0),
)
# Full-order integrators: of twelve no two look alike.
GREYS: list[Style] = [
    {"color": color, "linestyle": line, "marker": marker, "markersize": 4, "linewidth": 0.8}
    for line, marker in (("-", "o"), ("--", "*"), (":", "X"))
    for color in ("#000000", "#777777", "#AAAAAA", "#444444")
]
# Label -> text, errors on the dimensions output and the axis.
Lines = Mapping[str, tuple[str, xr.DataArray]]


def figure_errors(dataset: xr.Dataset) -> Figure:
    """RMS errors of a study over all that it varies; of full order where there is nothing else."""
    if not {"rms_error", "signal_range"} <= set(dataset):
        raise InputError("no errors in this result: it was not compared with full order")
    methods = {str(label): labels.method_text(str(label)) for label in dataset["label"].values}
    reduced = {m: text for m, text in methods.items() if not m.startswith("full_order")}
    varied = _varied(dataset)
    if not varied:
        return _of_a_point(dataset)
    methods = reduced or methods
    saturated = saturated_ranks(dataset)
    errors = dataset["rms_error"].where(dataset["status"].isin(FINISHED), np.inf)
    lines = _lines(errors, methods, varied[1:], saturated)
    notes: list[str] = []
    # More lines than can be told from each other.
    if len(lines) > max(8, len(methods)):
        largest = errors.max(varied[1:])
        lines = {label: (text, largest.sel(label=label)) for label, text in methods.items()}
        notes.append(f"the largest error over {_listed(varied[1:])}")
    ticks = ticks_of(dataset, varied[0])
    if saturated and varied[0] == "rank":
        texts = [f"{methods[label]} saturates at {rank}" for label, rank in saturated.items()]
        ticks = ticks._replace(label=textwrap.fill(f"rank; {', '.join(texts)}", width=38))
    outputs = shown_outputs(dataset)
    size = 6.7 if len(outputs) < 3 else 8.5, 3.3
    figure, grid = theme.panels(1, len(outputs), size)
    for number, (panel, output) in enumerate(zip(grid.flat, outputs, strict=True)):
        panel.set_title(theme.letter(number))
        _draw_panel(panel, dataset, output, varied[0], ticks, lines)
        ticks.scale(panel)
    trained = labels.trained_runs(dataset).sel(label=list(methods))
    if number := int(trained.sum()):
        notes.append(f"{number} of {trained.size} runs were in their own training")
    if notes:
        figure.suptitle("\n".join(notes), fontsize="medium")
    theme.legend_below(figure, figure.axes)
    return figure


def _is_seed(dimension: str) -> bool:
    """Whether values of a dimension have no order."""
    return dimension.endswith("_seed")


def _varied(dataset: xr.Dataset) -> list[str]:
    """What the study varies beside the method, first the dimension that lines go over."""
    sizes = {str(d): dataset.sizes[d] for d in dataset["status"].dims if d != "label"}
    names = [name for name, size in sizes.items() if size > 1]
    numbers = [name for name in names if np.issubdtype(dataset[name].dtype, np.number)]

    # A factor goes before a setting with as many values.
    def order(name: str) -> tuple[bool, bool, int, bool]:
        return _is_seed(name), name in numbers, sizes[name], name in FACTORS

    return sorted(names, key=order, reverse=True)


def _listed(dimensions: Sequence[str]) -> str:
    *head, last = (d.removeprefix(PARAMETER).replace("_", " ") for d in dimensions)
    return f"{', '.join(head)} and {last}" if head else last


def _lines(
    errors: xr.DataArray,
    methods: Mapping[str, str],
    others: Sequence[str],
    saturated: Mapping[str, int],
) -> Lines:
    """A line for each combination of what a method's errors depend on."""
    lines: dict[str, tuple[str, xr.DataArray]] = {}
    for label, text in methods.items():
        line = errors.sel(label=label)
        followed = [d for d in others if not bool((line == line.isel({d: 0})).all())]
        line = line.isel({d: 0 for d in others if d not in followed}, drop=True)
        for values in itertools.product(*(line[d].values.tolist() for d in followed)):
            point = dict(zip(followed, values, strict=True))
            parts: list[str] = []
            for name, value in point.items():
                unit = str(errors[name].attrs.get("units", "")).removesuffix("1")
                shown = value if isinstance(value, str) else f"{value:g}"
                if name == "rank" and float(value) > saturated.get(label, np.inf):
                    shown += f" (saturates at {saturated[label]})"
                parts.append(f"{_listed([name])} {shown} {unit}".rstrip())
            lines[", ".join([label, *parts])] = ", ".join([text, *parts]), line.sel(point)
    return lines


def _draw_panel(
    axis: Axes, dataset: xr.Dataset, output: str, dimension: str, ticks: Ticks, lines: Lines
) -> None:
    """Lines of one output; over perturbations the published error."""
    methods = theme.methods_of(dataset)
    looks, marks = theme.styles(lines, methods), theme.marks(lines, methods)
    for name, (text, errors) in lines.items():
        values = errors.sel(output=output).values.ravel()
        look: Style = {**looks[name], "marker": marks[name], "markersize": 3.5}
        # Names and seeds have no order that a line could follow.
        if ticks.names or _is_seed(dimension):
            look["linestyle"] = "none"
        visible = np.isfinite(values) & (values > 0.0)
        axis.plot(ticks.at, np.where(visible, values, np.nan), label=text, **look)
        for mark, height, _, is_off in OFF:
            off = np.compress(is_off(values), ticks.at)
            if len(off):
                # Above those of other lines.
                heights = np.full(len(off), height + 0.025 * _count_marked(axis, mark))
                edge: Style = {"transform": axis.get_xaxis_transform(), "clip_on": False, **mark}
                axis.plot(off, heights, color=look["color"], **edge)
    published = rms_numbers(str(dataset.attrs["model"])).get(output)
    if published and dimension in FACTORS:
        axis.axhline(published.value, label="published, nominal", **theme.THIN)
    axis.set_yscale("log")
    tick_decades(axis.yaxis, *axis.get_ylim())
    # Last in the legend what the axis can't show.
    for mark, _, text, _ in OFF:
        if _count_marked(axis, mark):
            axis.plot([], [], color="black", label=text, **mark)
    axis.set_ylabel(labels.error_label(dataset, "RMS error", output))


def _count_marked(axis: Axes, mark: Style) -> int:
    return sum(line.get_marker() == mark["marker"] for line in axis.lines)


def _of_a_point(dataset: xr.Dataset) -> Figure:
    """RMS errors of all outputs as shares of their ranges, a mark for each method."""
    texts = legend_of(dataset)
    if not texts:
        raise InputError("full order alone: no errors to draw")
    names = [str(output) for output in dataset["output"].values]
    figure, grid = theme.panels(1, 1, (6.7, 1.6 + 0.19 * len(names)))
    axis, heights = grid[0, 0], np.arange(len(names))
    drawn = theme.methods_of(dataset)
    looks, marks = theme.styles(texts, drawn), theme.marks(texts, drawn)
    for label, text in texts.items():
        run = at_point(dataset, label)
        share = 100.0 * (run["rms_error"] / run["signal_range"])
        share = share.where(np.isfinite(share) & (share > 0.0))
        look: Style = {"color": looks[label]["color"], "marker": marks[label], "markersize": 5}
        exact = " (error 0)" if bool((run["rms_error"] == 0.0).all()) else ""
        axis.semilogx(share, heights, label=text + exact, linestyle="none", **look)
    tick_decades(axis.xaxis, *axis.get_xlim())
    axis.set_yticks(heights, map(labels.full_label, names), fontsize=7)
    axis.set_ylim(len(names) - 0.5, -0.5)
    axis.set_xlabel("RMS error (% of the output's range)")
    theme.legend_below(figure, [axis])
    return figure


def figure_pareto(dataset: xr.Dataset) -> Figure:
    """Score (worst error over its bound) over the mean time of a whole call, one model.

    Each full-order integrator is a line through its tolerances; a cross below the upper edge is a
    reduced model of which a run has failed.  Bars: between the quartiles of the rounds.
    """
    rows: Any = pd.DataFrame(method_rows(dataset))
    rows["time"] = 1e6 * rows["seconds"]
    rows["bar"] = 0.5 * rows["spread"] * rows["time"]
    rows["tolerance"] = [json.loads(text).get("tolerance", 0.0) for text in rows["settings"]]
    visible = rows[np.isfinite(rows["score"]) & (rows["score"] > 0.0)]
    top = 10.0 ** np.ceil(np.log10(max([1.0, *visible["score"]])) + 0.5)
    figure, axes = theme.panels(1, 1, (6.7, 4.2))
    axis = axes[0, 0]
    full = visible[visible["role"] == FULL_ORDER].sort_values("tolerance")
    for (name, line), look in zip(full.groupby("series", sort=False), itertools.cycle(GREYS)):
        bars: Style = {"xerr": line["bar"], "elinewidth": 0.8, "capsize": 1.5, **look}
        label = f"full order, {str(name).removeprefix('full order')}".removesuffix(", ")
        axis.errorbar(line["time"], line["score"], label=label, **bars)
    for score in rows["score"][rows["method"] == "replay"]:
        axis.axhline(score, color="#666666", linestyle=":", label="replay (no time)")
    reduced = rows[(rows["role"] != FULL_ORDER) & (rows["method"] != "replay")]
    reduced = reduced[np.isfinite(reduced["time"])]
    methods = reduced.set_index("label")["method"].to_dict()
    looks, marks = theme.styles(methods, methods), theme.marks(methods, methods)
    for row in reduced.itertuples():
        color, failed = looks[row.label]["color"], not np.isfinite(row.score)
        # Hollow, so that one shows through the other.
        look = {"color": color, "marker": "x" if failed else marks[row.label], "linestyle": "none"}
        look |= {"markersize": 11, "markeredgewidth": 2.4} if row.winner else {"markersize": 7}
        look |= {"xerr": row.bar, "elinewidth": 1.0, "capsize": 2, "markerfacecolor": "none"}
        label = f"{row.label}{' (fails)' * failed}{' (chosen)' * bool(row.winner)}"
        axis.errorbar(row.time, top / 1.5 if failed else row.score, label=label, **look)
    axis.axhline(1.0, **theme.THIN)
    axis.text(0.99, 1.08, "bounds", fontsize=7, ha="right", transform=axis.get_yaxis_transform())
    axis.set_yscale("log")
    axis.set_xscale("log")
    axis.set_ylim(0.5 * min([1.0, *visible["score"]]), top)
    axis.set_xlabel("mean CPU time of a whole call, all outputs delivered, in µs")
    axis.set_ylabel("worst error / bound, judged runs")
    theme.tick_decades(axis.xaxis, *axis.get_xlim())
    # Of what is chosen the mark is larger than a line of the legend.
    figure.legend(loc="outside right upper", fontsize=7, markerscale=0.7)
    # The legend stands beside the axes, whose title can't be wrapped by itself.
    axis.set_title(textwrap.fill(str(dataset.attrs["title"]), width=60))
    return figure
