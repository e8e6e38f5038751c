"""Time histories of the 14-DOF vehicle and their errors: figures 2 to 4, and no steering."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np

from vehiclemor.report.figures.lines import FULL, LITERAL, REPLAY, Results, legend_above
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

STUDY = "figures-2-4"
DURATION = 25.0
LABELS = {"pitch": r"pitch $\theta$ (rad)", "yaw": r"yaw $\psi$ (rad)"}
NUMBERS = {"pitch": "gv_rms_pitch", "yaw": "gv_rms_yaw"}
REDUCED = reduced_models(3)
# The response has died away at this time (s), long before the end of the run.
SHOWN = 6.0


def figure_2(results: Results) -> Figure:
    """Path in the plane from equilibrium: the whole run, and the lane change alone."""
    return figure_of_paths(results[STUDY], REDUCED, whole=500.0, part=100.0)


def figure_3(results: Results) -> Figure:
    """Pitch and yaw from both starts."""
    figure, axes = panels(2, 5.2, SHOWN, DURATION)
    for (row, column), axis in np.ndenumerate(axes):
        start, output = list(STARTS)[column], list(LABELS)[row]
        draw_history(axis, results[STUDY], start, output, REDUCED)
        axis.set_ylabel(LABELS[output])
    axes[0, 0].plot([], [], color=LITERAL["color"], label="literal leaves the axes", **CROSS)
    legend_above(figure, axes[0, 0])
    return figure


def figure_4(results: Results) -> Figure:
    """Errors of figure 3, the largest in each control period."""
    figure, axes = panels(2, 5.2, 2.0 * SHOWN, DURATION)
    published, dataset = load_published().numbers, results[STUDY]
    drawn = dict(REDUCED)
    if "pod_state" in dataset["method"].values:
        drawn["pod_state"] = ("POD, r = 3 (state, energy)", OTHER)
    for (row, column), axis in np.ndenumerate(axes):
        start, output = list(STARTS)[column], list(LABELS)[row]
        draw_errors(axis, dataset, start, published[NUMBERS[output]], drawn)
        axis.set_ylim(1e-8, 30.0)
        axis.set_ylabel(f"largest error of {LABELS[output]}")
    axes[0, 0].plot([], [], color=LITERAL["color"], label="literal has diverged", **CROSS)
    legend_above(figure, axes[0, 0], columns=3)
    return figure


def figure_zero_steer(results: Results) -> Figure:
    """Lateral position without steering, bases from the lane change."""
    figure, axis = plt.subplots(figsize=(6.7, 3.2))
    drawn = {"full_order": ("full order", FULL), "replay": ("replay", REPLAY), **REDUCED}
    draw_lateral_positions(axis, results["vehicle-zero-steer"], drawn, DURATION)
    axis.set_xlabel("time (s)")
    legend_above(figure, axis)
    return figure
