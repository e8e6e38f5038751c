"""Figure 8: the high-fidelity vehicle drawn from its own geometry, and its topological graph."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from vehiclemor.multibody.high_fidelity import quantities as vehicle
from vehiclemor.multibody.high_fidelity.definition import DEFINITION
from vehiclemor.multibody.high_fidelity.equilibrium import wheel_places
from vehiclemor.parameters import load_parameters
from vehiclemor.report.figures.graph import SCHEMATICS, draw_graph
from vehiclemor.report.figures.space import (
    SIZES,
    draw_box,
    draw_frame,
    draw_size,
    draw_spring_damper,
    draw_tire,
    frame_space,
    space_and_graph,
    symbol,
)
from vehiclemor.report.figures.suspension_schematic import linkage

SCHEMATIC = SCHEMATICS.high_fidelity
COLORS = SCHEMATICS.suspension.colors | SCHEMATIC.colors
SPRING_DAMPER, AXES = "#56B4E9", "#000000"
# Only for the drawing: outline of the chassis and half the length of a rear pivot, in m.
HALF_WIDTH, BOTTOM, TOP, OVERHANG, PIVOT = 0.38, 0.16, 0.68, 0.30, 0.07
# Beginnings of the names of the front suspension's points.
_FRONT = ("upper_", "lower_", "tie_rod_", "wheel_", "front_spring_")
Point = np.ndarray


def figure_vehicle() -> Figure:
    """Vehicle at rest in equilibrium, and the graph of its bodies and joints."""
    parameters = load_parameters(DEFINITION.name, DEFINITION.parameters)
    p = {name: parameters[name] for name in vehicle.PARAMETERS}
    # As large as the figure: it is square, and cuts off what stands out of it.
    figure, space, graph = space_and_graph(6.7, (0.0, 0.23, 1.0, 1.0), (0.01, 0.01, 0.98, 0.35))
    space.patch.set_visible(False)
    height = rest_height(p)
    _draw_vehicle(space, p, height)
    _draw_sizes(space, p, height)
    frame_space(space, (-1.9, -0.9, 0.0), (1.9, 0.9, 0.7), view=(22.0, -40.0), zoom=0.87)
    handles, labels = space.get_legend_handles_labels()
    legend = SCHEMATIC.legend
    drawn = [handles[labels.index(name)] for name in legend]
    figure.legend(drawn, legend, loc="center", bbox_to_anchor=(0.5, 0.45), ncols=5, fontsize=7.5)
    _draw_graph(graph)
    figure.text(0.02, 0.97, "(a)")
    figure.text(0.02, 0.385, f"(b) {_count()}")
    return figure


def rest_height(p: Mapping[str, Any]) -> float:
    """Height of the chassis' centre of mass above the road at rest, in m."""
    # Every tire carries a quarter of the weight: front and rear deflections differ by 0.3 mm from
    # each other, and the pitch of 0.1 mrad from 0, which no drawing can show.
    masses = [p[name] for name in vehicle.PARAMETERS if name.endswith("_mass")]
    # All bodies but the chassis come in pairs.
    mass = 2.0 * sum(masses) - p["chassis_mass"]
    deflection = mass * p["gravity"] / (4.0 * p["tire_stiffness"])
    return p["tire_radius"] - deflection - wheel_places(p)[0][2]


def _draw_vehicle(axis: Any, p: Mapping[str, Any], height: float) -> None:
    """Bodies of both sides at their design position, from the road upwards."""
    up = np.array([0.0, 0.0, height])
    front, rear = (place + up for place in wheel_places(p))
    draw_box(axis, (front[0] + OVERHANG, rear[0] - OVERHANG), HALF_WIDTH, (BOTTOM, TOP), edge=0.4)
    draw_frame(axis, up, AXES, "CG of the chassis")
    for side in (1.0, -1.0):
        mirror = np.array([1.0, side, 1.0])
        named = side == 1.0
        fronts = {
            name: mirror * (p[name] - p["wheel_centre"] + front)
            for name, declared in vehicle.PARAMETERS.items()
            if declared.size == 3 and declared.unit == "m" and name.startswith(_FRONT)
        }
        rears = {
            name: mirror * (p[name] + rear)
            for name in ("rear_arm_pivot", "rear_spring_chassis_point", "rear_spring_arm_point")
        }
        _front_corner(axis, fronts, named)
        _rear_corner(axis, rears, mirror * rear, named)
        for centre in (mirror * front, mirror * rear):
            label = "wheel" if named and centre[0] > 0.0 else None
            style = {"color": COLORS["front wheel"], "linewidth": 1.8, "label": label}
            draw_tire(axis, centre, np.array([0.0, 1.0, 0.0]), p["tire_radius"], **style)
    inner = p["tie_rod_inner"] - p["wheel_centre"] + front
    ends = np.array([inner, inner * [1.0, -1.0, 1.0]])
    axis.plot(*ends.T, color=COLORS["rack"], linewidth=2.4, label="rack")


