"""Figures 1, 5 and 8: the paper's mechanisms drawn from their models, beside their graphs."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from pydantic import Field

from vehiclemor.multibody.high_fidelity.equilibrium import wheel_places
from vehiclemor.multibody.independent_suspension.equilibrium import derived
from vehiclemor.parameters import load_parameters
from vehiclemor.registry import component
from vehiclemor.report.figures.theme import Style
from vehiclemor.resources import data_folder
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.build import build
from vehiclemor.toml_files import FileSchema, read_toml

GREY, SPRING = "#555555", "#56B4E9"
TEXT: Style = {"fontsize": 7.5, "ha": "center", "va": "center"}
HALO: Style = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
# Only for the drawings, in m: radius of the suspension's wheel, upper ends of the 14-DOF vehicle's
# springs.
WHEEL_RADIUS, SPRING_TOP = 0.30, 0.92
LEFT, UP = np.eye(3)[1:]
Points = dict[str, np.ndarray]


class Size(FileSchema):
    """Distance of two points, as a line and its text."""

    text: str
    ends: list[str]
    away: list[float]
    beside: list[float]


class Schematic(FileSchema):
    """One drawing; the keys are explained in `data/figures/schematics.toml`."""

    height: float
    space: list[float]
    graph: list[float]
    low: list[float]
    high: list[float]
    view: list[float]
    zoom: float
    frame: dict[str, float]
    box: list[float] = Field(default_factory=list)
    lines: list[list[str]] = Field(default_factory=list)
    springs: list[list[str]] = Field(default_factory=list)
    wheels: list[list[str]]
    marks: dict[str, list[str]]
    sizes: list[Size] = Field(default_factory=list)
    nodes: dict[str, list[float]]
    edges: list[list[str]]
    corners: dict[str, list[float]] = Field(default_factory=dict)


class SchematicsFile(FileSchema):
    """Schema of `data/figures/schematics.toml`."""

    colors: dict[str, str]
    drawings: dict[str, Schematic]


def _vehicle() -> list[tuple[Points, float]]:
    """The 14-DOF vehicle at rest in equilibrium, its left and its right side."""
    p = _parameters("independent_suspension_vehicle")
    d = derived(p)
    places = zip(d.sprung_distance, (1.0, -1.0), ("front", "rear"), d.depth, strict=True)
    points: Points = {}
    for x, sign, end, depth in places:
        place = np.array([sign * x, p[f"{end}_track"] / 2.0, 0.0])
        points[f"{end}_wheel_centre"] = place + (p["sprung_height"] - depth) * UP
        points[f"{end}_spring_top"] = place + SPRING_TOP * UP
    return _both_sides(points, p["sprung_height"], p["tire_radius"], p["front_axle_distance"])


def _high_fidelity() -> list[tuple[Points, float]]:
    """The high-fidelity vehicle at its design position, from the road upwards."""
    p = _parameters("high_fidelity_vehicle")
    # Every tire carries a quarter of the weight: front and rear deflections differ by 0.3 mm from
    # each other, and the pitch of 0.1 mrad from 0, which no drawing can show.
    masses = [value for name, value in p.items() if name.endswith("_mass")]
    # All bodies but the chassis come in pairs.
    mass = 2.0 * sum(masses) - p["chassis_mass"]
    deflection = mass * p["gravity"] / (4.0 * p["tire_stiffness"])
    height = p["tire_radius"] - deflection - wheel_places(p)[0][2]
    front, rear = (place + height * UP for place in wheel_places(p))
    points = {
        name: value + (rear if name.startswith("rear_") else front - p["wheel_centre"])
        for name, value in p.items()
        if np.shape(value) == (3,)
    }
    points |= {"front_wheel_centre": front, "rear_wheel_centre": rear}
    points["rack_end"] = points["tie_rod_inner"] * [1.0, 0.0, 1.0]
    return _both_sides(points, height, p["tire_radius"], 0.0)


def _suspension() -> list[tuple[Points, float]]:
    """The suspension at -0.1 and 0.1 m of travel, faint, and at its design position."""
    model = build("double_wishbone")
    assert isinstance(model, AlgebraicModel)
    fixed: Points = {**model.parameters.values(), "radius": np.array(WHEEL_RADIUS)}
    fixed |= {"frame": np.array([0.2, 0.3, -0.15])}
    states = []
    for travel, alpha in ((-0.1, 0.25), (0.1, 0.25), (0.0, 1.0)):
        moving = model.joints_at(model.solve([travel, 0.0]))
        rack = {"rack_end": moving["tie_rod_inner"] - 0.12 * LEFT}
        states.append(({**fixed, **moving, **rack}, alpha))
    return states


STATES: Mapping[str, Callable[[], list[tuple[Points, float]]]] = {
    "vehicle": _vehicle,
    "suspension": _suspension,
    "high_fidelity": _high_fidelity,
}


def _parameters(model: str) -> dict[str, Any]:
    return load_parameters(model, component("model", model).parameters).values()


def _both_sides(
    points: Points, height: float, radius: float, behind: float
) -> list[tuple[Points, float]]:
    """Left points and their mirror images, with points on the road and the centre of mass.

    Parameters
    ----------
    height, radius
        Of the centre of mass above the road, and of the tires, in m.
    behind
        From the front axle to the centre of mass of the whole car in m.
    """
    road = {
        f"{end} {side}": points[f"{end}_wheel_centre"] * [1.0, sign, 0.0]
        for end in ("front", "rear")
        for side, sign in (("left", 1.0), ("right", -1.0))
    }
    road |= {"whole right": road["front right"] - [behind, 0.0, 0.0], "below cg": np.zeros(3)}
    road |= {"cg": height * UP, "radius": np.array(radius)}
    mirrored = {name: place * [1.0, -1.0, 1.0] for name, place in points.items()}
    return [(points | road, 1.0), (mirrored | road, 1.0)]


def figure_schematic(*, name: str) -> Figure:
    """A mechanism in space, to scale (a), and its graph (b)."""
    file = read_toml(data_folder() / "figures" / "schematics.toml", SchematicsFile)
    drawing, states = file.drawings[name], STATES[name]()
    # Placed by hand: the style's automatic layout can't deal with axes in space.
    figure = Figure(figsize=(6.7, drawing.height))
    figure.set_layout_engine("none")
    space = figure.add_axes(drawing.space, projection="3d")
    _frame(space, drawing)
    for points, alpha in states:
        _draw_bodies(space, drawing, points, file.colors, alpha)
    _draw_outline(space, drawing, states[0][0])
    graph = figure.add_axes(drawing.graph)
    _draw_graph(graph, drawing, file.colors)
    legend = dict(zip(*reversed(space.get_legend_handles_labels()), strict=True))
    figure.legend(legend.values(), legend, loc="lower left", ncols=4, fontsize=7.5)
    left, bottom, _, height = drawing.graph
    figure.text(0.02, 0.98, "(a)", va="top")
    figure.text(left + 0.02, min(0.98, bottom + height), "(b)", va="top")
    return figure


def _frame(axis: Any, drawing: Schematic) -> None:
    axis.set_axis_off()
    axis.patch.set_visible(False)
    axis.set_proj_type("ortho")
    for name, start, end in zip("xyz", drawing.low, drawing.high, strict=True):
        getattr(axis, f"set_{name}lim")(start, end)
    axis.set_box_aspect(tuple(np.subtract(drawing.high, drawing.low)), zoom=drawing.zoom)
    axis.view_init(*drawing.view)


def _draw_bodies(
    axis: Any, drawing: Schematic, points: Points, colors: Mapping[str, str], alpha: float
) -> None:
    """One side, or one position, of the mechanism."""
    for body, *names in drawing.lines:
        corners = [points[name] for name in names]
        color = colors[body]
        axis.plot(*np.transpose(corners), linewidth=1.0 + alpha, alpha=alpha, color=color)
        if len(corners) > 2:
            face: Style = {"color": color, "alpha": 0.25 * alpha, "linewidth": 0.0}
            axis.add_collection3d(Poly3DCollection([corners], **face))
    for low, high in drawing.springs:
        line = _zigzag(points[low], points[high])
        axis.plot(*line, color=SPRING, linewidth=1.2, label="spring and damper")
    for body, name in drawing.wheels:
        spin = points.get("axle_direction", LEFT)
        up = np.cross([1.0, 0.0, 0.0], spin)
        up /= np.linalg.norm(up)
        angle = np.linspace(0.0, 2.0 * np.pi, 181)[:, None]
        around = np.cos(angle) * np.cross(spin, up) + np.sin(angle) * up
        circle = points[name] + points["radius"] * around
        axis.plot(*circle.T, color=colors[body], linewidth=1.6 * alpha**0.5, alpha=alpha)
    for text, (marker, *names) in drawing.marks.items() if alpha == 1.0 else ():
        style = {"color": colors[text], "marker": marker, "linestyle": "none", "label": text}
        places = np.transpose([points[name] for name in names])
        axis.plot(*places, markersize=4.0, markeredgecolor="black", **style)


def _zigzag(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Line (3, n) of a spring between two points (3,) in m."""
    along = high - low
    aside = np.array([1.0, 0.0, 0.0]) - along[0] / (along @ along) * along
    parts = [0.0, 0.2, *np.linspace(0.23, 0.77, 10), 0.8, 1.0]
    turns = [0.0, 0.0, *(0.05 * (-1.0) ** np.arange(10)), 0.0, 0.0]
    return (low + np.outer(parts, along) + np.outer(turns, aside)).T


