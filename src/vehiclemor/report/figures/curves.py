"""Panels of one output over the time: full order and reduced models, and their errors."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from vehiclemor.report.figures.lines import CROSS, FULL, Style
from vehiclemor.report.labels import axis_label, error_label, readable_unit, unit_of
from vehiclemor.simulation.trajectory import FINISHED

LARGEST = "largest error in each {period:.2g} s"
DIVERGED = "has diverged"
RMS_MARK: Style = {"marker": "<", "markersize": 6, "linestyle": "none"}
# Longer labels need two lines beside a low panel.
LONG = 22
# Outputs that make a path in the plane.
PATH = ("longitudinal_position", "lateral_position")
BREAK: Style = {"color": "#777777", "linewidth": 0.8}


class Curve(NamedTuple):
    """A reduced model's run, with the text of its legend and its style."""

    text: str
    style: Style
    run: xr.Dataset


class Panel(NamedTuple):
    """One output of a full-order run and of reduced ones.

    Attributes
    ----------
    scale
        Largest value, which decides the prefix of the unit; this panel's own by default.
    """

    output: str
    full: xr.Dataset
    curves: Sequence[Curve]
    scale: float | None = None


def compared(runs: Iterable[xr.Dataset]) -> xr.Dataset:
    """The first run that stands beside its full order; a failed one may have none."""
    first, *others = runs
    known = (run for run in (first, *others) if bool(run["reference_outputs"].notnull().any()))
    return next(known, first)


def errors(panel: Panel, curve: Curve) -> xr.DataArray:
    """Error (time,) of a reduced run."""
    return (curve.run["outputs"] - curve.run["reference_outputs"]).sel(output=panel.output)


def draw_history(axis: Axes, panel: Panel, reach: float = 0.25) -> dict[str, str]:
    """One output of all runs; what the crosses mean -> their colour.

    Lines end where they leave the surroundings of the full-order signal: up to `reach` times its
    range around it.
    """
    full = panel.full["reference_outputs"].sel(output=panel.output)
    histories = [curve.run["outputs"].sel(output=panel.output) for curve in panel.curves]
    known = [float(abs(signal).max()) for signal in (full, *histories) if signal.notnull().any()]
    largest, own = panel.scale or (known or [0.0])[0], unit_of(panel.full, panel.output)
    factor, unit = readable_unit(largest, own)
    if bool(full.notnull().any()):
        axis.plot(full.time, factor * full, label="full order", **FULL)
    axis.set_ylabel(axis_label(panel.full, panel.output, unit))
    histories = [factor * history for history in histories]
    limits = _surroundings(factor * full, histories, reach)
    if limits:
        axis.set_ylim(*limits)
    left: dict[str, str] = {}
    for (text, style, _), history in zip(panel.curves, histories, strict=True):
        if not limits:
            axis.plot(full.time, history, label=text, **style)
        elif ended := _plot_until_it_leaves(axis, history, text, style):
            left[ended] = style["color"]
    axis.ticklabel_format(style="plain")
    axis.locator_params(axis="y", nbins=6)
    return left


def _surroundings(
    full: xr.DataArray, histories: Sequence[xr.DataArray], reach: float
) -> tuple[float, float] | None:
    """Limits that hold the full-order signal and of the others what is near it."""
    low, high = float(full.min()), float(full.max())
    span = high - low
    if not span > 0.0:
        return None
    near = [v for h in histories for v in (float(h.min()), float(h.max())) if np.isfinite(v)]
    lowest = max(min([low, *near]), low - reach * span)
    highest = min(max([high, *near]), high + reach * span)
    return lowest - 0.05 * span, highest + 0.05 * span


def _plot_until_it_leaves(axis: Axes, history: xr.DataArray, text: str, style: Style) -> str:
    """Draw a history up to the first point outside the axes; what the cross there means."""
    low, high = axis.get_ylim()
    time, values = history["time"].values, history.values.copy()
    outside = np.flatnonzero(~((values >= low) & (values <= high)))
    ended = ""
    # What has failed before its first value has no end.
    if outside.size and np.isfinite(values[0]):
        first = int(outside[0])
        # A run that has diverged ends without a value.
        diverged = not np.isfinite(values[first])
        seen, ended = first - diverged, DIVERGED if diverged else "leaves the axes"
        place = (time[seen], np.clip(values[seen], low, high))
        axis.plot(*place, color=style["color"], clip_on=False, **CROSS)
        values[first + 1 :] = np.nan
    axis.plot(time, values, label=text, **style)
    return ended