def _front_corner(axis: Any, at: Mapping[str, Point], named: bool) -> None:
    upper, lower, outer = (at[n] for n in ("upper_ball_joint", "lower_ball_joint", "tie_rod_outer"))
    for name, points in linkage(at).items():
        label = name if named else None
        axis.plot(*np.array(points).T, color=COLORS[name], linewidth=2.0, label=label)
        if len(points) > 2:
            plate = Poly3DCollection([points[:3]], color=COLORS[name], linewidth=0.0)
            plate.set_alpha(0.25)
            axis.add_collection3d(plate)
    axle = np.array([(upper + lower) / 2.0, at["wheel_centre"]])
    axis.plot(*axle.T, color=COLORS["wheel carrier"], linewidth=1.4)
    _spring_damper(axis, at["front_spring_arm_point"], at["front_spring_chassis_point"], named)
    for name in ("upper_arm_front", "upper_arm_rear", "lower_arm_front", "lower_arm_rear"):
        _mount(axis, at[f"{name}_pivot"], named and name == "upper_arm_front")
    joints = np.array([upper, lower, outer, at["tie_rod_inner"]])
    axis.plot(*joints.T, "o", color="white", markeredgecolor="black", markersize=3.5)


def _rear_corner(axis: Any, at: Mapping[str, Point], centre: Point, named: bool) -> None:
    pivot, seat = at["rear_arm_pivot"], at["rear_spring_arm_point"]
    arm = np.array([pivot, seat, centre])
    label = "trailing arm" if named else None
    axis.plot(*arm.T, color=COLORS["trailing arm"], linewidth=2.4, label=label)
    ends = pivot + np.array([[0.0, -PIVOT, 0.0], [0.0, PIVOT, 0.0]])
    axis.plot(*ends.T, color=COLORS["trailing arm"], linewidth=4.0)
    _spring_damper(axis, seat, at["rear_spring_chassis_point"], named=False)
    _mount(axis, pivot, named=False)


def _spring_damper(axis: Any, low: Point, high: Point, named: bool) -> None:
    colors, labels = (SPRING_DAMPER, SPRING_DAMPER), ("spring and damper" if named else None, None)
    draw_spring_damper(axis, low, high, colors, labels, size=0.6)
    _mount(axis, high, named=False)


def _mount(axis: Any, place: Point, named: bool) -> None:
    """Point of the chassis that carries a joint, and its link to the drawn outline."""
    inner = place * [1.0, 0.0, 1.0] + [0.0, np.sign(place[1]) * HALF_WIDTH, 0.0]
    axis.plot(*np.array([inner, place]).T, color=COLORS["chassis"], linewidth=1.2)
    label = "fixed to the chassis" if named else None
    style = {"color": COLORS["chassis"], "markersize": 3.5, "linestyle": "none"}
    axis.plot(*place, "s", label=label, **style)


def _draw_sizes(axis: Any, p: Mapping[str, Any], height: float) -> None:
    """Dimensions on the road, each label beside its line."""
    front, rear = wheel_places(p)
    aside, ahead = np.array([0.0, -0.45, 0.0]), np.array([0.65, 0.0, 0.0])
    right, left = (front * [1.0, side, 0.0] for side in (-1.0, 1.0))
    draw_size(axis, right + aside, rear * [1.0, -1.0, 0.0] + aside, (-0.15, -0.30, 0.0), "l")
    draw_size(axis, left + ahead, right + ahead, (0.35, -0.15, 0.0), "T")
    top = np.array([0.0, 0.0, height])
    draw_size(axis, 0.0 * top, top, (-0.45, 0.0, -height), "h")


def _count() -> str:
    """How many coordinates, constraints and degrees of freedom the model has."""
    coordinates, constraints = len(vehicle.COORDINATES), len(vehicle.CONSTRAINTS)
    return (
        f"{coordinates} coordinates, {constraints} constraints: "
        f"{coordinates - constraints} degrees of freedom"
    )


def _draw_graph(axis: Axes) -> None:
    """One front and one rear corner, as the others are the same."""
    names = [quantity.name.removesuffix("_FL") for quantity in vehicle.COORDINATES]
    symbols: dict[str, object] = {name: symbol(name) for name in names}
    symbols["free"] = ", ".join(map(symbol, names[:6]))
    symbols["equations"] = len(vehicle.CONSTRAINTS) // 4
    edges = [(start, end, text.format(**symbols)) for start, end, text in SCHEMATIC.edges]
    draw_graph(axis, SCHEMATIC.nodes, edges, COLORS)
    for end, (x, y, width, height) in SCHEMATIC.corners.items():
        outline = {"edgecolor": SIZES, "facecolor": "none", "linestyle": ":", "linewidth": 0.9}
        axis.add_patch(Rectangle((x, y), width, height, **outline))
        place, text = (x + width - 0.08, y + 0.08), rf"{end} corner, $\times$ 2"
        axis.text(*place, text, fontsize=7.5, ha="right", color=SIZES)
    axis.set_xlim(-0.55, 8.7)
    axis.set_ylim(-0.65, 2.65)
