"""The picture of any result: histories, paths or errors of one run, or of a study."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.registry import component
from vehiclemor.report.criteria.finding import at_point, without_single
from vehiclemor.report.figures.curves import (
    PATH,
    Curve,
    Panel,
    compared,
    draw_distances,
    draw_errors,
    draw_history,
    draw_largest_errors,
    positions,
)
from vehiclemor.report.figures.grid_errors import figure_grid_errors
from vehiclemor.report.figures.lines import (
    CROSS,
    FULL,
    Results,
    legend_outside,
    panels,
    styles,
    tell_empty,
)
from vehiclemor.report.figures.places import tick_decades
from vehiclemor.report.figures.sampled_errors import figure_samples, sample_axis
from vehiclemor.report.figures.saving import save_figure, styled
from vehiclemor.report.labels import full_label, marked, method_text, unit_of
from vehiclemor.report.result_selection import drawn
from vehiclemor.report.shown import main_outputs, tabled_outputs

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# At most so many outputs have panels.
PANELS = 4


def plot_result(dataset: xr.Dataset, path: Path | None = None, kind: str = "histories") -> Figure:
    """Draw a result: full order and reduced models together, differences below.

    Parameters
    ----------
    dataset
        One run as `vehiclemor.simulate` returns it, or a study at one point of its grid, where the
        methods are left; errors are drawn over the axes of the grid too.
    path
        Picture (PDF, SVG or PNG); none is written by default.
    kind
        `histories` of the outputs over the time, `paths` in the plane, or `errors`: RMS, as shares
        of the outputs' ranges.

    Raises
    ------
    InputError, FileError
        If the kind is unknown, the dataset does not hold what is to be drawn, or the
        picture can't be written.
    """
    with styled():
        figure = _drawn(dataset, kind)
        if path is not None:
            save_figure(figure, path)
    return figure


def _drawn(dataset: xr.Dataset, kind: str) -> Figure:
    if not dataset.sizes.get("output") or "scenario_set" in dataset.coords:
        raise InputError("neither a run nor a study of runs: nothing to draw over time or grid")
    figure = DRAWINGS[kind](dataset)
    figure.suptitle(figure.get_suptitle() or _title(dataset), fontsize="medium", wrap=True)
    tell_empty(figure)
    return figure


def figure_result(results: Results, *, kind: str) -> Figure:
    """The picture of a study: at its nominal or first point, errors over the whole grid."""
    (dataset,) = results.values()
    shown, point = drawn(dataset, kind, {})
    if point:
        shown = shown.assign_attrs(title=f"{shown.attrs['title']}\nat {point}")
    return _drawn(shown, kind)


def _configuration(dataset: xr.Dataset) -> dict[str, Any]:
    """What determines the result; a run that is no experiment has none."""
    return json.loads(dataset.attrs.get("configuration", "{}"))


def _model(dataset: xr.Dataset) -> str:
    return str(dataset.attrs.get("model") or _configuration(dataset).get("model", "it"))


def _title(dataset: xr.Dataset) -> str:
    """Title of the result; of one run with its input and how it has ended."""
    title = str(dataset.attrs.get("title", _model(dataset)))
    test, *_ = _configuration(dataset).get("test") or [None]
    if test:
        factors = "".join(
            f", {k} {test[k]:g}" for k in ("frequency", "amplitude") if test[k] != 1.0
        )
        title += f": {test['maneuver']}{factors}, from {test['start']}"
    status = str(dataset["status"].item()) if dataset["status"].size == 1 else "ok"
    return title if status == "ok" else f"{title}: {status}"


def shown_outputs(dataset: xr.Dataset) -> list[str]:
    """Outputs that the model shows; of a model that is not installed here, the first."""
    known = [str(output) for output in dataset["output"].values]
    try:
        definition = component("model", _model(dataset))
        main = main_outputs(definition)
        shown = list(dict.fromkeys((*main, *tabled_outputs(definition))))[: max(2, len(main))]
    except InputError:
        shown = []
    # Of outputs that a user has chosen none may be among them.
    return ([output for output in shown if output in known] or known)[:PANELS]


def _points(dataset: xr.Dataset) -> dict[str, xr.Dataset]:
    """Label of each method -> its run or errors."""
    if "label" in dataset.dims:
        return {str(label): at_point(dataset, label) for label in dataset["label"].values}
    given = dataset.coords.get("label")
    label = _configuration(dataset).get("method", "run") if given is None else given.item()
    return {str(label): without_single(dataset)}


def _runs(dataset: xr.Dataset) -> tuple[xr.Dataset, list[Curve], bool]:
    """A run with the full-order histories, the reduced runs, and whether they can be compared."""
    if not dataset.sizes.get("time") or "outputs" not in dataset:
        raise InputError("no histories in this result (keep = metrics); choose the kind `errors`")
    if alone := "reference_outputs" not in dataset:
        dataset = dataset.assign(reference_outputs=np.nan * dataset["outputs"])
    points = _points(dataset)
    first = compared(points.values())
    left = [str(name) for name in first["status"].dims]
    if left:
        raise InputError(f"choose a point of the grid first: {', '.join(left)}")
    reduced = [label for label in points if alone or not label.startswith("full_order")]
    shown = styles(reduced)
    curves = [Curve(_run_text(m, points[m]), shown[m], points[m]) for m in reduced]
    return first, curves, bool(curves) and bool(first["reference_outputs"].notnull().any())


def _run_text(label: str, run: xr.Dataset) -> str:
    """What a legend says of a run: its method, and how it has ended if not well."""
    status = str(run["status"].item())
    return marked(method_text(label), run) + ("" if status == "ok" else f" ({status})")


def figure_histories(dataset: xr.Dataset) -> Figure:
    """Outputs over the time, the differences from full order below each."""
    full, curves, differences = _runs(dataset)
    outputs = shown_outputs(dataset)
    # Up to three panels beside each other, four in two rows.
    columns = len(outputs) if len(outputs) < 4 else 2
    blocks, each = -(-len(outputs) // columns), 2 if differences else 1
    size = (2.0 + 2.8 * columns, (3.4 if differences else 2.4) * blocks + 0.7)
    heights = {"height_ratios": [2.0, 1.2][:each] * blocks}
    figure, axes = panels(blocks * each, columns, size, sharex=True, gridspec_kw=heights)
    ended: dict[str, str] = {}
    for number, output in enumerate(outputs):
        block, column = divmod(number, columns)
        panel = Panel(output, full, curves)
        ended |= draw_history(axes[each * block, column], panel, reach=1.0)
        if differences:
            _draw_differences(axes[each * block + 1, column], panel)
    for axis in axes[-1]:
        axis.set_xlabel("time (s)")
        axis.set_xlim(float(full["time"][0]), float(full["time"][-1]))
    for text, color in ended.items():
        axes[0, 0].plot([], [], color=color, label=text, **CROSS)
    legend_outside(figure, axes[:each, 0], 0, place="lower")
    return figure


def _draw_differences(axis: Axes, panel: Panel) -> None:
    """Of one reduced model over the time; of several the largest, on a logarithmic axis."""
    if len(panel.curves) == 1:
        draw_errors(axis, panel, floor=False)
        rms = panel.curves[0].run["rms_error"].sel(output=panel.output).item()
        if np.isfinite(rms):
            axis.set_title(f"RMS error {rms:.2g} {unit_of(panel.full, panel.output)}")
    else:
        period = float(panel.full["time"][-1]) / 50.0
        draw_largest_errors(axis, panel, period)
        tick_decades(axis.yaxis, *axis.get_ylim(), subs=(1.0, 3.0))
        axis.set_ylabel(f"largest error\nper {period:.2g} s ({unit_of(panel.full, panel.output)})")


def figure_paths(dataset: xr.Dataset) -> Figure:
    """Paths in the plane, and the distances from full order at the same time below."""
    full, curves, differences = _runs(dataset)
    missing = set(PATH) - set(dataset["output"].values)
    if missing:
        raise InputError(f"{_model(dataset)} has no path: no output {', '.join(sorted(missing))}")
    size = (7.6, 5.4 if differences else 3.6)
    figure, axes = panels(2 if differences else 1, 1, size, sharex=True)
    upper = axes[0, 0]
    if differences or not curves:
        upper.plot(*positions(full["reference_outputs"]), label="full order", **FULL)
    for text, style, run in curves:
        upper.plot(*positions(run["outputs"]), label=text, **style)
    upper.set_ylabel("Y (m)")
    if differences:
        draw_distances(axes[1, 0], curves)
    axes[-1, 0].set_xlabel("X (m), not to the scale of Y")
    legend_outside(figure, [upper], 0, place="lower")
    return figure


def figure_errors(dataset: xr.Dataset) -> Figure:
    """RMS errors: over the grid where there is one, else of all outputs of one point."""
    if not {"rms_error", "signal_range"} <= set(dataset):
        raise InputError("no errors in this result: it was not compared with full order")
    if "label" not in dataset.dims:
        (label,) = _points(dataset)
        dataset = dataset.expand_dims(label=[label])
    if sample_axis(dataset):
        return figure_samples(dataset, shown_outputs(dataset))
    return figure_grid_errors(dataset, shown_outputs(dataset)) or _errors_of_a_point(dataset)


def _errors_of_a_point(dataset: xr.Dataset) -> Figure:
    """RMS errors of all outputs as shares of their ranges, a mark for each method."""
    points = {m: p for m, p in _points(dataset).items() if not m.startswith("full_order")}
    if not points:
        raise InputError("full order alone: no errors to draw")
    names = [str(output) for output in dataset["output"].values]
    figure, axes = panels(1, 1, (6.7, 1.6 + 0.19 * len(names)))
    axis, places = axes[0, 0], np.arange(len(names))
    for marker, (label, style) in zip("os^vD<>phP*d" * 9, styles(points).items(), strict=False):
        ratio = points[label]["rms_error"] / points[label]["signal_range"]
        share = 100.0 * ratio.where(np.isfinite(ratio) & (ratio > 0.0)).values
        look = {"color": style["color"], "marker": marker, "linestyle": "none", "markersize": 5}
        exact = " (error 0)" if bool((points[label]["rms_error"] == 0.0).all()) else ""
        axis.semilogx(share, places, label=_run_text(label, points[label]) + exact, **look)
    tick_decades(axis.xaxis, *axis.get_xlim())
    axis.set_yticks(places, map(full_label, names), fontsize=7)
    axis.set_ylim(len(names) - 0.5, -0.5)
    axis.set_xlabel("RMS error (% of the output's range)")
    legend_outside(figure, [axis], 0, place="lower")
    return figure


DRAWINGS: dict[str, Callable[[xr.Dataset], Figure]] = {
    "histories": figure_histories,
    "paths": figure_paths,
    "errors": figure_errors,
}
