"""Time histories of the 14-DOF vehicle and their errors: figures 2 to 4, and no steering."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np

from vehiclemor.report.figures.lines import (
    DEFAULT,
    FULL,
    LITERAL,
    REPLAY,
    Results,
    legend_above,
    point,
)
from vehiclemor.report.published import load_published

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STUDY = "figures-2-4"
STARTS = {"equilibrium": "start in equilibrium", "dropped": "dropped start"}
LABELS = {"pitch": r"pitch $\theta$ (rad)", "yaw": r"yaw $\psi$ (rad)"}
NUMBERS = {"pitch": "gv_rms_pitch", "yaw": "gv_rms_yaw"}
# Method -> its name and line; gaps of the upper line show the lower one where both coincide.
REDUCED: dict[str, tuple[str, dict[str, Any]]] = {
    "pod": ("POD, r = 3 (default)", {**DEFAULT, "linestyle": (0, (3, 3)), "zorder": 2.5}),
    "pod_literal": ("POD, r = 3 (literal)", LITERAL),
}
STATE: dict[str, Any] = {"color": "#009E73", "linestyle": (0, (5, 1, 1, 1, 1, 1))}
CROSS: dict[str, Any] = {
    "marker": "x",
    "markersize": 6,
    "markeredgewidth": 1.6,
    "linestyle": "none",
}
# The response has died away at this time (s), long before the end of the run.
SHOWN = 6.0
FIRST_SECONDS = "time (s), first {:g} s of 25 s"


def figure_2(results: Results) -> Figure:
    """Path in the plane from equilibrium: the whole run, and the lane change alone."""
    figure, axes = plt.subplots(2, 1)
    for axis, letter, furthest in zip(axes, "ab", (500.0, 100.0), strict=True):
        for label, (text, style) in {"full_order": ("full order", FULL), **REDUCED}.items():
            path = point(results[STUDY], label, start="equilibrium")["outputs"]
            x, y = (path.sel(output=f"{way}_position") for way in ("longitudinal", "lateral"))
            axis.plot(x, y, label=text, **style)
        axis.set_xlim(0.0, furthest)
        axis.set_ylabel("Y (m)")
        axis.set_title(f"({letter})")
    axes[1].set_xlabel("X (m), not to the scale of Y")
    legend_above(figure, axes[0])
    return figure


def _panels(last: float) -> tuple[Figure, np.ndarray]:
    """Pitch above yaw, one column for each start."""
    figure, axes = plt.subplots(2, 2, sharex=True, figsize=(6.7, 5.2))
    for (row, column), axis in np.ndenumerate(axes):
        axis.set_title(f"({'abcd'[2 * row + column]}) {list(STARTS.values())[column]}")
    for axis in axes[1]:
        axis.set_xlabel(FIRST_SECONDS.format(last))
        axis.set_xlim(0.0, last)
    return figure, axes


def figure_3(results: Results) -> Figure:
    """Pitch and yaw from both starts."""
    figure, axes = _panels(SHOWN)
    for (row, column), axis in np.ndenumerate(axes):
        start, output = list(STARTS)[column], list(LABELS)[row]
        full = point(results[STUDY], "full_order", start=start)["outputs"].sel(output=output)
        axis.plot(full.time, full, label="full order", **FULL)
        margin = 0.25 * float(full.max() - full.min())
        axis.set_ylim(float(full.min()) - margin, float(full.max()) + margin)
        for label, (text, style) in REDUCED.items():
            reduced = point(results[STUDY], label, start=start)["outputs"].sel(output=output)
            _plot_until_it_leaves(axis, reduced, text, style)
        axis.set_ylabel(LABELS[output])
        axis.ticklabel_format(style="plain")
        axis.locator_params(axis="y", nbins=5)
    axes[0, 0].plot([], [], color=LITERAL["color"], label="literal leaves the axes", **CROSS)
    legend_above(figure, axes[0, 0])
    return figure


def _plot_until_it_leaves(
    axis: Axes, history: xr.DataArray, text: str, style: dict[str, Any]
) -> None:
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


def figure_4(results: Results) -> Figure:
    """Errors of figure 3, the largest in each control period."""
    last = 2.0 * SHOWN
    figure, axes = _panels(last)
    published, dataset = load_published().numbers, results[STUDY]
    drawn = dict(REDUCED)
    if "pod_state" in dataset["method"].values:
        drawn["pod_state"] = ("POD, r = 3 (state, energy)", STATE)
    for (row, column), axis in np.ndenumerate(axes):
        start, output = list(STARTS)[column], list(LABELS)[row]
        number = published[NUMBERS[output]]
        for label, (text, style) in drawn.items():
            reduced = point(dataset, label, start=start)
            error = abs(reduced["outputs"] - reduced["reference_outputs"]).sel(output=output)
            edges, largest = _largest(error, float(number.control_period or last))
            axis.semilogy(edges, largest, label=text, drawstyle="steps-post", **style)
            ended = np.flatnonzero(np.isnan(largest))
            if ended.size:
                last_value = largest[ended[0] - 1]
                axis.plot(edges[ended[0]], last_value, color=style["color"], **CROSS)
        axis.axhline(number.value, color="black", linestyle=":", label="published RMS error")
        axis.set_ylim(1e-8, 30.0)
        axis.set_ylabel(f"largest error of {LABELS[output]}")
    axes[0, 0].plot([], [], color=LITERAL["color"], label="literal has diverged", **CROSS)
    legend_above(figure, axes[0, 0], columns=3)
    return figure


def _largest(error: xr.DataArray, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Starts of the control periods (n,) in s and the largest error in each."""
    # A sample between two periods belongs to the one that ends there.
    window = np.maximum(np.ceil(error["time"].values / period - 1e-9).astype(int) - 1, 0)
    starts = np.unique(window)
    return period * starts, np.array([np.fmax.reduce(error.values[window == k]) for k in starts])


def figure_zero_steer(results: Results) -> Figure:
    """Lateral position without steering, bases from the lane change."""
    figure, axis = plt.subplots(figsize=(6.7, 3.2))
    for label, (text, style) in {
        "full_order": ("full order", FULL),
        "replay": ("replay", REPLAY),
        **REDUCED,
    }.items():
        run = point(results["vehicle-zero-steer"], label, start="equilibrium")
        axis.plot(run.time, run["outputs"].sel(output="lateral_position"), label=text, **style)
    axis.set_xlim(0.0, 25.0)
    axis.set_xlabel("time (s)")
    axis.set_ylabel("lateral position Y (m)")
    legend_above(figure, axis)
    return figure
