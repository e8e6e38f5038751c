"""Figures 1, 5 and 8: mechanisms in space, beside their graphs; and the flexible truck."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from drawings.look import BLUE, GREEN, ONE, ORANGE, RED, TWO
from vehiclemor.multibody.flexible_truck.frame import Layout
from vehiclemor.parameters import load_parameters
from vehiclemor.registry import component
from vehiclemor.report.figures.theme import Style
from vehiclemor.toml_files import FileSchema, read_toml

GREY, SPRING = "#555555", "#56B4E9"
TEXT: Style = {"fontsize": 7, "ha": "center", "va": "center"}
HALO: Style = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
# Radius of the truck's wheels in m, for the drawing only.
WHEEL = 0.55
# Places (3,) in m by name, and the radius of the wheels.
Points = dict[str, Any]
Drawing = dict[str, Any]


class SchematicsFile(FileSchema):
    """Schema of `schematics.toml`, where the keys of a drawing are explained."""

    colors: dict[str, str]
    drawings: dict[str, Drawing]


def figure_schematic(*, name: str) -> Figure:
    """A mechanism in space, to scale (a), and its graph (b)."""
    file = read_toml(Path(__file__).with_suffix(".toml"), SchematicsFile)
    drawing: Drawing = file.drawings[name] | {"colors": file.colors}
    below, ratio = drawing["graph"]
    figure = Figure(figsize=(TWO, drawing["height"]))
    ratios = {"height_ratios" if below else "width_ratios": [1.0, ratio]}
    shape = (2, 1) if below else (1, 2)
    space, graph = figure.subplots(*shape, gridspec_kw=ratios)
    for axis, title in ((space, "(a)"), (graph, "(b)")):
        axis.set_axis_off()
        axis.set_title(title)
    space.set_aspect("equal")
    plane = _plane(*drawing["view"])
    points = _points(drawing)
    for state in drawing["states"]:
        _draw_bodies(space, drawing, _moved(points, state), plane, state["alpha"])
    _draw_outline(space, drawing, points, plane)
    _draw_graph(graph, drawing)
    legend = dict(zip(*reversed(space.get_legend_handles_labels()), strict=True))
    figure.legend(legend.values(), legend, loc="outside lower center", ncols=4)
    return figure


def _points(drawing: Drawing) -> Points:
    """Hard points of a drawing's model, and those that it declares."""
    points: Points = {}
    if name := drawing.get("model"):
        values = load_parameters(name, component("model", name).parameters).values()
        for point, value in values.items():
            if np.shape(value) == (3,):
                origin = drawing["rear" if point.startswith("rear_") else "front"]
                points[point] = np.add(origin, value)
    return points | {point: np.array(value) for point, value in drawing["points"].items()}


def _moved(points: Points, state: Drawing) -> Points:
    """Points of one state; `schematics.toml` says what is mirrored."""
    moved = points | {name: np.array(value) for name, value in state.get("points", {}).items()}
    if state.get("mirrored"):
        for name, point in moved.items():
            if np.shape(point) == (3,) and " " not in name:
                moved[name] = point * [1.0, -1.0, 1.0]
    return moved


