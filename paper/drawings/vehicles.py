"""Figures 2 to 4, 9 and 10, and the vehicles on inputs that they were not trained on."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drawings import look
from drawings.look import FULL, LINES, ONE, TWO, Results, legend, panels, titles
from vehiclemor.report.published import rms_numbers

TRAINED = "pod", "pod_literal"
SYMBOLS = r"$\theta$", r"$\psi$"


def figure_paths(results: Results, *, study: str) -> Figure:
    """Path from equilibrium, and the distance from the full order at the same time."""
    runs = results[study].sel(start="equilibrium").squeeze()
    place = ["longitudinal_position", "lateral_position"]
    x, y = runs["reference_outputs"].sel(label="pod", output=place).transpose("output", "time")
    figure, grid = panels(2, 1, ONE, 2.5, sharex=True)
    upper, lower = grid.flat
    upper.plot(x, y, **FULL)
    for label in TRAINED:
        ahead, aside = runs["outputs"].sel(label=label, output=place).transpose("output", "time")
        upper.plot(ahead, aside, **LINES[label])
        away = np.hypot(ahead - x, aside - y).values
        lower.semilogy(x, np.where(away > 0.0, away, np.nan), **LINES[label])
    lower.set_ylim(3e-7, 3.0)
    look.decades(lower)
    upper.set_ylabel("Y (m)")
    lower.set_ylabel("distance (m)")
    lower.set_xlabel("X (m)")
    lower.set_xlim(0.0, float(x[-1]))
    titles(grid, ["path, X and Y not to the same scale", "distance from the full order"])
    legend(figure, [upper], 3)
    return figure


def figure_pitch_and_yaw(results: Results, *, errors: bool = False) -> Figure:
    """Pitch and yaw or their errors, two initial conditions."""
    share = {"sharey": "row"} if errors else {}
    figure, grid = panels(2, 2, ONE, 2.8 if errors else 2.6, sharex=True, **share)
    bounds = rms_numbers("independent_suspension_vehicle")
    for column, start in enumerate(("equilibrium", "dropped")):
        runs = results["figures-2-4"].sel(start=start).squeeze()
        for axis, output in zip(grid[:, column], ("pitch", "yaw"), strict=True):
            if errors:
                look.errors_in_periods(axis, runs, output, TRAINED, 0.5, bounds[output].value)
                look.decades(axis)
            else:
                look.history(axis, runs, output, TRAINED, 1e3)
        grid[-1, column].set_xlabel("time (s)")
        grid[-1, column].set_xlim(0.0, 15.0 if errors else 6.0)
    for axis, name, symbol in zip(grid[:, 0], ("pitch", "yaw"), SYMBOLS, strict=True):
        axis.set_ylabel(f"error of {symbol} (rad)" if errors else f"{name} {symbol} (mrad)")
    titles(grid, ["equilibrium", "dropped"])
    legend(figure, grid.flat, 2)
    return figure


def figure_speeds(results: Results) -> Figure:
    """Lateral and vertical speed of the high-fidelity vehicle, and their errors."""
    figure, grid = panels(2, 4, TWO, 2.6, sharex=True)
    outputs = {"lateral_speed": "lateral", "vertical_speed": "vertical"}
    bounds = rms_numbers("high_fidelity_vehicle")
    places = [(start, output) for output in outputs for start in ("equilibrium", "dropped")]
    for (upper, lower), (start, output) in zip(grid.T, places, strict=True):
        runs = results["figures-9-10"].sel(start=start).squeeze()
        look.history(upper, runs, output, TRAINED, 1e3)
        look.errors_in_periods(lower, runs, output, TRAINED, 0.1, bounds[output].value)
        look.decades(lower)
        lower.set_xlabel("time (s)")
        lower.set_xlim(0.0, 6.0)
    for column, text in zip((0, 2), outputs.values(), strict=True):
        grid[0, column].set_ylabel(f"{text} (mm/s)")
        grid[1, column].set_ylabel("error (m/s)")
    titles(grid, ["equilibrium", "dropped"] * 2)
    legend(figure, grid.flat, 6)
    return figure


def figure_zero_steer(results: Results) -> Figure:
    """Both vehicles without steering, with bases from the lane change."""
    figure, grid = panels(1, 2, ONE, 1.6, sharey=True)
    shown = {
        "vehicle-zero-steer": ("14-DOF", ("replay", *TRAINED)),
        "high-fidelity-zero-steer": ("high-fidelity", ("replay", *TRAINED)),
    }
    for axis, (study, (_, labels)) in zip(grid.flat, shown.items(), strict=True):
        runs = results[study].sel(start="equilibrium").squeeze()
        axis.plot(runs["time"], runs["reference_outputs"][0].sel(output="lateral_position"), **FULL)
        for label in labels:
            values = runs["outputs"].sel(label=label, output="lateral_position")
            axis.plot(runs["time"], values, **LINES[label])
        axis.set_xlim(0.0, 10.0)
        axis.set_xlabel("time (s)")
    grid[0, 0].set_ylabel("Y (m)")
    titles(grid, [text for text, _ in shown.values()])
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
    figure, grid = panels(2, 3, TWO, 3.4, sharey="row", gridspec_kw=heights)
    for (upper, lower), amplitude in zip(grid.T, inputs, strict=True):
        others, ranks = (
            data.sel(amplitude_factor=amplitude).squeeze() for data in results.values()
        )
        _draw_path(upper, FULL, others["reference_outputs"].isel(label=0))
        for label, rank in (("pod", 3), ("pod", 8), ("fixed_basis", 8)):
            _draw_path(upper, _of_rank(label, rank), ranks["outputs"].sel(label=label, rank=rank))
        for label in ("replay", "slow_manifold"):
            _draw_path(upper, LINES[label], others["outputs"].sel(label=label))
        _draw_errors(lower, ranks["max_error"], others["max_error"])
        upper.set_xlim(0.0, 150.0)
        upper.set_xlabel("X (m)")
        lower.set_xlabel("rank r")
    grid[0, 0].set_ylabel("Y (m)")
    grid[1, 0].set_ylabel("largest error of Y (m)")
    titles(grid[:1], inputs.values())
    legend(figure, grid[:, 0], 4)
    return figure


def _of_rank(label: str, rank: int) -> dict[str, Any]:
    """Style of a basis of a rank: the lower one is drawn thinner."""
    line = LINES[label]
    return line | {"label": f"{line['label']}, r = {rank}", "linewidth": 0.9 if rank < 5 else 1.4}


def _draw_path(axis: Axes, style: Mapping[str, Any], outputs: xr.DataArray) -> None:
    places = [outputs.sel(output=f"{name}_position").values for name in ("longitudinal", "lateral")]
    axis.plot(*places, **style)


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
    look.decades(axis, 1)
