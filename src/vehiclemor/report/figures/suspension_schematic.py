"""Figure 5: the suspension drawn from the model in space, beside its topological graph."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from vehiclemor.report.figures.graph import SCHEMATICS, draw_graph
from vehiclemor.report.figures.space import rim, space_and_graph
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.build import build

SCHEMATIC = SCHEMATICS.suspension
COLORS = SCHEMATIC.colors
WHEEL_RADIUS = 0.30  # m, for the outline only: the kinematic model has no wheel.


def figure_suspension() -> Figure:
    """Mechanism at design, with its positions at +-0.1 m of travel, and the graph."""
    model = build("double_wishbone")
    assert isinstance(model, AlgebraicModel)
    figure, space, graph = space_and_graph(4.1, (0.0, 0.17, 0.5, 0.76), (0.52, 0.14, 0.48, 0.76))
    for travel, alpha in ((-0.1, 0.25), (0.1, 0.25), (0.0, 1.0)):
        _draw(space, model, model.solve([travel, 0.0]), alpha)
    _axes_in_space(space)
    draw_graph(graph, SCHEMATIC.nodes, SCHEMATIC.edges, COLORS)
    graph.set_xlim(-0.45, 3.65)
    graph.set_ylim(-0.35, 2.35)
    handles, labels = space.get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower left", ncols=3, fontsize=7.5)
    figure.text(0.02, 0.94, "(a)")
    figure.text(0.55, 0.94, "(b)")
    figure.text(0.07, 0.94, "faint: wheel travel of -0.1 and +0.1 m", fontsize=7, color="#555555")
    return figure


def _draw(axis: Any, model: AlgebraicModel, q: np.ndarray, alpha: float) -> None:
    fixed, moving = model.parameters.values(), model.joints_at(q)
    upper, lower = moving["upper_ball_joint"], moving["lower_ball_joint"]
    centre, outer = moving["wheel_centre"], moving["tie_rod_outer"]
    bodies = {
        **linkage({**fixed, **moving}),
        "rack": [
            moving["tie_rod_inner"] - np.array([0.0, 0.12, 0.0]),
            moving["tie_rod_inner"] + np.array([0.0, 0.03, 0.0]),
        ],
    }
    for name, points in bodies.items():
        line = np.array(points).T
        width = 2.2 if alpha == 1.0 else 1.0
        label = name if alpha == 1.0 else None
        axis.plot(*line, color=COLORS[name], linewidth=width, alpha=alpha, label=label)
    carrier = Poly3DCollection(
        [[upper, lower, outer]], color=COLORS["wheel carrier"], linewidth=0.0
    )
    carrier.set_alpha(0.25 * alpha)
    axis.add_collection3d(carrier)
    spindle = np.array([(upper + lower) / 2.0, centre]).T
    axis.plot(*spindle, color=COLORS["wheel carrier"], linewidth=1.4, alpha=alpha)
    if alpha == 1.0:
        joints = np.array([upper, lower, outer, moving["tie_rod_inner"]]).T
        axis.plot(*joints, "o", color="white", markeredgecolor="black", markersize=4.5)
        pivots = [
            fixed[f"{arm}_arm_{end}_pivot"]
            for arm in ("upper", "lower")
            for end in ("front", "rear")
        ]
        axis.plot(
            *np.array(pivots).T, "s", color=COLORS["chassis"], markersize=4.5, label="chassis pivot"
        )
    _wheel(axis, centre, moving["axle_direction"], alpha)


def linkage(at: Mapping[str, np.ndarray]) -> dict[str, list[np.ndarray]]:
    """Corners of the bodies of one front suspension, from the places of its points."""
    upper, lower, outer = at["upper_ball_joint"], at["lower_ball_joint"], at["tie_rod_outer"]
    return {
        "upper arm": [at["upper_arm_front_pivot"], upper, at["upper_arm_rear_pivot"]],
        "lower arm": [at["lower_arm_front_pivot"], lower, at["lower_arm_rear_pivot"]],
        "wheel carrier": [upper, lower, outer, upper],
        "tie rod": [at["tie_rod_inner"], outer],
    }


def _wheel(axis: Any, centre: np.ndarray, spin: np.ndarray, alpha: float) -> None:
    axis.plot(*rim(centre, spin, WHEEL_RADIUS).T, color="#999999", linewidth=1.0, alpha=alpha)


def _axes_in_space(axis: Any) -> None:
    axis.set_xlabel("x (m)", labelpad=0)
    axis.set_ylabel("y (m)", labelpad=0)
    axis.set_zlabel("z (m)", labelpad=0)
    axis.zaxis.set_rotate_label(False)
    axis.zaxis.label.set_rotation(90.0)
    axis.set_box_aspect((0.75, 0.6, 0.85), zoom=0.95)
    axis.set_xlim(-0.375, 0.375)
    axis.set_ylim(0.3, 0.9)
    axis.set_zlim(-0.5, 0.35)
    axis.view_init(elev=14, azim=28)
    axis.tick_params(pad=0, labelsize=7)
    axis.locator_params(nbins=4)
