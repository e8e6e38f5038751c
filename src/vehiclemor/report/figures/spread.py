"""Figure 14: twice the frequency, and what rounding makes of directions beyond the rank."""

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from vehiclemor.report.criteria.finding import at_point
from vehiclemor.report.figures.lines import COLORS, FULL, LITERAL, Results, Style, letter, styles
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
    "pod_literal": ("POD, r = 6 (literal), spread (leaves the axes)", "#D55E00", 0.3),
    "pod_uncut": ("POD, r = 6 (least squares), spread (thinner than a line)", "#0072B2", 0.6),
}


def figure_spread(results: Results) -> Figure:
    """Frequency +100 %: r = 3 above, r = 6 with its spread and r = 4 below."""
    figure, (upper, lower) = plt.subplots(2, 1, sharex=True, figsize=(6.7, 5.2))
    dataset, spread = results["figure-14"], results["figure-14-spread"]
    full = _history(dataset, "full_order", rank=3)
    for number, axis in enumerate((upper, lower)):
        axis.plot(full.time, full, label="full order", **FULL)
        axis.set_ylabel(axis_label(dataset, OUTPUT))
        axis.axvline(CONTROL_PERIOD, color="#999999", linewidth=0.8, linestyle=(0, (1, 3)))
        axis.set_title(letter(number))
    for method, style in styles(ABOVE).items():
        reduced = _history(dataset, method, rank=3)
        upper.plot(full.time, reduced, label=ABOVE[method], **style)
    for method, (text, color, opacity) in BANDS.items():
        runs = _history(spread, method, rank=6).transpose("rounding_seed", "time").values
        band: Style = {"label": text, "color": color, "alpha": opacity, "linewidth": 0.0}
        lower.fill_between(full.time, np.nanmin(runs, axis=0), np.nanmax(runs, axis=0), **band)
    six = _history(spread, "pod_literal", rank=6).sel(rounding_seed=0)
    lower.plot(full.time, six, label="POD, r = 6 (literal), as computed", **LITERAL)
    four = _history(dataset, "pod", rank=4)
    green: Style = {"color": COLORS[2], "linestyle": "--"}
    lower.plot(full.time, four, label="POD, r = 4 (least squares)", **green)
    low, high = float(full.min()), float(full.max())
    margin = 0.35 * (high - low)
    lower.set_ylim(low - margin, high + margin)
    upper.legend(loc="lower center", bbox_to_anchor=(0.53, 1.0), ncols=4)
    lower.legend(loc="lower center", bbox_to_anchor=(0.53, 1.0), ncols=2)
    lower.set_xlabel("time (s)")
    lower.set_xlim(0.0, float(full.time[-1]))
    return figure


def _history(dataset: xr.Dataset, method: str, rank: int) -> xr.DataArray:
    return at_point(dataset, method, rank=rank)["outputs"].sel(output=OUTPUT)
