"""Runs of any model: histories and paths of full order and reduced models, and their errors."""

import itertools
import json
import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vehiclemor.exceptions import InputError
from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.registry import component
from vehiclemor.report import labels
from vehiclemor.report.figures import theme
from vehiclemor.report.figures.theme import CROSS, FULL, Style, hide_rounding, tick_decades
from vehiclemor.report.published import rms_numbers
from vehiclemor.report.results import at_point
from vehiclemor.simulation.trajectory import FINISHED

# Lines of inputs.
INPUTS = ("-", *theme.DASHES)
# Outputs that make a path in the plane.
PATH = ("longitudinal_position", "lateral_position")
RMS_MARK: Style = {"marker": "<", "markersize": 6, "linestyle": "none"}
# How far around the full-order signal the others are shown, as a multiple of its range; share of
# the largest value below which the full order stands still.
REACH, STILL = 0.6, 1e-4


class Curve(NamedTuple):
    """One run, with the text of its legend and its style."""

    text: str
    style: Style
    run: xr.Dataset


class Runs(NamedTuple):
    """Runs of one panel: one that stands beside its full order, and those that are drawn."""

    full: xr.Dataset
    curves: Sequence[Curve]

    @property
    def compared(self) -> bool:
        """Whether there are errors."""
        return bool(self.curves) and bool(self.full["reference_outputs"].notnull().any())


def configuration(dataset: xr.Dataset) -> dict[str, Any]:
    """What determines the result; a run that is no experiment has none."""
    return json.loads(dataset.attrs.get("configuration", "{}"))


def model_name(dataset: xr.Dataset) -> str:
    """The model that a result is of."""
    return str(dataset.attrs.get("model") or configuration(dataset).get("model", "it"))


def shown_outputs(dataset: xr.Dataset) -> list[str]:
    """Outputs that the model shows, three at most; of one that is not installed, the first."""
    known = [str(output) for output in dataset["output"].values]
    shown: list[str] = []
    if definition := _definition(dataset):
        main = labels.main_outputs(definition)
        every = dict.fromkeys((*main, *labels.tabled_outputs(definition)))
        shown = list(every)[: max(2, len(main))]
    # Of outputs that a user has chosen none may be among them.
    return ([output for output in shown if output in known] or known)[:3]


def _input_meanings(dataset: xr.Dataset) -> dict[str, str]:
    """Meaning of each input, without its remarks."""
    definition = _definition(dataset)
    inputs = definition.inputs if definition else ()
    return {quantity.name: quantity.long_name.partition(",")[0] for quantity in inputs}


def _definition(dataset: xr.Dataset) -> ModelDefinition | None:
    """The model of a result, if it is installed here."""
    try:
        return component("model", model_name(dataset))
    except InputError:
        return None


def legend_of(dataset: xr.Dataset) -> dict[str, str]:
    """Text of each reduced model by its label: trained on the run, and not ended well, if so.

    Full order has one too where nothing was compared with it.
    """
    alone = "reference_outputs" not in dataset and "rms_error" not in dataset
    texts: dict[str, str] = {}
    for label in map(str, dataset["label"].values):
        if label.startswith("full_order") and not alone:
            continue
        run = at_point(dataset, label)
        ends = run["status"].to_series() if run["status"].ndim else {"": run["status"].item()}
        bad = {at: end for at, end in ends.items() if end != "ok"}
        failed = "; ".join(f"{end}, {at} start" if at else end for at, end in bad.items())
        texts[label] = labels.method_text(label)
        if labels.trained_runs(run).all():
            texts[label] += labels.MARK
        if failed:
            texts[label] += f" ({failed})"
    return texts


