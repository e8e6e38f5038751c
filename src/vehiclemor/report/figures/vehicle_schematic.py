"""Figure 1: the 14-DOF vehicle drawn from its own geometry, beside its topological graph."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vehiclemor.multibody.independent_suspension import quantities as vehicle
from vehiclemor.multibody.independent_suspension.definition import DEFINITION
from vehiclemor.multibody.independent_suspension.equilibrium import derived
from vehiclemor.multibody.quantities import WHEELS
from vehiclemor.parameters import load_parameters
from vehiclemor.report.figures.graph import draw_graph
from vehiclemor.report.figures.space import (
    CAPTIONS,
    SIZES,
    draw_box,
    draw_frame,
    draw_size,
    draw_spring_damper,
    frame_space,
    rim,
    space_and_graph,
    symbol,
)

COLORS = {"road": "#777777", "chassis": "#000000", "mass": "#D55E00", "wheel": "#0072B2"}
SPRING, DAMPER, AXES = "#009E73", "#CC79A7", "#E69F00"
# Only for the drawing: outline of the sprung body (m) and steering angle (rad).
HALF_WIDTH, BOTTOM, TOP, OVERHANG = 0.45, 0.50, 0.92, 0.15
DRAWN_STEER = np.deg2rad(20.0)


def figure_vehicle() -> Figure:
    """Vehicle at rest in equilibrium, in the chassis frame moved to the road, and the graph."""
    parameters = load_parameters(DEFINITION.name, DEFINITION.parameters)
    p = {name: float(parameters[name]) for name in vehicle.PARAMETERS}
    places = (-0.02, 0.03, 0.68, 1.0), (0.65, 0.10, 0.35, 0.85)
    figure, space, graph = space_and_graph(3.2, *places)
    _draw_vehicle(space, p)
    _draw_sizes(space, p)
    frame_space(space, (-2.4, -1.3, 0.0), (2.4, 1.0, 1.2), view=(24.0, -50.0), zoom=1.55)
    _draw_vehicle_graph(graph)
    handles, labels = space.get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower left", ncols=5, fontsize=7.5)
    figure.text(0.02, 0.94, "(a)")
    whole = 1e3 * (p["front_axle_distance"] - derived(p).sprung_distance[0])
    note = f"a, b: to the CG of the whole car, {whole:.0f} mm behind that of the sprung body"
    figure.text(0.07, 0.945, note, fontsize=6.5, color=SIZES)
    figure.text(0.65, 0.94, "(b)")
    return figure


def wheel_centres(p: dict[str, float]) -> np.ndarray:
    """Wheel centres (4, 3) in m at zero travel, x and y from the sprung CG, z from the road."""
    d = derived(p)
    return np.array(
        [
            (
                d.sprung_distance[0] if front else -d.sprung_distance[1],
                (0.5 if left else -0.5) * p["front_track" if front else "rear_track"],
                p["sprung_height"] - d.depth[0 if front else 1],
            )
            for front, left in zip(vehicle.FRONT, vehicle.LEFT, strict=True)
        ]
    )


def _draw_vehicle(axis: Any, p: dict[str, float]) -> None:
    centres = wheel_centres(p)
    ends = centres[0, 0] + OVERHANG, centres[2, 0] - OVERHANG
    draw_box(axis, ends, HALF_WIDTH, (BOTTOM, TOP))
    for number, (centre, front) in enumerate(zip(centres, vehicle.FRONT, strict=True)):
        x, y, z = centre
        steer = DRAWN_STEER if front else 0.0
        first = number == 0
        spin = np.array([-np.sin(steer), np.cos(steer), 0.0])
        style = {"color": COLORS["wheel"], "linewidth": 1.8, "label": "wheel" if first else None}
        axis.plot(*rim(centre, spin, p["tire_radius"]).T, **style)
        inner = np.sign(y) * HALF_WIDTH
        axis.plot([x, x], [inner, y], [TOP, TOP], color="black", linewidth=1.4)
        # Prismatic joint along the chassis z axis.
        labels = ("spring", "damper") if first else (None, None)
        draw_spring_damper(axis, centre, np.array([x, y, TOP]), (SPRING, DAMPER), labels)
        name = "lumped mass" if first else None
        axis.plot(x, y, z, "s", color=COLORS["mass"], markersize=6, label=name, linestyle="none")
        if front:
            _steering(axis, centre)
    origin = np.array([0.0, 0.0, p["sprung_height"]])
    draw_frame(axis, origin, AXES, "CG of the sprung body")


def _steering(axis: Any, centre: np.ndarray) -> None:
    """Steering angle in the plane of the wheel centres."""
    x, y, z = centre
    angle = np.linspace(0.0, DRAWN_STEER, 15)
    arc = np.array([x + 0.5 * np.cos(angle), y + 0.5 * np.sin(angle), np.full(15, z)])
    style = {"color": SIZES, "linewidth": 0.9}
    axis.plot(*arc, **style)
    axis.plot([x, x + 0.6], [y, y], [z, z], linestyle="--", **style)
    steered = 0.6 * np.array([np.cos(DRAWN_STEER), np.sin(DRAWN_STEER)])
    axis.plot([x, x + steered[0]], [y, y + steered[1]], [z, z], **style)
    middle = 0.66 * np.array([np.cos(DRAWN_STEER / 2), np.sin(DRAWN_STEER / 2)])
    axis.text(x + middle[0], y + middle[1], z, r"$\delta$", **CAPTIONS)


def _draw_sizes(axis: Any, p: dict[str, float]) -> None:
    """Dimensions on the road with their values, each label beside its line."""
    front_left, front_right, rear_left, rear_right = wheel_centres(p) * [1.0, 1.0, 0.0]
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
    nodes, colors = {"road": (1.5, 3.1), "chassis": (1.5, 2.1)}, dict(COLORS)
    free = f"free, {len(names) - 8} DOF\n" + ", ".join(names[:-8])
    edges = [("road", "chassis", free)]
    for number, wheel in enumerate(WHEELS):
        mass, tire = f"mass {wheel}", f"wheel {wheel}"
        nodes |= {mass: (float(number), 0.95), tire: (float(number), 0.0)}
        colors |= {mass: COLORS["mass"], tire: COLORS["wheel"]}
        edges.append(("chassis", mass, f"P {names[6 + number]}"))
        edges.append((mass, tire, f"R {names[10 + number]}"))
    draw_graph(axis, nodes, edges, colors)
    axis.set_xlim(-0.45, 3.45)
    axis.set_ylim(-0.3, 3.3)
