"""Interactive plot of a protocol: how far every judged run of every reduced model is off."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np

from vehiclemor.report.figures.lines import COLORS
from vehiclemor.report.html.interactive import HINT, as_items, legend_name, new_figure, with_legend
from vehiclemor.report.html.parts import Plot
from vehiclemor.study.plans.choice import outcomes
from vehiclemor.study.plans.protocol import FULL_ORDER

if TYPE_CHECKING:
    import xarray as xr

    from vehiclemor.study.plans.protocol_file import ProtocolFile

CAPTION = (
    "Interactive: every judged run of every reduced model that comes to its end; the pointer shows "
    f"which run it is. Models whose names are pale are hidden. {HINT}"
)


def runs_plot(name: str, judged: xr.Dataset, protocol: ProtocolFile) -> list[Plot]:
    """Error over bound of every run, in the order of the errors of the chosen model."""
    from bokeh.models import Span

    rows = [judged.isel(row=place) for place in range(judged.sizes["row"])]
    reduced = [row for row in rows if str(row["role"].item()) != FULL_ORDER]
    reduced.sort(key=lambda row: not row["winner"].item())
    if not reduced:
        return []
    scores = {str(r["row"].item()): outcomes(r, protocol.bounds).scores for r in reduced}
    order = np.argsort(next(iter(scores.values())), kind="stable")
    runs = np.array([str(run) for run in judged["scenario"].values])[order]
    told = {"": "@name", "run": "@run", "error / bound": "@y{0.000}"}
    first = next(iter(scores))
    made = new_figure(
        f"judged runs, by the error of {first}", "error / bound", told, y_axis_type="log"
    )
    for (label, found), color in zip(scores.items(), cycle(COLORS), strict=False):
        shown = np.flatnonzero(np.isfinite(found[order]) & (found[order] > 0.0))
        data = {"x": shown.astype("i4"), "y": found[order][shown].astype("f4")}
        data |= {"run": runs[shown].tolist(), "name": [label] * len(shown)}
        dots = made.scatter(
            "x", "y", source=data, size=5, color=color, alpha=0.8, legend_label=legend_name(label)
        )
        dots.visible = label == first
    made.add_layout(Span(location=1.0, dimension="width", line_width=1))
    return [Plot(f"plot-{name}-runs", CAPTION, as_items(with_legend(made)))]