def runs_of(dataset: xr.Dataset, texts: Mapping[str, str]) -> Runs:
    """The runs of some labels, with their `texts`, at a point of a study."""
    if not dataset.sizes.get("time") or "outputs" not in dataset:
        raise InputError("no histories in this result (keep = metrics); choose the kind `errors`")
    if "reference_outputs" not in dataset:
        dataset = dataset.assign(reference_outputs=np.nan * dataset["outputs"])
    points = {str(label): at_point(dataset, label) for label in dataset["label"].values}
    several = [str(name) for name in next(iter(points.values()))["status"].dims]
    if several:
        raise InputError(f"choose a point of the grid first: {', '.join(several)}")
    with_full = (p for p in points.values() if bool(p["reference_outputs"].notnull().any()))
    looks = theme.styles(texts, theme.methods_of(dataset))
    curves = [Curve(text, looks[label], points[label]) for label, text in texts.items()]
    return Runs(next(with_full, next(iter(points.values()))), curves)


def figure_histories(dataset: xr.Dataset) -> Figure:
    """Outputs over the time, side by side, at a point of a study; their errors below.

    The inputs stand at the right, if the result has them.
    """
    texts, outputs = legend_of(dataset), shown_outputs(dataset)
    runs = runs_of(dataset, texts)
    rows: list[Callable[[Axes, Runs, str], object]] = [draw_history]
    if runs.compared:
        rows.append(draw_largest_errors if len(texts) > 1 else draw_errors)
    heights = [2.5, 1.8][: len(rows)]
    columns = len(outputs) + ("inputs" in runs.full)
    size = (6.7 if columns < 3 else 9.5, sum(heights) + 1.2)
    ratios = {"height_ratios": heights}
    figure, axes = theme.panels(len(rows), columns, size, sharex=True, gridspec_kw=ratios)
    lowest = list(axes[-1, : len(outputs)])
    if "inputs" in runs.full:
        for axis in axes[1:, -1]:
            axis.remove()
        draw_inputs(axes[0, -1], runs.full, _input_meanings(dataset))
        axes[0, -1].tick_params(labelbottom=True)
        lowest.append(axes[0, -1])
    for number, axis in enumerate(figure.axes):
        axis.set_title(theme.letter(number))
    for row, draw in zip(axes, rows, strict=True):
        for axis, output in zip(row, outputs, strict=False):
            draw(axis, runs, output)
    time = dataset["time"].values
    for axis in lowest:
        axis.set_xlabel("time (s)")
        axis.set_xlim(float(time[0]), float(time[-1]))
    theme.legend_below(figure, figure.axes)
    return figure


def draw_inputs(axis: Axes, run: xr.Dataset, meanings: Mapping[str, str]) -> None:
    """Inputs that change, or the first, over the time; of several units those of the first."""
    inputs = run["inputs"].transpose("input", "time").values
    names, units = run["input"].values.tolist(), run["input_unit"].values.tolist()
    moving = np.flatnonzero(np.ptp(inputs, axis=1) > 0.0).tolist() or [0]
    shown = [k for k in moving if units[k] == units[moving[0]]]
    for k, dashes in zip(shown, itertools.cycle(INPUTS), strict=False):
        label = f"input {names[k]}".replace("_", " ") if len(shown) > 1 else ""
        look: Style = {"color": "black", "linewidth": 1.0, "linestyle": dashes}
        axis.plot(run["time"], inputs[k], label=label, **look)
    text = meanings.get(names[shown[0]], names[shown[0]]) if len(shown) == 1 else "inputs"
    unit = labels.raised(units[shown[0]])
    axis.set_ylabel(textwrap.fill(f"{text} ({unit})", width=20))