def _draw_outline(axis: Any, drawing: Schematic, points: Points) -> None:
    """Chassis, axes and sizes."""
    if drawing.box:
        half, bottom, top, beyond = drawing.box
        ends = points["front left"][0] + beyond, points["rear left"][0] - beyond
        around = [(ends[i], half * s) for i, s in ((0, 1.0), (0, -1.0), (1, -1.0), (1, 1.0))]
        low, high = ([(*corner, z) for corner in around] for z in (bottom, top))
        walls = [[low[i - 1], low[i], high[i], high[i - 1]] for i in range(4)]
        style: Style = {"facecolor": ("#999999", 0.1), "edgecolor": "black", "linewidth": 0.5}
        axis.add_collection3d(Poly3DCollection([low, high, *walls], **style))
    style = {"color": "black", "linewidth": 1.2, "arrow_length_ratio": 0.2}
    for name, length in drawing.frame.items():
        for arrow, text in zip(length * np.eye(3), "xyz", strict=True):
            axis.quiver(*points[name], *arrow, **style)
            axis.text(*(points[name] + 1.2 * arrow), text, **TEXT)
    for size in drawing.sizes:
        ends = np.array([points[end] for end in size.ends])
        line = ends + size.away
        for pair in zip(ends, line, strict=True):
            axis.plot(*np.transpose(pair), color=GREY, linewidth=0.5)
        axis.plot(*line.T, color=GREY, linewidth=0.9, marker="|", markersize=5)
        text = size.text.format(np.linalg.norm(ends[1] - ends[0]))
        axis.text(*(line.mean(axis=0) + size.beside), text, color=GREY, **TEXT)
    for artist in axis.get_children():
        artist.set_clip_on(False)


def _draw_graph(axis: Axes, drawing: Schematic, colors: Mapping[str, str]) -> None:
    """Bodies in boxes, joints on the lines between them, closures dashed."""
    axis.set_axis_off()
    for start, end, text in drawing.edges:
        ends = np.array([drawing.nodes[start], drawing.nodes[end]])
        line = "--" if "closure" in text else "-"
        axis.plot(*ends.T, line, color=GREY, linewidth=1.2, zorder=1)
        axis.text(*ends.mean(axis=0), text, bbox=HALO, zorder=2, **TEXT)
    for body, place in drawing.nodes.items():
        box = {"boxstyle": "round,pad=0.35", "facecolor": "white", "edgecolor": colors[body]}
        axis.text(*place, body.replace(" ", "\n"), bbox=box, zorder=3, **TEXT)
    for text, (x, y, width, height) in drawing.corners.items():
        axis.add_patch(Rectangle((x, y), width, height, edgecolor=GREY, fill=False, linestyle=":"))
        axis.text(x + width - 0.08, y + 0.08, text, **(TEXT | {"ha": "right", "va": "bottom"}))
    axis.margins(0.05, 0.12)
