"""Errors of the 14-DOF vehicle over perturbations of the lane change."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vehiclemor.report.figures.lines import Results
from vehiclemor.report.figures.perturbations import error_map

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OUTPUTS = {
    "lateral_position": "RMS error of Y (m)",
    "yaw": r"RMS error of yaw $\psi$ (rad)",
}


def figure_vehicle_map(results: Results) -> Figure:
    """RMS errors over both perturbations, for POD and for replay."""
    return error_map(results["vehicle-perturbations"], OUTPUTS, {}, values_in_cells=True)
