"""What runs cost: methods of a protocol by error and time."""

import json
import textwrap
from itertools import cycle
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from vehiclemor.report.figures import theme
from vehiclemor.report.figures.theme import Style
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


def figure_pareto(dataset: xr.Dataset) -> Figure:
    """Score (worst error over its bound) over the mean time of a whole call, one model.

    Each full-order integrator is a line through its tolerances; a cross below the upper edge is a
    reduced model of which a run has failed.  Bars: between the quartiles of the rounds.
    """
    rows: Any = pd.DataFrame(method_rows(dataset, protocol_of(dataset)))
    rows["time"] = 1e6 * rows["seconds"]
    rows["bar"] = 0.5 * rows["spread"] * rows["time"]
    rows["tolerance"] = [json.loads(text).get("tolerance", 0.0) for text in rows["settings"]]
    visible = rows[np.isfinite(rows["score"]) & (rows["score"] > 0.0)]
    top = 10.0 ** np.ceil(np.log10(max([1.0, *visible["score"]])) + 0.5)
    figure, axes = theme.panels(1, 1, (6.7, 4.2))
    axis = axes[0, 0]
    full = visible[visible["role"] == FULL_ORDER].sort_values("tolerance")
    for (name, line), look in zip(full.groupby("series", sort=False), cycle(GREYS)):
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
    axis.set_title(textwrap.fill(str(dataset.attrs["title"]), TITLE))
    return figure
