"""Figures 1, 5 and 8: the paper's mechanisms drawn from their models, beside their graphs."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from vehiclemor.multibody.high_fidelity import quantities as high_fidelity
from vehiclemor.multibody.high_fidelity.equilibrium import wheel_places
from vehiclemor.multibody.independent_suspension import quantities as vehicle
from vehiclemor.multibody.independent_suspension.equilibrium import derived
from vehiclemor.multibody.quantities import WHEELS
from vehiclemor.parameters import load_parameters
from vehiclemor.registry import component
from vehiclemor.report.figures.schematic_parts import (
    CAPTIONS,
    SCHEMATICS,
    SIZES,
    Outline,
    draw_frame,
    draw_graph,
    draw_line,
    draw_size,
    draw_spring_damper,
    draw_wheel,
    frame_space,
    plate,
    space_and_graph,
    symbol,
)
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.build import build

COLORS = SCHEMATICS.suspension.colors | SCHEMATICS.high_fidelity.colors
MASS, WHEEL, SPRING, DAMPER, AXES = "#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00"
SPRING_DAMPER = "#56B4E9"
# Only for the drawings, in m and rad: outlines of the bodies, the suspension's wheel (the kinematic
# model has none), half the length of a rear pivot, and the steering angle.
SPRUNG, CHASSIS = Outline(0.45, 0.50, 0.92, 0.15), Outline(0.38, 0.16, 0.68, 0.30)
WHEEL_RADIUS, PIVOT, STEER = 0.30, 0.07, np.deg2rad(20.0)
# Beginnings of the names of the front suspension's points, and its pivots.
_FRONT = ("upper_", "lower_", "tie_rod_", "wheel_", "front_spring_")
_PIVOTS = [f"{arm}_arm_{end}_pivot" for arm in ("upper", "lower") for end in ("front", "rear")]
LEFT = np.array([0.0, 1.0, 0.0])
Points = Mapping[str, np.ndarray]


def figure_vehicle() -> Figure:
    """Figure 1: the 14-DOF vehicle at rest in equilibrium, moved to the road, and its graph."""
    name = "independent_suspension_vehicle"
    parameters = load_parameters(name, component("model", name).parameters)
    p = {name: float(parameters[name]) for name in vehicle.PARAMETERS}
    places = (-0.02, 0.03, 0.68, 1.0), (0.65, 0.10, 0.35, 0.85)
    figure, space, graph = space_and_graph(3.2, *places)
    _draw_vehicle(space, p)
    _draw_vehicle_sizes(space, p)
    frame_space(space, (-2.4, -1.3, 0.0), (2.4, 1.0, 1.2), view=(24.0, -50.0), zoom=1.55)
    _draw_vehicle_graph(graph)
    figure.legend(*space.get_legend_handles_labels(), loc="lower left", ncols=5, fontsize=7.5)
    whole = 1e3 * (p["front_axle_distance"] - derived(p).sprung_distance[0])
    note = f"a, b: to the CG of the whole car, {whole:.0f} mm behind that of the sprung body"
    figure.text(0.07, 0.945, note, fontsize=6.5, color=SIZES)
    figure.text(0.02, 0.94, "(a)")
    figure.text(0.65, 0.94, "(b)")
    return figure


def _wheel_centres(p: dict[str, float]) -> np.ndarray:
    """Wheel centres (4, 3) in m at zero travel, x and y from the sprung CG, z from the road."""
    d = derived(p)
    ends = {True: ("front_track", 1.0, 0), False: ("rear_track", -1.0, 1)}
    centres = []
    for front, left in zip(vehicle.FRONT, vehicle.LEFT, strict=True):
        track, sign, end = ends[bool(front)]
        y = (0.5 if left else -0.5) * p[track]
        centres.append((sign * d.sprung_distance[end], y, p["sprung_height"] - d.depth[end]))
    return np.array(centres)


def _draw_vehicle(axis: Any, p: dict[str, float]) -> None:
    centres = _wheel_centres(p)
    SPRUNG.draw(axis, centres[0, 0], centres[2, 0])
    for number, (centre, front) in enumerate(zip(centres, vehicle.FRONT, strict=True)):
        x, y, z = centre
        steer = STEER if front else 0.0
        names = ("wheel", "spring", "damper", "lumped mass") if number == 0 else (None,) * 4
        spin = np.array([-np.sin(steer), np.cos(steer), 0.0])
        draw_wheel(axis, centre, spin, p["tire_radius"], color=WHEEL, label=names[0])
        top = np.array([x, y, SPRUNG.top])
        inner = np.array([x, np.sign(y) * SPRUNG.half, SPRUNG.top])
        draw_line(axis, [inner, top], color="black", linewidth=1.4)
        # Prismatic joint along the chassis z axis.
        draw_spring_damper(axis, centre, top, (SPRING, DAMPER), names[1:3])
        axis.plot(x, y, z, "s", color=MASS, markersize=6, label=names[3], linestyle="none")
        if front:
            _draw_steering(axis, centre)
    draw_frame(axis, np.array([0.0, 0.0, p["sprung_height"]]), AXES, "CG of the sprung body")


def _draw_steering(axis: Any, centre: np.ndarray) -> None:
    """Steering angle in the plane of the wheel centres."""

    def ahead(angle: float, length: float) -> np.ndarray:
        return centre + length * np.array([np.cos(angle), np.sin(angle), 0.0])

    style = {"color": SIZES, "linewidth": 0.9}
    draw_line(axis, [ahead(angle, 0.5) for angle in np.linspace(0.0, STEER, 15)], **style)
    draw_line(axis, [centre, ahead(0.0, 0.6)], linestyle="--", **style)
    draw_line(axis, [centre, ahead(STEER, 0.6)], **style)
    axis.text(*ahead(STEER / 2, 0.66), r"$\delta$", **CAPTIONS)


def _draw_vehicle_sizes(axis: Any, p: dict[str, float]) -> None:
    """Dimensions on the road with their values, each label beside its line."""
    front_left, front_right, rear_left, rear_right = _wheel_centres(p) * [1.0, 1.0, 0.0]
    whole = front_right - [p["front_axle_distance"], 0.0, 0.0]
    rear = np.array([rear_right[0], front_right[1], 0.0])
    side, above = [0.0, -0.55, 0.0], np.array([0.0, 0.0, p["sprung_height"]])
    for ends, away, label_at, label in (
        ((front_right, whole), side, [-0.1, -0.35, 0.0], "$a$ = {}"),
        ((whole, rear), side, [-0.1, -0.35, 0.0], "$b$ = {}"),
        ((front_left, front_right), [0.75, 0.0, 0.0], [0.5, -0.3, 0.0], "$T_f$ = {}"),
        ((rear_left, rear_right), [0.35, 0.0, 0.0], [0.31, 0.0, -0.09], "$T_r$ = {}"),
        ((0.0 * above, above), [0.0, 0.0, 0.0], [-0.48, 0.0, -0.50], "$h_s$ = {}"),
    ):
        draw_size(axis, ends, away, label_at, label)


def _draw_vehicle_graph(axis: Axes) -> None:
    names = [symbol(quantity.name) for quantity in vehicle.COORDINATES]
    nodes = {"road": [1.5, 3.1], "chassis": [1.5, 2.1]}
    colors = {"road": "#777777", "chassis": "#000000"}
    free = f"free, {len(names) - 8} DOF\n" + ", ".join(names[:-8])
    edges = [("road", "chassis", free)]
    for number, wheel in enumerate(WHEELS):
        mass, tire = f"mass {wheel}", f"wheel {wheel}"
        nodes |= {mass: [float(number), 0.95], tire: [float(number), 0.0]}
        colors |= {mass: MASS, tire: WHEEL}
        edges.append(("chassis", mass, f"P {names[6 + number]}"))
        edges.append((mass, tire, f"R {names[10 + number]}"))
    draw_graph(axis, nodes, edges, colors, (-0.45, 3.45), (-0.3, 3.3))


def figure_suspension() -> Figure:
    """Figure 5: the suspension at design, at +-0.1 m of travel, and its graph."""
    model = build("double_wishbone")
    assert isinstance(model, AlgebraicModel)
    figure, space, graph = space_and_graph(4.1, (0.0, 0.17, 0.5, 0.76), (0.52, 0.14, 0.48, 0.76))
    for travel, alpha in ((-0.1, 0.25), (0.1, 0.25), (0.0, 1.0)):
        moving = model.joints_at(model.solve([travel, 0.0]))
        at = {**model.parameters.values(), **moving}
        _draw_linkage(space, at, alpha, named=alpha == 1.0)
        rack = [at["tie_rod_inner"] + aside * LEFT for aside in (-0.12, 0.03)]
        label = "rack" if alpha == 1.0 else None
        draw_line(space, rack, color=COLORS["rack"], linewidth=2.0, alpha=alpha, label=label)
        spin = moving["axle_direction"]
        draw_wheel(
            space,
            at["wheel_centre"],
            spin,
            WHEEL_RADIUS,
            color="#999999",
            linewidth=1.0,
            alpha=alpha,
        )
    pivots = np.transpose([at[name] for name in _PIVOTS])
    style = {"color": COLORS["chassis"], "markersize": 4.5, "label": "chassis pivot"}
    space.plot(*pivots, "s", **style)
    for name, limits in zip("xyz", ((-0.375, 0.375), (0.3, 0.9), (-0.5, 0.35)), strict=True):
        getattr(space, f"set_{name}label")(f"{name} (m)", labelpad=0)
        getattr(space, f"set_{name}lim")(*limits)
    space.zaxis.set_rotate_label(False)
    space.zaxis.label.set_rotation(90.0)
    space.set_box_aspect((0.75, 0.6, 0.85), zoom=0.95)
    space.view_init(elev=14, azim=28)
    space.tick_params(pad=0, labelsize=7)
    space.locator_params(nbins=4)
    schematic = SCHEMATICS.suspension
    draw_graph(graph, schematic.nodes, schematic.edges, COLORS, (-0.45, 3.65), (-0.35, 2.35))
    figure.legend(*space.get_legend_handles_labels(), loc="lower left", ncols=3, fontsize=7.5)
    figure.text(0.02, 0.94, "(a)")
    figure.text(0.55, 0.94, "(b)")
    figure.text(0.07, 0.94, "faint: wheel travel of -0.1 and +0.1 m", fontsize=7, color=SIZES)
    return figure


def _draw_linkage(axis: Any, at: Points, alpha: float = 1.0, *, named: bool) -> None:
    """Bodies of one front suspension, from the places of its points."""
    upper, lower, outer = at["upper_ball_joint"], at["lower_ball_joint"], at["tie_rod_outer"]
    bodies = {
        "upper arm": [at["upper_arm_front_pivot"], upper, at["upper_arm_rear_pivot"]],
        "lower arm": [at["lower_arm_front_pivot"], lower, at["lower_arm_rear_pivot"]],
        "wheel carrier": [upper, lower, outer, upper],
        "tie rod": [at["tie_rod_inner"], outer],
    }
    width = 2.0 if alpha == 1.0 else 1.0
    for name, points in bodies.items():
        style = {"color": COLORS[name], "alpha": alpha, "linewidth": width}
        draw_line(axis, points, label=name if named else None, **style)
        if len(points) > 2:
            plate(axis, points[:3], COLORS[name], 0.25 * alpha)
    axle = [(upper + lower) / 2.0, at["wheel_centre"]]
    draw_line(axis, axle, color=COLORS["wheel carrier"], linewidth=1.4, alpha=alpha)
    if alpha == 1.0:
        joints = np.transpose([upper, lower, outer, at["tie_rod_inner"]])
        axis.plot(*joints, "o", color="white", markeredgecolor="black", markersize=4.0)


def figure_high_fidelity() -> Figure:
    """Figure 8: the high-fidelity vehicle at rest in equilibrium, and its graph."""
    name = "high_fidelity_vehicle"
    parameters = load_parameters(name, component("model", name).parameters)
    p = {name: parameters[name] for name in high_fidelity.PARAMETERS}
    # As large as the figure: it is square, and cuts off what stands out of it.
    figure, space, graph = space_and_graph(6.7, (0.0, 0.23, 1.0, 1.0), (0.01, 0.01, 0.98, 0.35))
    space.patch.set_visible(False)
    _draw_high_fidelity(space, p, rest_height(p))
    frame_space(space, (-1.9, -0.9, 0.0), (1.9, 0.9, 0.7), view=(22.0, -40.0), zoom=0.87)
    handles, labels = space.get_legend_handles_labels()
    legend = SCHEMATICS.high_fidelity.legend
    drawn = [handles[labels.index(name)] for name in legend]
    figure.legend(drawn, legend, loc="center", bbox_to_anchor=(0.5, 0.45), ncols=5, fontsize=7.5)
    _draw_high_fidelity_graph(graph)
    coordinates, constraints = len(high_fidelity.COORDINATES), len(high_fidelity.CONSTRAINTS)
    free = f"{coordinates - constraints} degrees of freedom"
    figure.text(0.02, 0.97, "(a)")
    figure.text(0.02, 0.385, f"(b) {coordinates} coordinates, {constraints} constraints: {free}")
    return figure


def rest_height(p: Mapping[str, Any]) -> float:
    """Height of the chassis' centre of mass above the road at rest, in m."""
    # Every tire carries a quarter of the weight: front and rear deflections differ by 0.3 mm from
    # each other, and the pitch of 0.1 mrad from 0, which no drawing can show.
    masses = [p[name] for name in high_fidelity.PARAMETERS if name.endswith("_mass")]
    # All bodies but the chassis come in pairs.
    mass = 2.0 * sum(masses) - p["chassis_mass"]
    deflection = mass * p["gravity"] / (4.0 * p["tire_stiffness"])
    return p["tire_radius"] - deflection - wheel_places(p)[0][2]


