"""Mechanisms in space and their graphs: what the schematics share."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import ArrayLike
from pydantic import Field

from vehiclemor.resources import data_folder
from vehiclemor.toml_files import FileSchema, read_toml

Box = tuple[float, float, float, float]
SIZES = "#555555"
GREEK = ("alpha", "beta", "gamma", "zeta", "eta", "theta", "xi", "phi", "psi")
CAPTIONS = {"fontsize": 7.5, "ha": "center", "va": "center"}


class Schematic(FileSchema):
    """Colours, graph and legend of one drawing, see `data/figures/schematics.toml`."""

    colors: dict[str, str]
    nodes: dict[str, list[float]]
    edges: list[list[str]]
    legend: list[str] = Field(default_factory=list)
    corners: dict[str, list[float]] = Field(default_factory=dict)


class SchematicsFile(FileSchema):
    """Schema of `data/figures/schematics.toml`."""

    suspension: Schematic
    high_fidelity: Schematic


SCHEMATICS = read_toml(data_folder() / "figures" / "schematics.toml", SchematicsFile)


class Outline(NamedTuple):
    """Of a body: half its width, its two heights, and how far it stands over the axles, in m."""

    half: float
    bottom: float
    top: float
    overhang: float

    def draw(self, axis: Any, front: float, rear: float, edge: float = 0.8) -> None:
        """Draw it between two axles (x in m)."""
        ends, sides = (front + self.overhang, rear - self.overhang), (self.half, -self.half)
        corners = [
            (ends[0], sides[0]),
            (ends[0], sides[1]),
            (ends[1], sides[1]),
            (ends[1], sides[0]),
        ]
        low, high = ([(x, y, z) for x, y in corners] for z in (self.bottom, self.top))
        walls = [[low[i - 1], low[i], high[i], high[i - 1]] for i in range(4)]
        body = Poly3DCollection([low, high, *walls], facecolor="#999999", edgecolor="black")
        body.set_alpha(0.10)
        body.set_linewidth(edge)
        axis.add_collection3d(body)


def symbol(name: str) -> str:
    """A coordinate's name as a formula."""
    head, _, tail = name.partition("_")
    head = f"\\{head}" if head in GREEK else head
    return f"${head}_{{{tail}}}$" if tail else f"${head}$"


def space_and_graph(height: float, space: Box, graph: Box) -> tuple[Figure, Any, Axes]:
    """Figure of a height in inches with axes in space and in the plane."""
    # Placed by hand: the style's automatic layout can't deal with axes in space.
    figure = Figure(figsize=(6.7, height))
    figure.set_layout_engine("none")
    return figure, figure.add_axes(space, projection="3d"), figure.add_axes(graph)


def frame_space(
    axis: Any, low: Sequence[float], high: Sequence[float], view: tuple[float, float], zoom: float
) -> None:
    """Corners (3,) in m of what is seen, to scale, from an elevation and azimuth in degrees."""
    axis.set_axis_off()
    axis.set_proj_type("ortho")
    for name, start, end in zip("xyz", low, high, strict=True):
        getattr(axis, f"set_{name}lim")(start, end)
    axis.set_box_aspect(tuple(np.subtract(high, low)), zoom=zoom)
    axis.view_init(elev=view[0], azim=view[1])
    for artist in axis.get_children():
        artist.set_clip_on(False)


def draw_line(axis: Any, points: ArrayLike, **style: Any) -> None:
    """Line through points (n, 3) in m."""
    axis.plot(*np.transpose(points), **style)


def plate(axis: Any, corners: Sequence[np.ndarray], color: str, alpha: float) -> None:
    """Plane between corners (3,) in m."""
    face = Poly3DCollection([corners], color=color, linewidth=0.0)
    face.set_alpha(alpha)
    axis.add_collection3d(face)


def draw_wheel(
    axis: Any, centre: np.ndarray, spin: np.ndarray, radius: float, **style: Any
) -> None:
    """A wheel's circle about its spin axis (3,), a unit vector."""
    up = np.cross([1.0, 0.0, 0.0], spin)
    up /= np.linalg.norm(up)
    forward = np.cross(spin, up)
    angle = np.linspace(0.0, 2.0 * np.pi, 181)[:, None]
    circle = centre + radius * (np.cos(angle) * forward + np.sin(angle) * up)
    draw_line(axis, circle, **({"linewidth": 1.8} | style))


