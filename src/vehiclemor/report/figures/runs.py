"""Paths, histories and errors of a vehicle's runs: what the figures of both vehicles share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np

from vehiclemor.report.figures.lines import DEFAULT, FULL, LITERAL, legend_above, point

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from vehiclemor.report.published import Number

STARTS = {"equilibrium": "start in equilibrium", "dropped": "dropped start"}
CROSS: dict[str, Any] = {
    "marker": "x",
    "markersize": 6,
    "markeredgewidth": 1.6,
    "linestyle": "none",
}
# One more line of a reduced model beside the default and the literal one.
OTHER: dict[str, Any] = {"color": "#009E73", "linestyle": (0, (5, 1, 1, 1, 1, 1))}

# Method -> its name in the legend and the style of its line.
Drawn = Mapping[str, tuple[str, dict[str, Any]]]


def reduced_models(rank: int) -> dict[str, tuple[str, dict[str, Any]]]:
    """POD with its default settings and with those of the paper."""
    # Gaps of the upper line show the lower one where both coincide.
    default = {**DEFAULT, "linestyle": (0, (3, 3)), "zorder": 2.5}
    return {
        "pod": (f"POD, r = {rank} (default)", default),
        "pod_literal": (f"POD, r = {rank} (literal)", LITERAL),
    }


def panels(rows: int, height: float, last: float, duration: float) -> tuple[Figure, np.ndarray]:
    """Rows of histories, one column for each start.

    Parameters
    ----------
    rows
        Number of rows.
    height
        Height of the figure in inches.
    last
        Time up to which the runs are shown, in s.
    duration
        Time at which they end, in s.
    """
    figure, axes = plt.subplots(rows, 2, sharex=True, figsize=(6.7, height))
    for (row, column), axis in np.ndenumerate(axes):
        axis.set_title(f"({'abcdefgh'[2 * row + column]}) {list(STARTS.values())[column]}")
    for axis in axes[-1]:
        axis.set_xlabel(f"time (s), first {last:g} s of {duration:g} s")
        axis.set_xlim(0.0, last)
    return figure, axes


def figure_of_paths(dataset: xr.Dataset, reduced: Drawn, whole: float, part: float) -> Figure:
    """Path in the plane from equilibrium: the whole run (m), and the lane change alone (m)."""
    figure, axes = plt.subplots(2, 1)
    for axis, letter, furthest in zip(axes, "ab", (whole, part), strict=True):
        for label, (text, style) in {"full_order": ("full order", FULL), **reduced}.items():
            path = point(dataset, label, start="equilibrium")["outputs"]
            x, y = (path.sel(output=f"{way}_position") for way in ("longitudinal", "lateral"))
            axis.plot(x, y, label=text, **style)
        axis.set_xlim(0.0, furthest)
        axis.set_ylabel("Y (m)")
        axis.set_title(f"({letter})")
    axes[1].set_xlabel("X (m), not to the scale of Y")
    legend_above(figure, axes[0])
    return figure


def draw_history(axis: Axes, dataset: xr.Dataset, start: str, output: str, reduced: Drawn) -> bool:
    """One output of the full and of the reduced models; whether one of them leaves the axes."""
    full = point(dataset, "full_order", start=start)["outputs"].sel(output=output)
    axis.plot(full.time, full, label="full order", **FULL)
    margin = 0.25 * float(full.max() - full.min())
    axis.set_ylim(float(full.min()) - margin, float(full.max()) + margin)
    left = False
    for label, (text, style) in reduced.items():
        history = point(dataset, label, start=start)["outputs"].sel(output=output)
        left |= _plot_until_it_leaves(axis, history, text, style)
    axis.ticklabel_format(style="plain")
    axis.locator_params(axis="y", nbins=5)
    return left


def _plot_until_it_leaves(
    axis: Axes, history: xr.DataArray, text: str, style: dict[str, Any]
) -> bool:
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


def draw_errors(
    axis: Axes, dataset: xr.Dataset, start: str, number: Number, reduced: Drawn
) -> bool:
    """Largest errors in each control period and the published one; whether a run diverges.

    Parameters
    ----------
    number
        Published RMS error of the output that is shown, with its control period.
    """
    diverged = False
    for label, (text, style) in reduced.items():
        run = point(dataset, label, start=start)
        error = abs(run["outputs"] - run["reference_outputs"]).sel(output=number.quantity)
        edges, largest = _largest(error, float(number.control_period or error["time"][-1]))
        axis.semilogy(edges, largest, label=text, drawstyle="steps-post", **style)
        ended = np.flatnonzero(np.isnan(largest))
        if ended.size:
            diverged = True
            last_value = largest[ended[0] - 1]
            axis.plot(edges[ended[0]], last_value, color=style["color"], **CROSS)
    axis.axhline(number.value, color="black", linestyle=":", label="published RMS error")
    return diverged


def _largest(error: xr.DataArray, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Starts of the control periods (n,) in s and the largest error in each."""
    # A sample between two periods belongs to the one that ends there.
    window = np.maximum(np.ceil(error["time"].values / period - 1e-9).astype(int) - 1, 0)
    starts = np.unique(window)
    return period * starts, np.array([np.fmax.reduce(error.values[window == k]) for k in starts])


def draw_lateral_positions(axis: Axes, dataset: xr.Dataset, drawn: Drawn, last: float) -> None:
    """Lateral position from equilibrium over the time, up to `last` (s)."""
    for label, (text, style) in drawn.items():
        run = point(dataset, label, start="equilibrium")
        axis.plot(run.time, run["outputs"].sel(output="lateral_position"), label=text, **style)
    axis.set_xlim(0.0, last)
    axis.set_ylabel("lateral position Y (m)")
