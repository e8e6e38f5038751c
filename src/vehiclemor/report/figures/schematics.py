"""Figures 1, 5 and 8: the paper's mechanisms in space, beside their graphs."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from vehiclemor.report.figures.theme import Style
from vehiclemor.resources import data_folder
from vehiclemor.toml_files import FileSchema, read_toml

GREY, SPRING = "#555555", "#56B4E9"
TEXT: Style = {"fontsize": 7.5, "ha": "center", "va": "center"}
HALO: Style = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
# Places (3,) in m by name, and the radius of the wheels.
Points = dict[str, Any]
Drawing = dict[str, Any]


class SchematicsFile(FileSchema):
    """Schema of `data/figures/schematics.toml`, where the keys of a drawing are explained."""

    colors: dict[str, str]
    drawings: dict[str, Drawing]


def figure_schematic(*, name: str) -> Figure:
    """A mechanism in space, to scale (a), and its graph (b)."""
    file = read_toml(data_folder() / "figures" / "schematics.toml", SchematicsFile)
    drawing: Drawing = file.drawings[name] | {"colors": file.colors}
    below, ratio = drawing["graph"]
    figure = Figure(figsize=(6.7, drawing["height"]))
    ratios = {"height_ratios" if below else "width_ratios": [1.0, ratio]}
    shape = (2, 1) if below else (1, 2)
    space, graph = figure.subplots(*shape, gridspec_kw=ratios)
    for axis, title in ((space, "(a)"), (graph, "(b)")):
        axis.set_axis_off()
        axis.set_title(title)
    space.set_aspect("equal")
    plane = _plane(*drawing["view"])
    states = [
        ({key: np.array(place) for key, place in state["points"].items()}, state["alpha"])
        for state in drawing["states"]
    ]
    for points, alpha in states:
        _draw_bodies(space, drawing, points, plane, alpha)
    _draw_outline(space, drawing, states[0][0], plane)
    _draw_graph(graph, drawing)
    legend = dict(zip(*reversed(space.get_legend_handles_labels()), strict=True))
    figure.legend(legend.values(), legend, loc="outside lower center", ncols=4)
    return figure


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
        around = [(ends[i], half * s) for i, s in ((0, 1.0), (0, -1.0), (1, -1.0), (1, 1.0))]
        low, high = ([(*corner, z) for corner in around] for z in (bottom, top))
        walls = [[low[i - 1], low[i], high[i], high[i - 1]] for i in range(4)]
        style: Style = {"facecolor": ("#999999", 0.1), "edgecolor": "black", "linewidth": 0.5}
        for wall in np.array([low, high, *walls]) @ plane:
            axis.fill(*wall.T, **style)
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
    axis.margins(0.05, 0.12)
