"""Errors of any model over the factor of its input that is perturbed."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vehiclemor.report.figures.grid_errors import draw_edges, scale_errors
from vehiclemor.report.figures.lines import Results, Style, legend_outside, letter, panels, styles
from vehiclemor.report.figures.places import places_of
from vehiclemor.report.labels import error_label
from vehiclemor.report.published import rms_numbers
from vehiclemor.study.plans.study_file import FACTORS

# None is a mark of what a logarithmic axis can't show.
MARKERS = {"pod": "o", "pod_literal": "D", "fixed_basis": "s", "replay": "."}
FLOOR: Style = {"color": "#BBBBBB", "linewidth": 3.5, "zorder": 1.5}


def figure_error_curves(
    results: Results, *, outputs: Sequence[str], methods: Mapping[str, str]
) -> Figure:
    """RMS errors against the factor that is perturbed: panels for each study and output."""
    contents = [(dataset, output) for dataset in results.values() for output in outputs]
    columns = min(2, len(contents))
    rows = -(-len(contents) // columns)
    figure, axes = panels(rows, columns, (6.7, 2.6 * rows))
    for number, (panel, (dataset, output)) in enumerate(zip(axes.flat, contents, strict=False)):
        dimension = max(FACTORS, key=lambda name: dataset.sizes[name])
        _draw_curves(panel, dataset.sel(output=output), methods, dimension)
        panel.set_ylabel(error_label(dataset, "RMS error", output))
        published = rms_numbers(str(dataset.attrs["model"]))
        if output in published:
            line: Style = {"color": "black", "linewidth": 0.8, "label": "published, nominal"}
            panel.axhline(published[output].value, **line)
        panel.set_title(letter(number))
    for panel in axes.flat[len(contents) :]:
        panel.remove()
    legend_outside(figure, figure.axes, 2)
    return figure


def _draw_curves(axis: Axes, chosen: xr.Dataset, methods: Mapping[str, str], factor: str) -> None:
    """Errors of one output; failures and errors that are 0 stand at the edges of the axis."""
    where = places_of(chosen, factor)
    where.tick(axis.xaxis)
    places = where.at
    for method, style in styles(methods).items():
        errors = chosen["rms_error"].sel(label=method).squeeze(drop=True).values
        shown = np.where(errors > 0.0, errors, np.nan)
        marked = {"label": methods[method], "marker": MARKERS.get(method, "^")}
        axis.semilogy(places, shown, markersize=3, **marked, **style)
        draw_edges(axis, places, errors[:, None], style["color"])
    if "pod" in methods:
        floor = chosen["floor_rms_error"].sel(label="pod").squeeze(drop=True).values
        if np.isfinite(floor).any():
            axis.semilogy(places, floor, label="best approximation, control periods", **FLOOR)
    scale_errors(axis)