def draw_spring_damper(
    axis: Any,
    low: np.ndarray,
    high: np.ndarray,
    colors: tuple[str, str],
    labels: Sequence[str | None],
    size: float = 1.0,
) -> None:
    """Spring and damper side by side between two points (3,) in m.

    Parameters
    ----------
    colors, labels
        Of the spring and of the damper.
    size
        Their width, as a multiple of the usual one.
    """
    along = high - low
    aside = np.array([1.0, 0.0, 0.0]) - along[0] / (along @ along) * along
    aside *= size / np.linalg.norm(aside)

    def draw(offsets: Sequence[float], parts: Sequence[float], **style: Any) -> None:
        line = low + np.outer(parts, along) + np.outer(offsets, aside)
        draw_line(axis, line, linewidth=1.2, **style)

    parts = [0.0, 0.2, *np.linspace(0.23, 0.77, 10), 0.8, 1.0]
    turns = [0.0, 0.0, *(0.05 * (-1.0) ** np.arange(10)), 0.0, 0.0]
    draw([turn - 0.07 for turn in turns], parts, color=colors[0], label=labels[0])
    draw([0.07, 0.07], [0.0, 0.5], color=colors[1], label=labels[1])
    draw([0.03, 0.11], [0.5, 0.5], color=colors[1])
    draw([0.02, 0.02, 0.12, 0.12], [0.35, 0.675, 0.675, 0.35], color=colors[1])
    draw([0.07, 0.07], [0.675, 1.0], color=colors[1])
    for part in (0.0, 1.0):
        draw([-0.07, 0.07], [part, part], color="black")


def draw_frame(axis: Any, origin: np.ndarray, color: str, label: str) -> None:
    """Centre of mass (3,) and the axes x, y, z through it."""
    axis.plot(*origin, "o", color="black", markersize=5, linestyle="none", label=label)
    beside = ((0.4, -0.12), (0.62, 0.09), (0.62, 0.09))
    for direction, name, (along, aside) in zip(np.eye(3), "xyz", beside, strict=True):
        axis.quiver(*origin, *(0.6 * direction), color=color, linewidth=1.4, arrow_length_ratio=0.2)
        axis.text(*(origin + along * direction + [0.0, 0.0, aside]), name, color=color, **CAPTIONS)


def draw_size(
    axis: Any, ends: Sequence[np.ndarray], away: ArrayLike, label_at: ArrayLike, label: str
) -> None:
    """Distance between two `ends` (3,) in m, drawn beside them with extension lines.

    Parameters
    ----------
    away
        From the ends to the line, (3,) in m.
    label_at
        From the middle of the line to its label, (3,) in m.
    label
        With a place for the distance.
    """
    line = np.array(ends) + away
    for end in ends:
        draw_line(axis, [end, end + 1.08 * np.asarray(away)], color=SIZES, linewidth=0.5)
    draw_line(axis, line, color=SIZES, linewidth=0.9, marker="|", markersize=5)
    text = label.format(f"{np.linalg.norm(line[1] - line[0]):.3f} m")
    axis.text(*(line.mean(axis=0) + np.asarray(label_at)), text, color=SIZES, **CAPTIONS)


def draw_graph(
    axis: Axes,
    nodes: Mapping[str, Sequence[float]],
    edges: Sequence[Sequence[str]],
    colors: Mapping[str, str],
    across: tuple[float, float],
    up: tuple[float, float],
) -> None:
    """Topological graph: bodies in boxes, joints on the lines between them, closures dashed."""
    axis.set_axis_off()
    axis.set_xlim(*across)
    axis.set_ylim(*up)
    for start, end, text in edges:
        (xa, ya), (xb, yb) = nodes[start], nodes[end]
        style = "--" if "closure" in text else "-"
        axis.plot([xa, xb], [ya, yb], style, color=SIZES, linewidth=1.2, zorder=1)
        box = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
        axis.text((xa + xb) / 2, (ya + yb) / 2, text, bbox=box, zorder=2, **CAPTIONS)
    for name, (x, y) in nodes.items():
        box = {"boxstyle": "round,pad=0.35", "facecolor": "white", "edgecolor": colors[name]}
        axis.text(x, y, name.replace(" ", "\n"), bbox=box, zorder=3, **CAPTIONS)
