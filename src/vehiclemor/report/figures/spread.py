"""Figure 14: twice the frequency, and what rounding makes of directions beyond the rank."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from vehiclemor.report.criteria.finding import at_point
from vehiclemor.report.figures.curves import BREAK
from vehiclemor.report.figures.lines import (
    COLORS,
    FULL,
    LITERAL,
    Results,
    Style,
    panels,
    styles,
)
from vehiclemor.report.labels import axis_label

OUTPUT = "second_euler_angle"
CONTROL_PERIOD = 5.0
ABOVE = {
    "pod": "POD, r = 3 (least squares)",
    "pod_literal": "POD, r = 3 (literal)",
    "replay": "replay",
}
# Method -> what its band says, colour and opacity.
BANDS = {
    "pod_literal": ("POD, r = 6 (literal), 21 roundings: leave the axes", "#D55E00", 0.3),
    "pod_uncut": ("POD, r = 6 (least squares), 21 roundings: one line", "#0072B2", 0.6),
}


def figure_spread(results: Results) -> Figure:
    """Frequency +100 %: r = 3 above, r = 6 with its spread and r = 4 below."""
    figure, axes = panels(2, 1, (6.7, 6.4), sharex=True)
    upper, lower = axes.flat
    dataset, spread = results["figure-14"], results["figure-14-spread"]
    full = 1e3 * _history(dataset, "full_order", rank=3)
    for axis, title in ((upper, "(a) three states"), (lower, "(b) six and four states")):
        axis.plot(full.time, full, label="full order", **FULL)
        axis.set_ylabel(axis_label(dataset, OUTPUT, "mrad"))
        axis.axvline(CONTROL_PERIOD, label="end of a control period", **BREAK)
        axis.set_title(title)
    for method, style in styles(ABOVE).items():
        reduced = 1e3 * _history(dataset, method, rank=3)
        upper.plot(full.time, reduced, label=ABOVE[method], **style)
    for method, (text, color, opacity) in BANDS.items():
        runs = 1e3 * _history(spread, method, rank=6).transpose("rounding_seed", "time").values
        band: Style = {"label": text, "color": color, "alpha": opacity, "linewidth": 0.0}
        lower.fill_between(full.time, np.nanmin(runs, axis=0), np.nanmax(runs, axis=0), **band)
    six = 1e3 * _history(spread, "pod_literal", rank=6).sel(rounding_seed=0)
    lower.plot(full.time, six, label="POD, r = 6 (literal), as computed", **LITERAL)
    four = 1e3 * _history(dataset, "pod", rank=4)
    green: Style = {"color": COLORS[2], "linestyle": "--"}
    lower.plot(full.time, four, label="POD, r = 4 (least squares)", **green)
    low, high = float(full.min()), float(full.max())
    margin = 0.35 * (high - low)
    lower.set_ylim(low - margin, high + margin)
    for axis, columns in ((upper, 3), (lower, 2)):
        axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=columns)
    upper.tick_params(labelbottom=True)
    for axis in (upper, lower):
        axis.set_xlabel("time (s)", loc="right")
    lower.set_xlim(0.0, float(full.time[-1]))
    return figure


def _history(dataset: xr.Dataset, method: str, rank: int) -> xr.DataArray:
    return at_point(dataset, method, rank=rank)["outputs"].sel(output=OUTPUT)
