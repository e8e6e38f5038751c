"""Vehicles in space: what the drawings of both vehicles share."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import ArrayLike

Rectangle = tuple[float, float, float, float]
SIZES = "#555555"
GREEK = ("alpha", "beta", "gamma", "zeta", "eta", "theta", "xi", "phi", "psi")
CAPTIONS = {"fontsize": 7.5, "ha": "center", "va": "center"}
DOT: dict[str, Any] = {"marker": "o", "markersize": 5, "linestyle": "none"}


def symbol(name: str) -> str:
    """A coordinate's name as a formula."""
    head, _, tail = name.partition("_")
    head = f"\\{head}" if head in GREEK else head
    return f"${head}_{{{tail}}}$" if tail else f"${head}$"


def space_and_graph(height: float, space: Rectangle, graph: Rectangle) -> tuple[Figure, Any, Axes]:
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


def draw_box(
    axis: Any, ends: Sequence[float], half: float, heights: Sequence[float], edge: float = 0.8
) -> None:
    """Outline of a body between its ends, its sides at +-`half` and two heights, in m."""
    corners = [(ends[i], side * half) for i, side in ((0, 1), (0, -1), (1, -1), (1, 1))]
    levels = [[(x, y, z) for x, y in corners] for z in heights]
    sides = [[levels[0][i - 1], levels[0][i], levels[1][i], levels[1][i - 1]] for i in range(4)]
    body = Poly3DCollection([*levels, *sides], facecolor="#999999", edgecolor="black")
    body.set_alpha(0.10)
    body.set_linewidth(edge)
    axis.add_collection3d(body)


def rim(centre: np.ndarray, spin: np.ndarray, radius: float) -> np.ndarray:
    """Points (n, 3) of a wheel's circle about its spin axis (3,), a unit vector."""
    up = np.cross([1.0, 0.0, 0.0], spin)
    up /= np.linalg.norm(up)
    forward = np.cross(spin, up)
    angle = np.linspace(0.0, 2.0 * np.pi, 73)[:, None]
    return centre + radius * (np.cos(angle) * forward + np.sin(angle) * up)


def draw_tire(axis: Any, centre: np.ndarray, spin: np.ndarray, radius: float, **style: Any) -> None:
    """Wheel about its spin axis (3,), a unit vector, on the road."""
    circle = rim(centre, spin, radius)
    # The road presses the tire flat by its static deflection.
    circle[:, 2] = np.maximum(circle[:, 2], 0.0)
    axis.plot(*circle.T, **style)


def draw_spring_damper(
    axis: Any,
    low: np.ndarray,
    high: np.ndarray,
    colors: tuple[str, str],
    labels: tuple[str | None, str | None],
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
        axis.plot(*line.T, linewidth=1.2, **style)

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
    axis.plot(*origin, color="black", label=label, **DOT)
    for direction, name in zip(np.eye(3), "xyz", strict=True):
        axis.quiver(*origin, *(0.6 * direction), color=color, linewidth=1.4, arrow_length_ratio=0.2)
        axis.text(*(origin + 0.62 * direction + [0.0, 0.0, 0.09]), name, color=color, **CAPTIONS)


def draw_size(
    axis: Any, start: np.ndarray, end: np.ndarray, label_at: ArrayLike, name: str
) -> None:
    """Distance between two points (3,) in m; its label `label_at` (3,) from their middle."""
    axis.plot(*np.array([start, end]).T, color=SIZES, linewidth=0.9, marker="|", markersize=5)
    text = f"${name}$ = {np.linalg.norm(end - start):.3f} m"
    axis.text(*((start + end) / 2.0 + np.array(label_at)), text, color=SIZES, **CAPTIONS)