def figure_truck() -> Figure:
    """The ladder frame with its nodes, cab, platform, axles and wheels, to scale."""
    definition = component("model", "flexible_truck")
    values = load_parameters("flexible_truck", definition.parameters).values()
    ladder, plane = Layout(values), _plane(20.0, -58.0)
    figure = Figure(figsize=(ONE, 1.9))
    axis = figure.subplots()
    axis.set_axis_off()
    axis.set_aspect("equal")

    def line(points: Any, **style: Any) -> None:
        axis.plot(*(np.array(points) @ plane).T, **style)

    left, right = ladder.sides
    half, level = values["platform_width"] / 2.0, values["platform_height"]
    ends = [-values["platform_front"], -values["platform_rear"]]
    corners = [(ends[0], half), (ends[1], half), (ends[1], -half), (ends[0], -half)]
    platform = np.array([(x, y, level) for x, y in corners]) @ plane
    axis.fill(*platform.T, color=ORANGE, alpha=0.25, linewidth=0.0, label="payload")
    axles = {"front": 0.0, "rear": -values["wheelbase"]}
    for x in axles.values():
        width = values["wheel_offset"]
        line([(x, width, 0.0), (x, -width, 0.0)], color=RED, linewidth=1.6, label="axle")
        angle = np.linspace(0.0, 2.0 * np.pi, 91)
        for y in (width, -width):
            wheel = np.column_stack(
                [x + WHEEL * np.cos(angle), 0.0 * angle + y, WHEEL * np.sin(angle)]
            )
            line(wheel, color=BLUE, linewidth=1.1, label="wheel")
            side = np.sign(y) * values["front_spring_offset"]
            spring = _zigzag(*(np.array([(x, side, 0.0), (x, side, ladder.height)]) @ plane))
            axis.plot(*spring.T, color=SPRING, linewidth=0.9, label="spring and damper")
    rail = {"color": "black", "linewidth": 1.3, "marker": "o", "markersize": 1.6}
    for y in (left, right):
        line([(x, y, ladder.height) for x in ladder.stations], label="frame", **rail)
    for number in ladder.crossings:
        x = ladder.stations[number]
        line([(x, left, ladder.height), (x, right, ladder.height)], color="black", linewidth=1.0)
    reach, x = values["cab_mount_distance"], values["cab_place"]
    feet = [(x + s * reach, y, ladder.height) for s in (1, -1) for y in (left, right)]
    axis.plot(*(np.array(feet) @ plane).T, "s", color=GREEN, markersize=3, label="cab mount")
    _draw_box(axis, plane, (x - reach, x + reach), 1.1, (ladder.height + 0.1, 2.0))
    legend = dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True))
    figure.legend(legend.values(), legend, loc="outside lower center", ncols=3)
    return figure


def _draw_box(axis: Any, plane: np.ndarray, x: Any, half: float, z: Any) -> None:
    """Walls of a box between two x, two z and both sides."""
    around = [(x[0], half), (x[0], -half), (x[1], -half), (x[1], half)]
    low, high = ([(*corner, level) for corner in around] for level in z)
    walls = [[low[i - 1], low[i], high[i], high[i - 1]] for i in range(4)]
    style: Style = {"facecolor": ("#999999", 0.1), "edgecolor": "black", "linewidth": 0.5}
    for wall in np.array([low, high, *walls]) @ plane:
        axis.fill(*wall.T, **style)


def _plane(elevation: float, azimuth: float) -> np.ndarray:
    """Matrix (3, 2) of the parallel projection onto what is seen from there, angles in degrees."""
    up, turn = np.deg2rad([elevation, azimuth])
    right = [-np.sin(turn), np.cos(turn), 0.0]
    top = [-np.sin(up) * np.cos(turn), -np.sin(up) * np.sin(turn), np.cos(up)]
    return np.array([right, top]).T


def _draw_bodies(
    axis: Any, drawing: Drawing, points: Points, plane: np.ndarray, alpha: float
) -> None:
    """One side, or one position, of the mechanism."""
    colors = drawing["colors"]
    for body, *names in drawing.get("lines", ()):
        corners = np.array([points[name] for name in names]) @ plane
        axis.plot(*corners.T, linewidth=1.0 + alpha, alpha=alpha, color=colors[body])
        axis.fill(*corners.T, alpha=0.25 * alpha, color=colors[body], linewidth=0.0)
    for low, high in drawing.get("springs", ()):
        line = _zigzag(points[low] @ plane, points[high] @ plane)
        axis.plot(*line.T, color=SPRING, linewidth=1.2, label="spring and damper")
    for body, name in drawing["wheels"]:
        spin = points.get("axle_direction", np.array([0.0, 1.0, 0.0]))
        up = np.cross([1.0, 0.0, 0.0], spin)
        up /= np.linalg.norm(up)
        angle = np.linspace(0.0, 2.0 * np.pi, 181)[:, None]
        around = np.cos(angle) * np.cross(spin, up) + np.sin(angle) * up
        circle = (points[name] + points["radius"] * around) @ plane
        axis.plot(*circle.T, color=colors[body], linewidth=1.6 * alpha**0.5, alpha=alpha)
    for text, (marker, *names) in drawing["marks"].items() if alpha == 1.0 else ():
        style = {"color": colors[text], "marker": marker, "linestyle": "none", "label": text}
        places = np.array([points[name] for name in names]) @ plane
        axis.plot(*places.T, markersize=4.0, markeredgecolor="black", **style)