def draw_history(axis: Axes, runs: Runs, output: str) -> str:
    """One output of all runs near the full-order signal; gives the unit of the axis."""
    full = runs.full["reference_outputs"].sel(output=output)
    histories = [curve.run["outputs"].sel(output=output) for curve in runs.curves]
    low, high = float(full.min()), float(full.max())
    span = high - low
    finished = [curve.run["status"].item() in FINISHED for curve in runs.curves]
    ended = [full, *itertools.compress(histories, finished)]
    largest = max(0.0, *(float(abs(history).max()) for history in ended))
    # Where the full order is not known, or stands still, all is seen.
    moves = span > STILL * largest
    scale = max(abs(low), abs(high)) if moves else largest
    factor, unit = labels.readable_unit(scale, labels.unit_of(runs.full, output))
    limits = -np.inf, np.inf
    if np.isfinite(span):
        axis.plot(full["time"], factor * full, label="full order", **FULL)
    if moves:
        every = np.array([full, *histories])
        lowest = max(np.nanmin(every), low - REACH * span) - 0.05 * span
        highest = min(np.nanmax(every), high + REACH * span) + 0.05 * span
        limits = factor * lowest, factor * highest
        axis.set_ylim(*limits)
    for curve, history in zip(runs.curves, histories, strict=True):
        _plot_until_it_leaves(axis, curve, factor * history, limits)
    axis.set_ylabel(labels.axis_label(runs.full, output, unit))
    axis.ticklabel_format(style="plain")
    axis.locator_params(axis="y", nbins=6)
    return unit


def _plot_until_it_leaves(
    axis: Axes, curve: Curve, history: xr.DataArray, limits: tuple[float, float]
) -> None:
    """Draw a history up to its end, or the first point outside the limits; a cross there."""
    time, values = history["time"].values, history.values
    outside = np.flatnonzero(~((values >= limits[0]) & (values <= limits[1])))
    # What has failed before its first value has no end.
    if outside.size and np.isfinite(values[0]):
        first = int(outside[0])
        diverged = bool(np.isnan(values[first]))
        text = "has diverged" if diverged else "leaves the axes"
        if diverged and curve.run["status"].item() == "stopped":
            text = "stops"
        at = time[first - diverged], np.clip(values[first - diverged], *limits)
        axis.plot(*at, color=curve.style["color"], label=text, clip_on=False, **CROSS)
        values = np.where(np.arange(values.size) <= first, values, np.nan)
    axis.plot(time, values, label=curve.text, **curve.style)


def _errors(runs: Runs, output: str) -> list[xr.DataArray]:
    points = [curve.run.sel(output=output) for curve in runs.curves]
    return [point["outputs"] - point["reference_outputs"] for point in points]


def draw_errors(axis: Axes, runs: Runs, output: str) -> None:
    """Errors over the time, and the RMS error of the best approximation by the first method."""
    errors = _errors(runs, output)
    largest = np.fmax.reduce([float(abs(error).max()) for error in errors])
    factor, unit = labels.readable_unit(float(largest), labels.unit_of(runs.full, output))
    for curve, error in zip(runs.curves, errors, strict=True):
        axis.plot(error["time"], factor * error, label=curve.text, **curve.style)
    held = [c.run["floor_rms_error"] for c in runs.curves if "floor_rms_error" in c.run]
    floors = [factor * floor.sel(output=output).item() for floor in held]
    best = next(filter(np.isfinite, floors), None)
    if best is not None:
        shade = {"color": "#BBBBBB", "alpha": 0.5, "label": "RMS of the best approximation"}
        axis.axhspan(-best, best, **shade)
    rms = runs.curves[0].run["rms_error"].sel(output=output).item()
    if len(runs.curves) == 1 and np.isfinite(rms):
        text = f"RMS error {factor * rms:.3g} {labels.raised(unit)}"
        axis.set_title(f"{axis.get_title(loc='left')} {text}")
    axis.set_ylabel(labels.error_label(runs.full, "error", output, unit))


