"""What reduced vehicles cover, and whether they know it: runs of `other_steering.py`."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drawings import look
from drawings.fields import MODELS

VEHICLES = "independent_suspension_vehicle", "high_fidelity_vehicle"
# m/s; m/s^2: lateral acceleration, and that of drive and brakes; radii of the circles.
SPEEDS, SIDEWAYS, FORWARD, CIRCLES = (7.0, 36.0), (0.0, 10.0), (-7.0, 3.0), (2, 4, 6, 8)
MARK: dict[str, Any] = {"color": "black", "markerfacecolor": "none", "linestyle": "none"}
MARK |= {"markeredgewidth": 0.6}
# Errors in bounds, and what an estimate tells, rightly or not.
SHOWN = 1e-2, 1e3
TOLD: dict[str, dict[str, Any]] = {
    "told rightly": {"marker": ".", "markersize": 1.5},
    "warned of, but right": {"marker": "o", "markersize": 3.5},
    "missed without a warning": {"marker": "x", "markersize": 5},
}
DOT: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 2.4, "markeredgewidth": 0}
RING: dict[str, Any] = {"markersize": 3.4, "markerfacecolor": "none", "markeredgewidth": 0.7}
MARKS: dict[str, dict[str, Any]] = {
    "within all bounds": DOT | {"color": look.BLUE},
    "within, but warned of": DOT | {"color": look.BLUE} | RING,
    "beyond, and warned of": DOT | {"color": look.ORANGE},
    "beyond, without a warning": MARK | {"marker": "x", "markersize": 5, "markeredgewidth": 1.0},
}


def figure_coverage(results: Mapping[str, xr.Dataset]) -> Figure:
    """Runs that keep their bounds, and warnings: over speed and acceleration sideways; braking."""
    names = [MODELS[name].removesuffix(" vehicle") for name in VEHICLES]
    texts = [*(f"{name}, steering" for name in names), *(f"{name}, braking" for name in names)]
    figure, grid = look.lettered(2, 2, 4.2, 4.4, texts, sharey="row")
    for (above, below), name in zip(grid.T, VEHICLES, strict=True):
        draw_runs(above, runs_of(results, name, "speeds"), ("speed", "acceleration"))
        above.set(xlabel="speed at the start (m/s)", xlim=SPEEDS, ylim=SIDEWAYS)
        draw_circles(below)
        draw_runs(below, runs_of(results, name, "brakes"), ("sideways", "forward"))
        below.set(xlabel="lateral acceleration (m/s$^2$)", xlim=SIDEWAYS, ylim=FORWARD)
    grid[0, 0].set_ylabel("lateral acceleration (m/s$^2$)")
    grid[1, 0].set_ylabel("brakes (-), drive (+) (m/s$^2$)")
    look.legend(figure, grid.flat, 2)
    return figure


def draw_runs(axis: Axes, part: xr.Dataset, over: tuple[str, str]) -> None:
    """A mark for each run over two of its values."""
    right, warned = part["score"].values <= 1.0, part["warned"].values
    cases = right & ~warned, right & warned, ~right & warned, ~right & ~warned
    for chosen, (text, mark) in zip(cases, MARKS.items(), strict=True):
        run = part.isel(run=chosen)
        axis.plot(run[over[0]], run[over[1]], label=text, **mark)


def draw_circles(axis: Axes) -> None:
    """Equal accelerations of the car, the friction circles."""
    angles = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 181)
    for radius in CIRCLES:
        axis.plot(radius * np.cos(angles), radius * np.sin(angles), **look.BOUND)
    axis.set_aspect("equal")
    axis.grid(False)


def figure_estimate(results: Mapping[str, xr.Dataset]) -> Figure:
    """Estimated over true largest error of every sixth run, of all kinds."""
    texts = [MODELS[name] for name in VEHICLES]
    figure, ((*axes,),) = look.lettered(1, 2, look.TWO, 2.9, texts, sharey=True)
    for axis, name in zip(axes, VEHICLES, strict=True):
        part = runs_of(results, name).isel(run=slice(None, None, 6))
        missed, warned = ~(part["score"].values <= 1.0), part["warned"].values
        alike = warned == missed
        for chosen, text in zip((alike, warned & ~alike, ~warned & ~alike), TOLD, strict=True):
            run = part.isel(run=chosen)
            axis.plot(run["score"], run["estimate"], label=text, **MARK | TOLD[text])
        axis.plot(SHOWN, SHOWN, label="estimate = error", **look.BOUND)
        axis.axhline(1.0, **look.THIN)
        axis.axvline(1.0, **look.THIN)
        axis.set(xscale="log", yscale="log", xlim=SHOWN, ylim=SHOWN)
        look.decades(axis.xaxis, 1)
        look.decades(axis.yaxis, 1)
        axis.set_xlabel("largest error / bound")
    axes[0].set_ylabel("estimated error / bound")
    look.legend(figure, axes, 4)
    return figure


def runs_of(results: Mapping[str, xr.Dataset], name: str, kind: str = "") -> xr.Dataset:
    """Runs of a vehicle, of one kind or of all."""
    data = results["other_steering"].drop_dims("name")
    chosen = data["model"].values == name
    return data.isel(run=chosen & (np.isin(data["kind"].values, kind) | (not kind)))