def _zigzag(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Line (n, 2) of a spring between two points (2,) of the plane."""
    along = high - low
    aside = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    parts = [0.0, 0.2, *np.linspace(0.23, 0.77, 10), 0.8, 1.0]
    turns = [0.0, 0.0, *(0.04 * (-1.0) ** np.arange(10)), 0.0, 0.0]
    return low + np.outer(parts, along) + np.outer(turns, aside)


def _draw_outline(axis: Any, drawing: Drawing, points: Points, plane: np.ndarray) -> None:
    """Chassis, axes and sizes."""
    if "box" in drawing:
        half, bottom, top, beyond = drawing["box"]
        ends = points["front left"][0] + beyond, points["rear left"][0] - beyond
        _draw_box(axis, plane, (ends[1], ends[0]), half, (bottom, top))
    arrow = {"arrowstyle": "->", "linewidth": 1.2, "shrinkA": 0.0, "shrinkB": 0.0}
    for name, length in drawing["frame"].items():
        for direction, text in zip(length * np.eye(3), "xyz", strict=True):
            origin, tip = points[name] @ plane, (points[name] + direction) @ plane
            axis.plot(*np.transpose([origin, tip]), color="black", linewidth=1.2)
            axis.annotate("", tip, origin, arrowprops=arrow)
            axis.text(*(tip + 0.2 * (tip - origin)), text, **TEXT)
    for size in drawing.get("sizes", ()):
        ends = np.array([points[end] for end in size["ends"]])
        line = ends + size["away"]
        for pair in zip(ends @ plane, line @ plane, strict=True):
            axis.plot(*np.transpose(pair), color=GREY, linewidth=0.5)
        axis.plot(*(line @ plane).T, color=GREY, linewidth=0.9, marker="|", markersize=5)
        text = size["text"].format(np.linalg.norm(ends[1] - ends[0]))
        axis.text(*((line.mean(axis=0) + size["beside"]) @ plane), text, color=GREY, **TEXT)


def _draw_graph(axis: Any, drawing: Drawing) -> None:
    """Bodies in boxes, joints on the lines between them, closures dashed."""
    axis.set_axis_off()
    for start, end, text in drawing["edges"]:
        ends = np.array([drawing["nodes"][start], drawing["nodes"][end]])
        line = "--" if "closure" in text else "-"
        axis.plot(*ends.T, line, color=GREY, linewidth=1.2, zorder=1)
        axis.text(*ends.mean(axis=0), text, bbox=HALO, zorder=2, **TEXT)
    for body, place in drawing["nodes"].items():
        edge = drawing["colors"][body]
        box = {"boxstyle": "round,pad=0.35", "facecolor": "white", "edgecolor": edge}
        axis.text(*place, body.replace(" ", "\n"), bbox=box, zorder=3, **TEXT)
    for text, (x, y, width, height) in drawing.get("corners", {}).items():
        axis.add_patch(Rectangle((x, y), width, height, edgecolor=GREY, fill=False, linestyle=":"))
        axis.text(x + width - 0.08, y + 0.08, text, **(TEXT | {"ha": "right", "va": "bottom"}))
    axis.margins(0.08, 0.12)
