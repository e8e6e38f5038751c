"""Worst error on unseen inputs against online time: full order, baselines, reduced models."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np

from vehiclemor.report.predictive import method_rows, protocol_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

# Colour-blind safe (M. Okabe, K. Ito).
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
MARKERS = ("s", "^", "D", "v", "P", "<", ">", "h", "p", "d", "*", "X")
GREYS = ("#000000", "#777777", "#AAAAAA", "#444444")
LINES = ("-", "-", "-", "--")


def figure_pareto(results: Mapping[str, xr.Dataset]) -> Figure:
    """Score (worst error as a multiple of its bound) over mean online time, one model."""
    (dataset,) = results.values()
    protocol = protocol_of(dataset)
    rows = method_rows(dataset, protocol)
    figure, axis = plt.subplots(figsize=(6.7, 4.2))
    finite = [row["score"] for row in rows if np.isfinite(row["score"]) and row["score"] > 0.0]
    top = 10.0 ** np.ceil(np.log10(max(finite)) + 0.5)
    families: dict[str, list[Mapping]] = {}
    for row in rows:
        if row["role"] == "full order":
            families.setdefault(str(row["method"]).rsplit(" ", 1)[0], []).append(row)
    lines = zip(cycle(GREYS), cycle(LINES), strict=False)
    for (family, members), (color, line) in zip(families.items(), lines, strict=False):
        points = [(m["seconds"] * 1e6, m["score"]) for m in members if np.isfinite(m["score"])]
        points = [point for point in points if point[1] > 0.0]
        style = {"color": color, "marker": "o", "markersize": 4, "linewidth": 0.8}
        style["linestyle"] = line
        axis.loglog(*zip(*sorted(points), strict=True), label=f"full order, {family}", **style)
    styles = zip(cycle(COLORS), cycle(MARKERS), strict=False)
    for row in rows:
        if row["role"] == "full order":
            continue
        if row["component"] == "replay":
            axis.axhline(row["score"], color="#666666", linestyle=":", label="replay (no time)")
            continue
        color, marker = next(styles)
        failed = not np.isfinite(row["score"])
        seconds = row["seconds"]
        if not np.isfinite(seconds):
            continue
        label = f"{row['method']}, r = {row['rank']}"
        label += " (fails)" if failed else ""
        axis.loglog(
            seconds * 1e6,
            top / 1.5 if failed else row["score"],
            color=color,
            marker="x" if failed else marker,
            markersize=11 if row["winner"] else 7,
            markeredgecolor="black" if row["winner"] else color,
            linestyle="none",
            label=label + (" (winner)" if row["winner"] else ""),
        )
    axis.axhline(1.0, color="black", linewidth=0.8)
    axis.text(0.99, 1.08, "bounds", fontsize=7, ha="right", transform=axis.get_yaxis_transform())
    axis.set_ylim(top=top)
    axis.set_xlabel("mean online time of a test run in µs")
    axis.set_ylabel("worst error / bound, test set")
    figure.legend(loc="outside right upper", fontsize=7)
    return figure