def _draw_high_fidelity(axis: Any, p: Mapping[str, Any], height: float) -> None:
    """Bodies of both sides at their design position, from the road upwards, and dimensions."""
    up = np.array([0.0, 0.0, height])
    front, rear = (place + up for place in wheel_places(p))
    CHASSIS.draw(axis, front[0], rear[0], edge=0.4)
    draw_frame(axis, up, "#000000", "CG of the chassis")
    for side in (1.0, -1.0):
        mirror = np.array([1.0, side, 1.0])
        named = side == 1.0
        fronts = {
            name: mirror * (p[name] - p["wheel_centre"] + front)
            for name, declared in high_fidelity.PARAMETERS.items()
            if declared.size == 3 and declared.unit == "m" and name.startswith(_FRONT)
        }
        _draw_linkage(axis, fronts, named=named)
        ends = fronts["front_spring_arm_point"], fronts["front_spring_chassis_point"]
        _draw_strut(axis, *ends, "spring and damper" if named else None)
        for name in _PIVOTS:
            first = named and name == "upper_arm_front_pivot"
            _mount(axis, fronts[name], "fixed to the chassis" if first else None)
        names = ("rear_arm_pivot", "rear_spring_arm_point", "rear_spring_chassis_point")
        pivot, seat, high = (mirror * (p[name] + rear) for name in names)
        style = {"color": COLORS["trailing arm"], "label": "trailing arm" if named else None}
        draw_line(axis, [pivot, seat, mirror * rear], linewidth=2.4, **style)
        draw_line(
            axis, [pivot - PIVOT * LEFT, pivot + PIVOT * LEFT], color=style["color"], linewidth=4.0
        )
        _draw_strut(axis, seat, high)
        _mount(axis, pivot)
        for centre in (front, rear):
            label = "wheel" if named and centre is front else None
            style = {"color": COLORS["front wheel"], "label": label}
            draw_wheel(axis, mirror * centre, LEFT, p["tire_radius"], **style)
    inner = p["tie_rod_inner"] - p["wheel_centre"] + front
    rack = [inner, inner * [1.0, -1.0, 1.0]]
    draw_line(axis, rack, color=COLORS["rack"], linewidth=2.4, label="rack")
    right, left, back = front * [1.0, -1.0, 0.0], front * [1.0, 1.0, 0.0], rear * [1.0, -1.0, 0.0]
    draw_size(axis, (right, back), [0.0, -0.45, 0.0], [-0.15, -0.30, 0.0], "$l$ = {}")
    draw_size(axis, (left, right), [0.65, 0.0, 0.0], [0.35, -0.15, 0.0], "$T$ = {}")
    draw_size(axis, (0.0 * up, up), [0.0, 0.0, 0.0], [-0.45, 0.0, -height], "$h$ = {}")