def draw_largest_errors(axis: Axes, runs: Runs, output: str) -> None:
    """Largest error in each control period, the RMS error at the right edge."""
    published = rms_numbers(str(runs.full.attrs.get("model"))).get(output)
    time = runs.full["time"].values
    period = (published.control_period if published else None) or time[-1] / 50.0
    # A sample between two periods belongs to the one that ends there.
    window = np.maximum(np.ceil(time / period - 1e-9).astype(int) - 1, 0)
    numbers, first = np.unique(window, return_index=True)
    edges = period * np.append(numbers, numbers[-1] + 1)
    marked: list[float] = []
    for number, (curve, error) in enumerate(zip(runs.curves, _errors(runs, output), strict=True)):
        largest = np.fmax.reduceat(abs(error.values), first)
        largest = np.where(largest == 0.0, np.nan, largest)
        known = np.flatnonzero(np.isfinite(largest))
        if curve.run["status"].item() == "diverged" and known.size:
            at = edges[known[-1] + 1], largest[known[-1]]
            axis.plot(*at, color=curve.style["color"], label="has diverged", **CROSS)
        steps = np.append(largest, largest[-1])
        axis.semilogy(edges, steps, label=curve.text, drawstyle="steps-post", **curve.style)
        rms = curve.run["rms_error"].sel(output=output).item()
        if str(curve.run["status"].item()) in FINISHED and rms:
            # Side by side within the axes.
            at = 0.985 - min(0.03, 0.12 / len(runs.curves)) * number
            edge: Style = {"transform": axis.get_yaxis_transform()}
            axis.plot(at, rms, color=curve.style["color"], **edge, **RMS_MARK)
            marked.append(rms)
    axis.plot([], [], color="black", label="RMS error over the run (right edge)", **RMS_MARK)
    if published:
        line: Style = {"color": "black", "linestyle": ":", "label": "published RMS error"}
        axis.axhline(published.value, **line)
    hide_rounding(axis)
    axis.set_ylim(bottom=min([axis.get_ylim()[0], *(0.5 * rms for rms in marked)]))
    tick_decades(axis.yaxis, *axis.get_ylim())
    label = f"largest error of {labels.label_of(output).symbol}"
    label = label if len(label) <= 26 else label.replace(" of ", "\nof ", 1)
    unit = labels.raised(labels.unit_of(runs.full, output))
    axis.set_ylabel(f"{label}\nin each {period:.2g} s ({unit})")


def figure_paths(dataset: xr.Dataset) -> Figure:
    """Paths in the plane, and the distances from full order at the same time below."""
    missing = sorted(set(PATH) - {str(output) for output in dataset["output"].values})
    if missing:
        raise InputError(f"{dataset.attrs.get('model')} has no path: no output {missing}")
    runs = runs_of(dataset, legend_of(dataset))
    titles = ["", "distance from full order at the same time"][: 1 + runs.compared]
    figure, axes = theme.panels(len(titles), 1, (6.7, 1.4 + 1.5 * len(titles)), sharex=True)
    for number, (axis, title) in enumerate(zip(axes.flat, titles, strict=True)):
        axis.set_title(theme.letter(number, title))
        if title:
            draw_distances(axis, runs.curves)
        else:
            draw_paths(axis, runs)
            axis.set_ylabel("Y (m)")
    axes[-1, 0].set_xlabel("X (m), not to the scale of Y")
    theme.legend_below(figure, [axes[0, 0]])
    return figure


def positions(outputs: xr.DataArray) -> list[np.ndarray]:
    """X and Y (time,) in m."""
    return [outputs.sel(output=output).values for output in PATH]


def draw_paths(axis: Axes, runs: Runs) -> None:
    """Paths of all runs."""
    full = positions(runs.full["reference_outputs"])
    if np.isfinite(full).any():
        axis.plot(*full, label="full order", **FULL)
    for curve in runs.curves:
        axis.plot(*positions(curve.run["outputs"]), label=curve.text, **curve.style)


def draw_distances(axis: Axes, curves: Sequence[Curve]) -> None:
    """Distance between the positions of a reduced and the full vehicle at the same time, over X."""
    for curve in curves:
        x, y = positions(curve.run["reference_outputs"])
        ahead, aside = positions(curve.run["outputs"])
        away = np.hypot(ahead - x, aside - y)
        away[away == 0.0] = np.nan
        axis.semilogy(x, away, label=curve.text, **curve.style)
    hide_rounding(axis)
    axis.set_ylabel("distance (m)")
