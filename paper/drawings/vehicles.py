"""Figures 2 to 4, 9 and 10, and the vehicles on inputs that they were not trained on."""

from collections.abc import Sequence

import numpy as np
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
    """Paths on three inputs that no reduced model was trained on; largest lateral errors below."""
    inputs = {
        -1.2: "amplitude 1.2 to the right",
        0.5: "amplitude 0.5 to the left",
        0.0: "no steering",
    }
    labels = "replay", "pod", "slow_manifold"
    heights = {"height_ratios": [2.0, 1.0]}
    figure, grid = panels(2, 3, TWO, 2.7, sharey="row", gridspec_kw=heights)
    for (upper, lower), amplitude in zip(grid.T, inputs, strict=True):
        points = [dataset.sel(amplitude_factor=amplitude).squeeze() for dataset in results.values()]
        at = {str(label): point for point in points for label in np.atleast_1d(point["label"])}
        runs = {k: v.sel(label=k) if v["label"].ndim else v for k, v in at.items() if k in labels}
        _draw_path(upper, "full_order", runs["pod"]["reference_outputs"])
        for label in labels:
            _draw_path(upper, label, runs[label]["outputs"])
        errors = [float(runs[k]["max_error"].sel(output="lateral_position")) for k in labels]
        _draw_bars(lower, labels, errors)
        upper.set_xlim(0.0, 150.0)
        upper.set_xlabel("X (m)")
        lower.set_xlabel("largest error of Y (m)")
    grid[0, 0].set_ylabel("Y (m)")
    titles(grid[:1], inputs.values())
    legend(figure, [grid[0, 0]], 4)
    return figure


def _draw_path(axis: Axes, label: str, outputs) -> None:  # noqa: ANN001
    places = [outputs.sel(output=f"{name}_position").values for name in ("longitudinal", "lateral")]
    axis.plot(*places, **(FULL if label == "full_order" else LINES[label]))


def _draw_bars(axis: Axes, labels: Sequence[str], errors: Sequence[float]) -> None:
    """Largest errors with their numbers, on a logarithmic axis from a millimetre on."""
    least = 1e-3
    colors = [LINES[label]["color"] for label in labels]
    texts = [str(LINES[label]["label"]) for label in labels]
    bars = axis.barh(texts, np.maximum(errors, 1.2 * least), 0.65, color=colors)
    numbers = [f"{e:.2g} m" if e >= least else "below 1 mm" for e in errors]
    axis.bar_label(bars, numbers, padding=3, fontsize=7)
    axis.set_ylim(len(labels) - 0.5, -0.5)
    axis.set_xscale("log")
    axis.set_xlim(least, 200.0)
    axis.set_xticks([1e-3, 1e-1, 1e1], ["0.001", "0.1", "10"])
    axis.minorticks_off()
    axis.grid(visible=False, axis="y")
