"""What reduced vehicles cover, and whether they know it: runs of `other_steering.py`."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure

from drawings import look
from drawings.fields import MODELS

VEHICLES = "independent_suspension_vehicle", "high_fidelity_vehicle"
# Edges of the cells: speed in m/s, acceleration in m/s^2; and of the errors in bounds.
SPEEDS, ACCELERATIONS = np.arange(8.0, 36.0, 3.0), np.arange(0.0, 10.0)
ERRORS = 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0
COLORS = "RdYlBu_r"
MARK: dict[str, Any] = {"color": "black", "markerfacecolor": "none", "linestyle": "none"}
MARK |= {"markeredgewidth": 0.6}
MARKS: dict[str, dict[str, Any]] = {
    "right": {"marker": ".", "markersize": 1.5},
    "warned of": {"marker": "o", "markersize": 3.5},
    "missed without a warning": {"marker": "x", "markersize": 5},
}


def figure_coverage(results: Mapping[str, xr.Dataset]) -> Figure:
    """Largest error over speed and lateral acceleration, and the runs that are warned of."""
    texts = [MODELS[name] for name in VEHICLES]
    figure, ((*axes,),) = look.lettered(1, 2, look.TWO, 2.9, texts, sharey=True)
    norm = BoundaryNorm(ERRORS, colormaps[COLORS].N, extend="both")
    for axis, name in zip(axes, VEHICLES, strict=True):
        part = runs_of(results, name, "speeds")
        # What is infinite would be blank.
        errors = np.minimum(largest_errors(part).T, 2.0 * ERRORS[-1])
        axis.pcolorfast(SPEEDS, ACCELERATIONS, errors, cmap=COLORS, norm=norm, alpha=0.6)
        axis.grid(False)
        right, warned = part["score"].values <= 1.0, part["warned"].values
        for chosen, text in zip((right & ~warned, warned, ~right & ~warned), MARKS, strict=True):
            run = part.isel(run=chosen)
            axis.plot(run["speed"], run["acceleration"], label=text, **MARK | MARKS[text])
        axis.set_xlabel("speed at the start (m/s)")
        axis.set_xlim(SPEEDS[0], SPEEDS[-1])
        axis.set_ylim(ACCELERATIONS[0], ACCELERATIONS[-1])
    axes[0].set_ylabel("lateral acceleration (m/s$^2$)")
    figure.colorbar(
        axes[0].images[0], ax=axes, label="largest error / bound", pad=0.01, format="%g"
    )
    look.legend(figure, axes, 3)
    return figure


def runs_of(results: Mapping[str, xr.Dataset], name: str, kind: str = "") -> xr.Dataset:
    """Runs of a vehicle, of one kind or of all."""
    data = results["other_steering"].drop_dims("name")
    chosen = data["model"].values == name
    return data.isel(run=chosen & (np.isin(data["kind"].values, kind) | (not kind)))


def largest_errors(part: xr.Dataset) -> np.ndarray:
    """Largest error in bounds (speeds, accelerations) of the runs in each cell; NaN if none is."""
    errors = np.full((len(SPEEDS) - 1, len(ACCELERATIONS) - 1), np.nan)
    rows = np.searchsorted(SPEEDS, part["speed"].values, side="right") - 1
    columns = np.searchsorted(ACCELERATIONS, part["acceleration"].values, side="right") - 1
    for row, column, score in zip(rows, columns, part["score"].values, strict=True):
        if row < errors.shape[0] and column < errors.shape[1]:
            errors[row, column] = np.fmax(errors[row, column], score)
    return errors
