"""Errors of the high-fidelity vehicle over perturbations of the lane change."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vehiclemor.report.figures.lines import Results
from vehiclemor.report.figures.perturbations import error_map

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OUTPUTS = {
    "lateral_speed": r"RMS error of $v_y$ (m/s)",
    "vertical_speed": r"RMS error of $v_z$ (m/s)",
}


def figure_high_fidelity_map(results: Results) -> Figure:
    """RMS errors over both perturbations, for POD and for replay."""
    dataset = results["high-fidelity-perturbations"]
    return error_map(dataset, OUTPUTS, {}, values_in_cells=True, rank=1)
