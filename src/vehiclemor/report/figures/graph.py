"""Topological graphs of models, with the colours of their bodies."""

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from pydantic import Field

from vehiclemor.resources import data_folder
from vehiclemor.toml_files import FileSchema, read_toml


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


def draw_graph(
    axis: Axes,
    nodes: Mapping[str, Sequence[float]],
    edges: Sequence[Sequence[str]],
    colors: Mapping[str, str],
) -> None:
    """Topological graph: bodies in boxes, joints on the lines between them, closures dashed."""
    axis.set_axis_off()
    for start, end, text in edges:
        (xa, ya), (xb, yb) = nodes[start], nodes[end]
        closure = "closure" in text
        style = "--" if closure else "-"
        axis.plot([xa, xb], [ya, yb], style, color="#555555", linewidth=1.2, zorder=1)
        place = {"ha": "center", "va": "center", "fontsize": 7.5, "zorder": 2}
        box = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
        axis.text((xa + xb) / 2, (ya + yb) / 2, text, bbox=box, **place)
    for name, (x, y) in nodes.items():
        box = {"boxstyle": "round,pad=0.35", "facecolor": "white", "edgecolor": colors[name]}
        text = name.replace(" ", "\n")
        axis.text(x, y, text, ha="center", va="center", fontsize=7.5, bbox=box, zorder=3)