def draw_errors(axis: Axes, panel: Panel, kind: str = "error", floor: bool = True) -> None:
    """Errors over the time, and the RMS error of the best approximation by the first method."""
    found = [errors(panel, curve) for curve in panel.curves]
    largest = np.fmax.reduce([float(abs(error).max()) for error in found])
    factor, unit = readable_unit(float(largest), unit_of(panel.full, panel.output))
    for curve, error in zip(panel.curves, found, strict=True):
        axis.plot(error.time, factor * error, label=curve.text, **curve.style)
    if floor:
        floors = (
            curve.run["floor_rms_error"].sel(output=panel.output).item() for curve in panel.curves
        )
        best = next((factor * value for value in floors if np.isfinite(value)), None)
        if best is not None:
            shade = {"color": "#BBBBBB", "alpha": 0.5, "label": "RMS of the best approximation"}
            axis.axhspan(-best, best, **shade)
    label = error_label(panel.full, kind, panel.output, unit)
    axis.set_ylabel(label if len(label) <= LONG else label.replace(" of ", " of\n", 1))


def draw_largest_errors(
    axis: Axes, panel: Panel, period: float, limits: Sequence[float] | None = None
) -> dict[str, str]:
    """Largest error in each period (s), the RMS error at the right edge; the meaning of crosses."""
    ended: dict[str, str] = {}
    for number, curve in enumerate(panel.curves):
        edges, largest = _largest(abs(errors(panel, curve)), period)
        largest[largest == 0.0] = np.nan
        shown = {"label": curve.text, "drawstyle": "steps-post", **curve.style}
        axis.semilogy(edges, largest, **shown)
        color, status = curve.style["color"], str(curve.run["status"].item())
        if status in FINISHED:
            rms = curve.run["rms_error"].sel(output=panel.output).item()
            edge = axis.get_yaxis_transform()
            place = 1.0 + min(0.03, 0.12 / len(panel.curves)) * number
            axis.plot(place, rms or np.nan, color=color, transform=edge, clip_on=False, **RMS_MARK)
        elif status == "diverged" and np.isfinite(largest).any():
            last = int(np.flatnonzero(np.isfinite(largest[:-1]))[-1])
            ended[DIVERGED] = color
            axis.plot(edges[last + 1], largest[last], color=color, **CROSS)
    axis.plot([], [], color="black", label="RMS error over the run", **RMS_MARK)
    if limits:
        axis.set_ylim(*limits)
    else:
        hide_rounding(axis)
    label = error_label(panel.full, LARGEST.format(period=period), panel.output)
    axis.set_ylabel(label.replace(" in each", "\nin each"))
    return ended


def _largest(error: xr.DataArray, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Edges (n + 1,) of the periods in s and the largest error in each, the last one repeated."""
    # A sample between two periods belongs to the one that ends there.
    window = np.maximum(np.ceil(error["time"].values / period - 1e-9).astype(int) - 1, 0)
    numbers = np.arange(window[-1] + 1)
    largest = np.array([np.fmax.reduce(error.values[window == k]) for k in numbers])
    return period * np.arange(window[-1] + 2), np.append(largest, largest[-1])


def draw_distances(axis: Axes, curves: Iterable[Curve]) -> None:
    """Distance between the places of a reduced and the full vehicle at the same time, over X."""
    for text, style, run in curves:
        x, y = positions(run["reference_outputs"])
        away = np.hypot(*(a - b for a, b in zip(positions(run["outputs"]), (x, y), strict=True)))
        away = np.where(away > 0.0, away, np.nan)
        if np.isfinite(away).any():
            axis.semilogy(x, away, label=text, **style)
    hide_rounding(axis)
    axis.set_ylabel("distance at the\nsame time (m)")


def hide_rounding(axis: Axes) -> None:
    """A logarithmic axis ends six decades below its largest value."""
    low, high = axis.get_ylim()
    if axis.get_yscale() == "log":
        axis.set_ylim(max(low, 1e-6 * high), high)


def positions(outputs: xr.DataArray) -> list[np.ndarray]:
    """X and Y (time,) in m."""
    return [outputs.sel(output=output).values for output in PATH]
