"""Worst error on unseen inputs against online time: full order, baselines, reduced models."""

import json
import textwrap
from collections.abc import Sequence
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vehiclemor.report.figures.lines import COLORS, Results, Style, panels
from vehiclemor.report.figures.places import tick_decades
from vehiclemor.report.predictive.rows import method_rows, protocol_of
from vehiclemor.report.predictive.targets import Row
from vehiclemor.study.plans.protocol import FULL_ORDER

# With six colours: of 66 no two look alike.
MARKERS = ("s", "^", "D", "v", "P", "<", ">", "h", "p", "d", "H")
# Letters of a title in a line.
TITLE = 60
# Colour, line and marker of a full-order integrator: of twelve no two look alike.
GREYS = [
    (color, line, marker)
    for line, marker in (("-", "o"), ("--", "*"), (":", "X"))
    for color in ("#000000", "#777777", "#AAAAAA", "#444444")
]


def figure_pareto(results: Results, *, titled: bool = False) -> Figure:
    """Score (worst error over its bound) over the mean time of a whole call, one model."""
    (dataset,) = results.values()
    rows = method_rows(dataset, protocol_of(dataset))
    figure, axes = panels(1, 1, (6.7, 4.2))
    axis = axes[0, 0]
    finite = [row["score"] for row in rows if np.isfinite(row["score"]) and row["score"] > 0.0]
    top = 10.0 ** np.ceil(np.log10(max(finite, default=1.0)) + 0.5)
    _draw_full_order(axis, [row for row in rows if row["role"] == FULL_ORDER])
    styles = zip(cycle(COLORS), cycle(MARKERS), strict=False)
    for row in rows:
        if row["method"] == "replay":
            axis.axhline(row["score"], color="#666666", linestyle=":", label="replay (no time)")
        elif row["role"] != FULL_ORDER:
            _draw_reduced(axis, row, next(styles), top)
    axis.axhline(1.0, color="black", linewidth=0.8)
    axis.text(0.99, 1.08, "bounds", fontsize=7, ha="right", transform=axis.get_yaxis_transform())
    axis.set_yscale("log")
    axis.set_xscale("log")
    axis.set_ylim(top=top)
    axis.set_xlabel("mean CPU time of a whole call, all outputs delivered, in µs")
    axis.set_ylabel("worst error / bound, judged runs")
    tick_decades(axis.xaxis, *axis.get_xlim())
    # Of what is chosen the mark is larger than a line of the legend.
    figure.legend(loc="outside right upper", fontsize=7, markerscale=0.7)
    if titled:
        # The legend stands beside the axes, whose title can't be wrapped by itself.
        axis.set_title(textwrap.fill(str(dataset.attrs["title"]), TITLE))
    return figure


def _draw_full_order(axis: Axes, rows: Sequence[Row]) -> None:
    """A line for each integrator, through its tolerances."""
    families: dict[str, list[tuple[float, float, float]]] = {}
    for row in sorted(rows, key=lambda row: json.loads(row["settings"]).get("tolerance", 0.0)):
        points = families.setdefault(str(row["contestant"]), [])
        if np.isfinite(row["score"]) and row["score"] > 0.0:
            points.append((row["seconds"] * 1e6, row["score"], row["spread"]))
    for (family, points), (color, line, mark) in zip(families.items(), cycle(GREYS), strict=False):
        style: Style = {"marker": mark, "markersize": 4, "linewidth": 0.8, "linestyle": line}
        times, scores, spreads = np.array(points).reshape(-1, 3).T
        bars = {"xerr": 0.5 * spreads * times, "elinewidth": 0.8, "capsize": 1.5}
        label = f"full order, {family.removeprefix('full order')}".removesuffix(", ")
        axis.errorbar(times, scores, color=color, label=label, **style, **bars)


def _draw_reduced(axis: Axes, row: Row, look: tuple[str, str], top: float) -> None:
    """One reduced model; a cross below the upper edge (`top`) where a run has failed."""
    (color, marker), winner = look, bool(row["winner"])
    failed = not np.isfinite(row["score"])
    if not np.isfinite(row["seconds"]):
        return
    words = f"{row['label']}{' (fails)' if failed else ''}{' (chosen)' if winner else ''}"
    place = row["seconds"] * 1e6, top / 1.5 if failed else row["score"]
    # Hollow, so that one shows through the other; bars: between the quartiles of the rounds.
    axis.errorbar(
        *place,
        xerr=0.5 * row["spread"] * place[0],
        color=color,
        marker="x" if failed else marker,
        markersize=11 if winner else 7,
        markerfacecolor="none",
        markeredgewidth=2.4 if winner else 1.4,
        elinewidth=1.0,
        capsize=2,
        linestyle="none",
        label=words,
    )
