"""Figures 2 to 4, 9 and 10, and the vehicles on inputs that they were not trained on."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drawings.look import LINES, ONE, TRAINED, TWO, Results, decades, legend, lettered, runs
from vehiclemor.report.figures import runs as draw
from vehiclemor.report.figures.theme import FULL
from vehiclemor.report.labels import unit_of

STARTS = "equilibrium", "dropped"
SYMBOLS = {"pitch": r"$\theta$", "yaw": r"$\psi$"}


def figure_paths(results: Results, *, study: str) -> Figure:
    """Path from equilibrium, and the distance from the full order at the same time."""
    texts = "path, X and Y not to the same scale", "distance from the full order"
    figure, ((upper,), (lower,)) = lettered(2, 1, ONE, 2.5, texts, sharex=True)
    shown = runs(results[study], start="equilibrium")
    draw.draw_paths(upper, shown)
    draw.draw_distances(lower, shown.curves)
    lower.set(ylim=(3e-7, 3.0), xlabel="X (m)")
    decades(lower.yaxis)
    upper.set_ylabel("Y (m)")
    legend(figure, [upper], 3)
    return figure


def figure_pitch_and_yaw(results: Results, *, errors: bool = False) -> Figure:
    """Pitch and yaw or their errors, two initial conditions."""
    share = {"sharey": "row"} if errors else {}
    figure, grid = lettered(2, 2, ONE, 2.8 if errors else 2.6, STARTS, sharex=True, **share)
    end = 15.0 if errors else 6.0
    for column, start in zip(grid.T, STARTS, strict=True):
        shown = runs(results["figures-2-4"], end=end, start=start)
        for axis, (output, symbol) in zip(column, SYMBOLS.items(), strict=True):
            if errors:
                _draw_largest_errors(axis, shown, output, symbol)
            else:
                unit = draw.draw_history(axis, shown, output)
                axis.set_ylabel(f"{output} {symbol} ({unit})")
        column[-1].set(xlabel="time (s)", xlim=(0.0, end))
    for axis in grid[:, 1]:
        axis.set_ylabel("")
    legend(figure, grid.flat, 2)
    return figure


def _draw_largest_errors(axis: Axes, shown: draw.Runs, output: str, symbol: str) -> None:
    """Largest errors in each control period, with a short text beside them."""
    draw.draw_largest_errors(axis, shown, output)
    decades(axis.yaxis)
    axis.set_ylabel(f"error of {symbol} ({unit_of(shown.full, output)})")


def figure_speeds(results: Results) -> Figure:
    """Lateral and vertical speed of the high-fidelity vehicle, and their errors."""
    figure, grid = lettered(2, 4, TWO, 2.6, STARTS * 2, sharex=True)
    columns = iter(grid.T)
    for direction, symbol in (("lateral", "$v_y$"), ("vertical", "$v_z$")):
        for start in STARTS:
            upper, lower = next(columns)
            shown = runs(results["figures-9-10"], end=6.0, start=start)
            unit = draw.draw_history(upper, shown, f"{direction}_speed")
            upper.set_ylabel(f"{direction} ({unit})")
            _draw_largest_errors(lower, shown, f"{direction}_speed", symbol)
            lower.set(xlabel="time (s)", xlim=(0.0, 6.0))
    legend(figure, grid.flat, 6)
    return figure


def figure_zero_steer(results: Results) -> Figure:
    """Both vehicles without steering, with bases from the lane change."""
    figure, grid = lettered(1, 2, ONE, 1.6, ("14-DOF", "high-fidelity"), sharey=True)
    studies = "vehicle-zero-steer", "high-fidelity-zero-steer"
    for axis, study in zip(grid.flat, studies, strict=True):
        shown = runs(results[study], ("replay", *TRAINED), start="equilibrium")
        draw.draw_history(axis, shown, "lateral_position")
        axis.set(xlabel="time (s)", xlim=(0.0, 10.0), ylabel="")
    grid[0, 0].set_ylabel("Y (m)")
    legend(figure, [grid[0, 0]], 4)
    return figure


def figure_unseen(results: Results) -> Figure:
    """Paths on three inputs that no method was trained on; largest lateral errors over the rank."""
    inputs = {
        -1.2: "1.2 times the steering, to the right",
        0.5: "half the steering, to the left",
        0.0: "no steering",
    }
    heights = {"height_ratios": [1.7, 1.0]}
    figure, grid = lettered(2, 3, TWO, 3.4, inputs.values(), sharey="row", gridspec_kw=heights)
    for (upper, lower), amplitude in zip(grid.T, inputs, strict=True):
        others, ranks = (
            data.sel(amplitude_factor=amplitude).squeeze() for data in results.values()
        )
        full = draw.positions(others["reference_outputs"].isel(label=0))
        upper.plot(*full, label="full order", **FULL)
        for label, rank in (("pod", 3), ("pod", 8), ("fixed_basis", 8)):
            path = draw.positions(ranks["outputs"].sel(label=label, rank=rank))
            upper.plot(*path, **_of_rank(label, rank))
        for label in ("replay", "slow_manifold"):
            upper.plot(*draw.positions(others["outputs"].sel(label=label)), **LINES[label])
        _draw_errors(lower, ranks["max_error"], others["max_error"])
        upper.set(xlim=(0.0, 150.0), xlabel="X (m)")
        lower.set(title="", xlabel="rank r")
    grid[0, 0].set_ylabel("Y (m)")
    grid[1, 0].set_ylabel("largest error of Y (m)")
    legend(figure, grid[:, 0], 4)
    return figure


def _of_rank(label: str, rank: int) -> dict[str, Any]:
    """Style of a basis of a rank: the lower one is drawn thinner."""
    line = LINES[label]
    return line | {"label": f"{line['label']}, r = {rank}", "linewidth": 0.9 if rank < 5 else 1.4}


def _draw_errors(axis: Axes, of_ranks: xr.DataArray, of_others: xr.DataArray) -> None:
    """Largest errors over the rank, on a logarithmic axis from a millimetre on."""
    least = 1e-3
    for label, marker in (("pod", "o"), ("fixed_basis", "s")):
        errors = of_ranks.sel(label=label, output="lateral_position")
        style = LINES[label] | {"marker": marker, "markersize": 3.5}
        axis.semilogy(errors["rank"], np.maximum(errors, least), **style)
    for label in ("replay", "slow_manifold"):
        error = float(of_others.sel(label=label, output="lateral_position"))
        axis.axhline(max(error, least), **LINES[label])
        if error < least:
            axis.text(6.0, 1.3 * least, "slow manifold: below 1 mm", ha="center", fontsize=7)
    one_run = float(of_others.sel(label="pod_of_one_run", output="lateral_position"))
    axis.plot(3, one_run, "x", color="black", label="POD of one run, r = 3")
    axis.set_ylim(0.8 * least, 60.0)
    axis.set_xticks(of_ranks["rank"].values)
    decades(axis.yaxis, 1)