def _draw_strut(axis: Any, low: np.ndarray, high: np.ndarray, label: str | None = None) -> None:
    colors = SPRING_DAMPER, SPRING_DAMPER
    draw_spring_damper(axis, low, high, colors, (label, None), size=0.6)
    _mount(axis, high)


def _mount(axis: Any, place: np.ndarray, label: str | None = None) -> None:
    """Point of the chassis that carries a joint, and its link to the drawn outline."""
    inner = np.array([place[0], np.sign(place[1]) * CHASSIS.half, place[2]])
    draw_line(axis, [inner, place], color=COLORS["chassis"], linewidth=1.2)
    style = {"color": COLORS["chassis"], "markersize": 3.5, "linestyle": "none", "label": label}
    axis.plot(*place, "s", **style)


def _draw_high_fidelity_graph(axis: Axes) -> None:
    """One front and one rear corner, as the others are the same."""
    schematic = SCHEMATICS.high_fidelity
    names = [quantity.name.removesuffix("_FL") for quantity in high_fidelity.COORDINATES]
    symbols: dict[str, object] = {name: symbol(name) for name in names}
    symbols["free"] = ", ".join(map(symbol, names[:6]))
    symbols["equations"] = len(high_fidelity.CONSTRAINTS) // 4
    edges = [(start, end, text.format(**symbols)) for start, end, text in schematic.edges]
    draw_graph(axis, schematic.nodes, edges, COLORS, (-0.55, 8.7), (-0.65, 2.65))
    for end, (x, y, width, height) in schematic.corners.items():
        outline = {"edgecolor": SIZES, "facecolor": "none", "linestyle": ":", "linewidth": 0.9}
        axis.add_patch(Rectangle((x, y), width, height, **outline))
        place, text = (x + width - 0.08, y + 0.08), rf"{end} corner, $\times$ 2"
        axis.text(*place, text, fontsize=7.5, ha="right", color=SIZES)
