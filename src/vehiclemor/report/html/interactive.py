"""Interactive plots of the page, drawn by Bokeh: what they share."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from typing import Any

# Bokeh's types are not complete.
Figure = Any
DASHES = {"--": [8, 4], "-.": [8, 4, 2, 4], ":": [2, 3]}
TOOLS = "pan,wheel_zoom,box_zoom,reset,save"
# Said below every plot.
HINT = "Drag to move, zoom with the tools beside it, tap a name in the legend to hide or show it."
# Names of a legend in two columns, and the longest name of all.
SHORT, LONGEST = 20, 44
# Pixels that a row of it takes.
ROW = 24
# What a tap on a point does: the page goes to its cell, if that is listed.
GO_TO_CELL = """
const row = source.selected.indices[0];
const anchor = source.data.cell[row];
if (document.getElementById(anchor)) { location.hash = anchor; }
source.selected.indices = [];
"""


def available() -> bool:
    """Whether the extra `html` is installed."""
    return find_spec("bokeh") is not None


def library() -> str:
    """The script that draws the plots, to stand in the page."""
    from bokeh.resources import Resources

    return "\n".join(Resources(mode="inline", components=["bokeh"]).js_raw)


def new_figure(x: str, y: str, told: Mapping[str, str], **options: Any) -> Figure:
    """A figure as wide as its place; `told` is what the pointer is shown of a point."""
    from bokeh.models import DataRange1d, HoverTool
    from bokeh.plotting import figure

    given: dict[str, Any] = {"height": 380, "sizing_mode": "stretch_width", "tools": TOOLS}
    given |= {f"{axis}_range": DataRange1d(only_visible=True) for axis in "xy"}
    made = figure(x_axis_label=x, y_axis_label=y, active_scroll=None, **(given | options))
    made.add_tools(HoverTool(tooltips=list(told.items())))
    made.toolbar.logo = None
    made.background_fill_alpha = made.border_fill_alpha = 0.0
    for axis in (made.xaxis, made.yaxis):
        axis.axis_label_text_font_style = "normal"
    return made


def with_legend(figure: Figure) -> Figure:
    """The same with its legend below, whose names hide and show."""
    for legend in figure.legend:
        names = [item.label.value for item in legend.items]
        columns = 2 if max(map(len, names)) <= SHORT else 1
        figure.add_layout(legend, "below")
        # The plot above keeps its height.
        figure.height += ROW * -(-len(names) // columns)
        legend.update(click_policy="hide", ncols=columns, location="bottom_left", spacing=8)
        legend.update(label_text_font_size="11px", glyph_width=30, padding=4)
        legend.update(background_fill_alpha=0, border_line_alpha=0)
    return figure


def legend_name(text: str) -> str:
    """A name as a legend has room for it on a telephone."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"


def tapped(figure: Figure, source: Any) -> None:
    """Let a tap on a point lead to its cell, which the column `cell` of the source names."""
    from bokeh.models import CustomJS, TapTool

    if not figure.select(type=TapTool):
        figure.add_tools(TapTool())
    source.selected.js_on_change("indices", CustomJS(args={"source": source}, code=GO_TO_CELL))


def look(style: Mapping[str, Any]) -> dict[str, Any]:
    """A line of Matplotlib as Bokeh names it."""
    dash = style.get("linestyle", "solid")
    pattern = [2 * length for length in dash[1]] if isinstance(dash, tuple) else DASHES.get(dash)
    return {
        "line_color": style["color"],
        "line_dash": pattern or "solid",
        "line_width": style.get("linewidth", 1.6),
        "line_alpha": style.get("alpha", 1.0),
    }


def as_items(*figures: Figure) -> list[Mapping[str, Any]]:
    """Figures as the script of the page takes them."""
    from bokeh.embed import json_item

    return [json_item(figure) for figure in figures]
