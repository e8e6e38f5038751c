"""Worst error on unseen inputs against online time: full order, baselines, reduced models."""

import json
import textwrap
from itertools import cycle

import numpy as np
from matplotlib.figure import Figure

from vehiclemor.report.figures.scales import tick_decades
from vehiclemor.report.figures.theme import COLORS, MARKERS, THIN, Results, Style, panels
from vehiclemor.report.unseen import method_rows, protocol_of
from vehiclemor.study.plans.protocol import FULL_ORDER

# Letters of a title in a line.
TITLE = 60
# Full-order integrators: of twelve no two look alike.
GREYS: list[Style] = [
    {"color": color, "linestyle": line, "marker": marker, "markersize": 4, "linewidth": 0.8}
    for line, marker in (("-", "o"), ("--", "*"), (":", "X"))
    for color in ("#000000", "#777777", "#AAAAAA", "#444444")
]


def figure_pareto(results: Results, *, titled: bool = False) -> Figure:
    """Score (worst error over its bound) over the mean time of a whole call, one model.

    Each full-order integrator is a line through its tolerances; a cross below the upper edge is a
    reduced model of which a run has failed.  Bars: between the quartiles of the rounds.
    """
    (dataset,) = results.values()
    rows = method_rows(dataset, protocol_of(dataset))
    figure, axes = panels(1, 1, (6.7, 4.2))
    axis = axes[0, 0]
    finite = [row["score"] for row in rows if np.isfinite(row["score"]) and row["score"] > 0.0]
    top = 10.0 ** np.ceil(np.log10(max(finite, default=1.0)) + 0.5)
    lines: dict[str, list[tuple[float, float, float]]] = {}
    for row in sorted(rows, key=lambda row: json.loads(row["settings"]).get("tolerance", 0.0)):
        if row["role"] == FULL_ORDER:
            name = str(row["series"]).removeprefix("full order")
            points = lines.setdefault(f"full order, {name}".removesuffix(", "), [])
            if np.isfinite(row["score"]) and row["score"] > 0.0:
                points.append((row["seconds"] * 1e6, row["score"], row["spread"]))
    for (label, points), look in zip(lines.items(), cycle(GREYS), strict=False):
        times, scores, spreads = np.array(points).reshape(-1, 3).T
        bars = {"xerr": 0.5 * spreads * times, "elinewidth": 0.8, "capsize": 1.5}
        axis.errorbar(times, scores, label=label, **look, **bars)
    looks = zip(cycle(COLORS), cycle(MARKERS), strict=False)
    for row in rows:
        if row["method"] == "replay":
            axis.axhline(row["score"], color="#666666", linestyle=":", label="replay (no time)")
        elif row["role"] != FULL_ORDER and np.isfinite(row["seconds"]):
            color, marker = next(looks)
            chosen, failed = bool(row["winner"]), not np.isfinite(row["score"])
            time, score = row["seconds"] * 1e6, top / 1.5 if failed else row["score"]
            # Hollow, so that one shows through the other.
            look = {"color": color, "marker": "x" if failed else marker, "linestyle": "none"}
            look |= {"markersize": 11 if chosen else 7, "markeredgewidth": 2.4 if chosen else 1.4}
            look |= {"xerr": 0.5 * row["spread"] * time, "elinewidth": 1.0, "capsize": 2}
            label = f"{row['label']}{' (fails)' * failed}{' (chosen)' * chosen}"
            axis.errorbar(time, score, markerfacecolor="none", label=label, **look)
    axis.axhline(1.0, **THIN)
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
