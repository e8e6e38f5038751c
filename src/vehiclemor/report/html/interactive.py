"""Interactive plots: paths, errors over a grid, errors of every run; drawn by Bokeh in the page."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.report.criteria.finding import at_point
from vehiclemor.report.figures.lines import COLORS, FULL, styles
from vehiclemor.report.html.parts import Plot
from vehiclemor.report.labels import method_text
from vehiclemor.study.plans.choice import outcomes
from vehiclemor.study.plans.protocol import FULL_ORDER
from vehiclemor.study.plans.protocol_file import ProtocolFile

if TYPE_CHECKING:
    import xarray as xr
    from bokeh.plotting import figure as Figure  # noqa: N812

# Points of a curve, and of all curves or maps of a plot.
CURVE, POINTS = 400, 20_000
PATH = ["longitudinal_position", "lateral_position"]
DASHES = {"--": [8, 4], "-.": [8, 4, 2, 4], ":": [2, 3]}
HINT = "Drag to move, wheel or pinch to zoom, tap a name in the legend to hide its curve."
TOOLS = "pan,wheel_zoom,box_zoom,reset,save"


def available() -> bool:
    """Whether the extra `html` is installed."""
    return find_spec("bokeh") is not None


def library() -> str:
    """The script that draws the plots, to stand in the page."""
    from bokeh.resources import Resources

    return "\n".join(Resources(mode="inline", components=["bokeh"]).js_raw)


def plotted(name: str, figure: Figure, caption: str) -> Plot:
    """A figure of Bokeh as a plot of the page."""
    from bokeh.embed import json_item

    return Plot(name, caption, json_item(figure, name))


def _figure(x: str, y: str, **options: Any) -> Figure:
    from bokeh.plotting import figure

    given = {"height": 420, "sizing_mode": "stretch_width", "tools": TOOLS} | options
    made = figure(x_axis_label=x, y_axis_label=y, active_scroll=None, **given)
    made.toolbar.logo = None
    made.background_fill_alpha = made.border_fill_alpha = 0.0
    return made


def _legend_below(figure: Figure) -> None:
    for legend in figure.legend:
        figure.add_layout(legend, "below")
        legend.click_policy = "hide"
        legend.ncols = 2
        legend.border_line_alpha = legend.background_fill_alpha = 0.0
        legend.label_text_font_size = "11px"
        legend.spacing = 1


def _look(style: Mapping[str, Any]) -> dict[str, Any]:
    """A line of Matplotlib as Bokeh names it."""
    dash = style.get("linestyle", "solid")
    pattern = [2 * length for length in dash[1]] if isinstance(dash, tuple) else DASHES.get(dash)
    return {
        "line_color": style["color"],
        "line_dash": pattern or "solid",
        "line_width": style.get("linewidth", 1.6),
        "line_alpha": style.get("alpha", 1.0),
    }


def _thinned(run: xr.Dataset) -> xr.Dataset:
    return run.isel(time=slice(None, None, -(-run.sizes["time"] // CURVE)))


def path_plot(name: str, point: xr.Dataset) -> Plot:
    """Paths in the plane of all methods at one point of a grid, with the time at each place."""
    made = _figure("X (m)", "Y (m), not to the scale of X")
    made.add_tools(
        _hover(
            [("", "@name"), ("time", "@time{0.00} s"), ("X", "@x{0.000} m"), ("Y", "@y{0.0000} m")]
        )
    )
    methods = [str(m) for m in point["method"].values]
    reduced = [m for m in methods if not m.startswith("full_order")]
    looks = styles(reduced)
    curves = {"full order": (at_point(point, methods[0])["reference_outputs"], FULL)}
    curves |= {method_text(m): (at_point(point, m)["outputs"], looks[m]) for m in reduced}
    for words, (outputs, style) in curves.items():
        x, y = (
            _thinned(outputs.to_dataset(name="o"))["o"]
            .sel(output=PATH)
            .transpose("output", "time")
            .values
        )
        times = _thinned(outputs.to_dataset(name="o"))["time"].values
        data = {
            "x": x.astype("f4"),
            "y": y.astype("f4"),
            "time": times.astype("f4"),
            "name": [words] * len(x),
        }
        made.line("x", "y", source=data, legend_label=words, **_look(style))
    _legend_below(made)
    return plotted(name, made, f"Interactive: paths of all methods. {HINT}")


def _hover(told: list[tuple[str, str]]) -> Any:
    from bokeh.models import HoverTool

    return HoverTool(tooltips=told)


def runs_plot(name: str, judged: xr.Dataset, protocol: ProtocolFile) -> Plot:
    """Error over bound of every judged run; of the chosen model in order of size."""
    from bokeh.models import Span

    made = _figure(
        "judged run, by the error of the chosen model", "error / bound", y_axis_type="log"
    )
    made.add_tools(_hover([("", "@name"), ("run", "@run"), ("error / bound", "@y{0.000}")]))
    labels = [
        str(r) for r in judged["row"].values if str(judged["role"].sel(row=r).item()) != FULL_ORDER
    ]
    winners = [label for label in labels if bool(judged["winner"].sel(row=label))]
    found = {label: outcomes(judged.sel(row=label), protocol.bounds).scores for label in labels}
    order = np.argsort(found[(winners or labels)[0]], kind="stable")
    runs = [str(run) for run in judged["scenario"].values[order]]
    for label, color in zip(
        sorted(labels, key=lambda n: n not in winners), cycle(COLORS), strict=False
    ):
        scores = found[label][order]
        shown = np.isfinite(scores) & (scores > 0.0)
        data = {"x": np.flatnonzero(shown).astype("i4"), "y": scores[shown].astype("f4")}
        data |= {
            "run": [r for r, s in zip(runs, shown, strict=True) if s],
            "name": [label] * int(shown.sum()),
        }
        drawn = made.scatter(
            "x", "y", source=data, size=5, color=color, alpha=0.8, legend_label=label
        )
        # The rest at a tap on its name.
        drawn.visible = label in winners or len(labels) < 4
    made.add_layout(Span(location=1.0, dimension="width", line_width=1))
    _legend_below(made)
    return plotted(
        name,
        made,
        f"Interactive: every judged run; hidden models appear at a tap on their names. {HINT}",
    )
