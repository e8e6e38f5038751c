"""Runs of the high-fidelity vehicle and their errors: figures 9 and 10, and no steering."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np

from vehiclemor.report.figures.lines import FULL, LITERAL, REPLAY, Results, legend_above, point
from vehiclemor.report.figures.runs import (
    CROSS,
    OTHER,
    STARTS,
    draw_errors,
    draw_history,
    draw_lateral_positions,
    figure_of_paths,
    panels,
    reduced_models,
)
from vehiclemor.report.published import load_published

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STUDY = "figures-9-10"
DURATION = 10.0
SPEEDS = {"lateral_speed": "lateral speed $v_y$", "vertical_speed": "vertical speed $v_z$"}
REDUCED = reduced_models(1)
# The response has died away at this time (s).
SHOWN = 6.0


def figure_9(results: Results) -> Figure:
    """Path in the plane from equilibrium: the whole run, and the lane change alone."""
    return figure_of_paths(results[STUDY], REDUCED, whole=200.0, part=100.0)


def figure_10(results: Results) -> Figure:
    """Lateral and vertical speed from both starts, each above its errors."""
    figure, axes = panels(4, 8.0, SHOWN, DURATION)
    published, dataset = load_published().numbers, results[STUDY]
    left = False
    for (row, column), axis in np.ndenumerate(axes):
        start, output = list(STARTS)[column], list(SPEEDS)[row // 2]
        if row % 2 == 0:
            left |= draw_history(axis, dataset, start, output, REDUCED)
            axis.set_ylabel(f"{SPEEDS[output]} (m/s)")
        else:
            left |= draw_errors(axis, dataset, start, published[f"hfv_rms_{output}"], REDUCED)
            axis.set_ylim(1e-8, 1.0)
            axis.set_ylabel(f"largest error\nof {SPEEDS[output].split()[-1]} (m/s)")
    axes[0, 0].plot([], [], color="black", linestyle=":", label="published RMS error")
    if left:
        axes[0, 0].plot([], [], color=LITERAL["color"], label="leaves the axes", **CROSS)
    legend_above(figure, axes[0, 0])
    return figure


def figure_zero_steer(results: Results) -> Figure:
    """Lateral position with the rack held, bases from the lane change, and what replay lacks."""
    dataset = results["high-fidelity-zero-steer"]
    drawn = {**REDUCED, "pod_r3": ("POD, r = 3 (default)", OTHER)}
    figure, axes = plt.subplots(2, 1, sharex=True, figsize=(6.7, 4.8))
    others = {"full_order": ("full order", FULL), "replay": ("replay", REPLAY)}
    draw_lateral_positions(axes[0], dataset, {**others, **drawn}, DURATION)
    axes[0].set_title("(a)")
    replay = point(dataset, "replay", start="equilibrium")["outputs"]
    for label, (text, style) in drawn.items():
        run = point(dataset, label, start="equilibrium")["outputs"]
        apart = 1e3 * (run - replay).sel(output="lateral_position")
        axes[1].plot(run.time, apart, label=text, **style)
    axes[1].set_title("(b)")
    axes[1].set_ylabel("Y minus replay's Y (mm)")
    axes[1].set_xlabel("time (s)")
    legend_above(figure, axes[0], columns=3)
    return figure
