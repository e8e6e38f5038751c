"""Runs of any model: histories and paths of full order and reduced models, and their errors."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vehiclemor.errors import InputError
from vehiclemor.report import labels
from vehiclemor.report.figures import theme
from vehiclemor.report.figures.scales import hide_rounding, tick_decades
from vehiclemor.report.figures.theme import CROSS, FULL, Results, Style
from vehiclemor.report.findings import at_point
from vehiclemor.report.published import rms_numbers
from vehiclemor.simulation.trajectory import FINISHED

# Outputs that make a path in the plane.
PATH = ("longitudinal_position", "lateral_position")
DIVERGED, DISTANCE = "has diverged", "distance from full order at the same time"
RMS_MARK: Style = {"marker": "<", "markersize": 6, "linestyle": "none"}
END: Style = {"color": "#777777", "linewidth": 0.8, "label": "end of a control period"}
# How far around the full-order signal the others are shown, as a multiple of its range; share of
# the largest value below which the full order stands still.
REACH, STILL = 0.6, 1e-4
# Height of a panel in inches; letters of a label beside it in one line.
HISTORY, ERROR, LINE = 2.0, 1.7, 26
# Panels beside each other.
MOST_BESIDE = 3


class Curve(NamedTuple):
    """One run, with the text of its legend and its style."""

    label: str
    text: str
    style: Style
    run: xr.Dataset


class Runs(NamedTuple):
    """Runs of one panel.

    Attributes
    ----------
    full
        One that stands beside its full order; a failed one may have none.
    curves
        The others, full order left out.
    """

    full: xr.Dataset
    curves: Sequence[Curve]

    @property
    def compared(self) -> bool:
        """Whether there are errors."""
        return bool(self.curves) and bool(self.full["reference_outputs"].notnull().any())


def legend_of(dataset: xr.Dataset, methods: Mapping[str, str] | None = None) -> dict[str, str]:
    """Text of each reduced model by its label: trained on the run, and not ended well, if so.

    Parameters
    ----------
    methods
        Labels with their texts, those that the study lacks left out; by default all, or full order
        where nothing was compared with it.
    """
    known = [str(label) for label in dataset["label"].values]
    if methods is None:
        alone = "reference_outputs" not in dataset and "rms_error" not in dataset
        reduced = [label for label in known if alone or not label.startswith("full_order")]
        methods = {label: labels.method_text(label) for label in reduced}
    texts: dict[str, str] = {}
    for label in [label for label in methods if label in known]:
        run = at_point(dataset, label)
        ends = run["status"].to_series() if run["status"].ndim else {"": run["status"].item()}
        bad = {at: end for at, end in ends.items() if end != "ok"}
        failed = "; ".join(f"{end}, {at} start" if at else end for at, end in bad.items())
        texts[label] = labels.marked(methods[label], run) + (f" ({failed})" if failed else "")
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
    looks = theme.styles(texts)
    curves = [Curve(label, text, looks[label], points[label]) for label, text in texts.items()]
    return Runs(next(with_full, next(iter(points.values()))), curves)


def figure_histories(
    results: Results,
    *,
    outputs: Sequence[str],
    methods: Mapping[str, str] | None = None,
    rows: Sequence[str] = (),
    beside: bool = False,
    place: Mapping[str, object] | None = None,
    shown: float | None = None,
    marks: Sequence[float] = (),
) -> Figure:
    """Outputs over the time: a column for each start, or for each output.

    Parameters
    ----------
    methods
        As of `legend_of`.
    rows
        What each output has: `history`, `error` (beside the RMS error of the best approximation),
        `largest error` (in each control period, with the RMS error over the run beside the
        published one), `difference from replay`.  By default histories and errors.
    beside
        Outputs stand beside each other, not below each other.
    place
        Place in the study's grid.
    shown, marks
        Time up to which the runs are shown, and times at which a control period ends, in s.
    """
    (dataset,) = results.values()
    dataset = dataset.sel(place or {})
    texts = legend_of(dataset, methods)
    starts = list(dataset["start"].values) if "start" in dataset.dims and not beside else [None]
    each = [dataset if start is None else dataset.sel(start=start) for start in starts]
    runs = [runs_of(point, texts) for point in each]
    if not rows:
        error = "largest error" if len(runs[0].curves) > 1 else "error"
        rows = ["history", error] if runs[0].compared else ["history"]
    wide = len(outputs) if len(outputs) <= MOST_BESIDE else 2
    columns = wide if beside else len(starts)
    block = columns if beside else 1
    heights = [HISTORY if content == "history" else ERROR for content in rows]
    heights *= -(-len(outputs) // block)
    size = (6.7 if columns < MOST_BESIDE else 9.5, sum(heights) + 1.2)
    ratios = {"height_ratios": heights}
    figure, axes = theme.panels(len(heights), columns, size, sharex=True, gridspec_kw=ratios)
    ended: dict[str, str] = {}
    for number, axis in enumerate(axes.flat):
        row, column = divmod(number, columns)
        row, content = divmod(row, len(rows))
        output = outputs[row * block + column * beside]
        found = runs[0 if beside else column]
        start = f"{starts[column]} start" if len(starts) > 1 else ""
        axis.set_title(theme.letter(number, start))
        if rows[content] == "history":
            scale = _scale(dataset, output)
            ended |= draw_history(axis, found, output, scale)
        else:
            ended |= _draw_errors(axis, found, output, rows[content])
        for moment in marks:
            axis.axvline(moment, **END)
    time = dataset["time"].values
    for axis in axes[-1]:
        part = f", first {shown:g} s of {time[-1]:g} s" if shown else ""
        axis.set_xlabel(f"time (s){part}")
        axis.set_xlim(float(time[0]), shown or float(time[-1]))
    for text, color in ended.items():
        axes[0, 0].plot([], [], color=color, label=text, **CROSS)
    theme.legend_below(figure, axes.flat)
    return figure


def _scale(dataset: xr.Dataset, output: str) -> float:
    """Largest value, which decides the prefix of the unit: the full order's, unless it is still."""
    runs = dataset["outputs"].sel(output=output).where(dataset["status"].isin(FINISHED))
    reduced = float(abs(runs).fillna(0.0).max())
    full = dataset.get("reference_outputs", np.nan * dataset["outputs"]).sel(output=output)
    largest = float(abs(full).max())
    return largest if largest > STILL * reduced else reduced


def draw_history(axis: Axes, runs: Runs, output: str, scale: float) -> dict[str, str]:
    """One output of all runs, in a unit for values up to `scale`; what crosses mean -> colour.

    Lines end where they leave the surroundings of the full-order signal.
    """
    factor, unit = labels.readable_unit(scale, labels.unit_of(runs.full, output))
    full = factor * runs.full["reference_outputs"].sel(output=output)
    histories = [factor * curve.run["outputs"].sel(output=output) for curve in runs.curves]
    axis.set_ylabel(labels.axis_label(runs.full, output, unit))
    if bool(full.notnull().any()):
        axis.plot(full["time"], full, label="full order", **FULL)
    limits = _surroundings(full, histories, factor * scale)
    if limits:
        axis.set_ylim(*limits)
    left: dict[str, str] = {}
    for curve, history in zip(runs.curves, histories, strict=True):
        if not limits:
            axis.plot(history["time"], history, label=curve.text, **curve.style)
        elif ended := _plot_until_it_leaves(axis, history, curve):
            left[ended] = curve.style["color"]
    axis.ticklabel_format(style="plain")
    axis.locator_params(axis="y", nbins=6)
    return left


def _surroundings(
    full: xr.DataArray, histories: Sequence[xr.DataArray], scale: float
) -> tuple[float, float] | None:
    """Limits that hold the full-order signal and of the others what is near it.

    None where the full order is not known, or stands still.
    """
    low, high = float(full.min()), float(full.max())
    span = high - low
    if not span > STILL * scale:
        return None
    near = [v for h in histories for v in (float(h.min()), float(h.max())) if np.isfinite(v)]
    lowest = max(min([low, *near]), low - REACH * span)
    highest = min(max([high, *near]), high + REACH * span)
    return lowest - 0.05 * span, highest + 0.05 * span


def _plot_until_it_leaves(axis: Axes, history: xr.DataArray, curve: Curve) -> str:
    """Draw a history up to the first point outside the axes; what the cross there means."""
    low, high = axis.get_ylim()
    time, values = history["time"].values, history.values.copy()
    outside = np.flatnonzero(~((values >= low) & (values <= high)))
    ended = ""
    # What has failed before its first value has no end.
    if outside.size and np.isfinite(values[0]):
        first = int(outside[0])
        # A run that has diverged ends without a value.
        diverged = not np.isfinite(values[first])
        seen, ended = first - diverged, DIVERGED if diverged else "leaves the axes"
        place = (time[seen], np.clip(values[seen], low, high))
        axis.plot(*place, color=curve.style["color"], clip_on=False, **CROSS)
        values[first + 1 :] = np.nan
    axis.plot(time, values, label=curve.text, **curve.style)
    return ended


def _draw_errors(axis: Axes, runs: Runs, output: str, content: str) -> dict[str, str]:
    """One output's errors over the time; what the crosses mean -> their colour."""
    if content == "largest error":
        return draw_largest_errors(axis, runs, output)
    if content == "error":
        draw_errors(axis, runs, output)
        rms = runs.curves[0].run["rms_error"].sel(output=output).item()
        if len(runs.curves) == 1 and np.isfinite(rms):
            words = f" RMS error {rms:.2g} {labels.unit_of(runs.full, output)}"
            axis.set_title(axis.get_title(loc="left") + words)
        return {}
    against = next(c.run["outputs"] for c in runs.curves if c.label == "replay")
    others = [
        curve._replace(run=curve.run.drop_vars("floor_rms_error").assign(reference_outputs=against))
        for curve in runs.curves
        if curve.label != "replay"
    ]
    words = content.replace(" ", "\n", 1)
    draw_errors(axis, runs._replace(curves=others), output, words)
    return {}


def _error(curve: Curve, output: str) -> xr.DataArray:
    return (curve.run["outputs"] - curve.run["reference_outputs"]).sel(output=output)


def draw_errors(axis: Axes, runs: Runs, output: str, kind: str = "") -> None:
    """Errors over the time, and the RMS error of the best approximation by the first method."""
    found = [_error(curve, output) for curve in runs.curves]
    largest = np.fmax.reduce([float(abs(error).max()) for error in found])
    factor, unit = labels.readable_unit(float(largest), labels.unit_of(runs.full, output))
    for curve, error in zip(runs.curves, found, strict=True):
        axis.plot(error["time"], factor * error, label=curve.text, **curve.style)
    held = [c.run["floor_rms_error"] for c in runs.curves if "floor_rms_error" in c.run]
    floors = [factor * floor.sel(output=output).item() for floor in held]
    best = next(filter(np.isfinite, floors), None)
    if best is not None:
        shade = {"color": "#BBBBBB", "alpha": 0.5, "label": "RMS of the best approximation"}
        axis.axhspan(-best, best, **shade)
    axis.set_ylabel(
        f"{kind} ({unit})" if kind else labels.error_label(runs.full, "error", output, unit)
    )


def draw_largest_errors(axis: Axes, runs: Runs, output: str) -> dict[str, str]:
    """Largest error in each control period, the RMS error at the right edge."""
    published = rms_numbers(str(runs.full.attrs.get("model"))).get(output)
    last = float(runs.full["time"][-1])
    period = (published.control_period if published else None) or last / 50.0
    ended: dict[str, str] = {}
    marked: list[float] = []
    for number, curve in enumerate(runs.curves):
        edges, largest = _largest(abs(_error(curve, output)), period)
        largest[largest == 0.0] = np.nan
        axis.semilogy(edges, largest, label=curve.text, drawstyle="steps-post", **curve.style)
        color, status = curve.style["color"], str(curve.run["status"].item())
        if status in FINISHED:
            rms = curve.run["rms_error"].sel(output=output).item()
            at = 1.0 + min(0.03, 0.12 / len(runs.curves)) * number, rms or np.nan
            marked += [rms] if rms else []
            edge = axis.get_yaxis_transform()
            axis.plot(*at, color=color, transform=edge, clip_on=False, **RMS_MARK)
        elif status == "diverged" and np.isfinite(largest).any():
            end = int(np.flatnonzero(np.isfinite(largest[:-1]))[-1])
            ended[DIVERGED] = color
            axis.plot(edges[end + 1], largest[end], color=color, **CROSS)
    axis.plot([], [], color="black", label="RMS error over the run", **RMS_MARK)
    if published:
        line: Style = {"color": "black", "linestyle": ":", "label": "published RMS error"}
        axis.axhline(published.value, **line)
    hide_rounding(axis)
    axis.set_ylim(bottom=min([axis.get_ylim()[0], *(0.5 * rms for rms in marked)]))
    tick_decades(axis.yaxis, *axis.get_ylim(), subs=(1.0, 3.0))
    words = f"largest error of {labels.label_of(output).symbol}"
    words = words if len(words) <= LINE else words.replace(" of ", "\nof ", 1)
    axis.set_ylabel(f"{words}\nin each {period:.2g} s ({labels.unit_of(runs.full, output)})")
    return ended


def _largest(error: xr.DataArray, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Edges (n + 1,) of the periods in s and the largest error in each, the last one repeated."""
    # A sample between two periods belongs to the one that ends there.
    window = np.maximum(np.ceil(error["time"].values / period - 1e-9).astype(int) - 1, 0)
    numbers = np.arange(window[-1] + 1)
    largest = np.array([np.fmax.reduce(error.values[window == k]) for k in numbers])
    return period * np.arange(window[-1] + 2), np.append(largest, largest[-1])


def figure_paths(
    results: Results,
    *,
    methods: Mapping[str, str] | None = None,
    place: Mapping[str, object] | None = None,
    parts: Mapping[str, float | None] | None = None,
) -> Figure:
    """Paths in the plane, and the distances from full order at the same time below.

    Parameters
    ----------
    methods, place
        As of `figure_histories`.
    parts
        Title of a panel -> length in m that it shows; by default one of the whole path.
    """
    (dataset,) = results.values()
    dataset = dataset.sel(place or {})
    missing = sorted(set(PATH) - {str(output) for output in dataset["output"].values})
    if missing:
        raise InputError(f"{dataset.attrs.get('model')} has no path: no output {missing}")
    runs = runs_of(dataset, legend_of(dataset, methods))
    shown: list[tuple[str, float | None]] = list((parts or {"": None}).items())
    if runs.compared:
        shown.append((DISTANCE, shown[0][1]))
    figure, axes = theme.panels(len(shown), 1, (6.7, 1.4 + 1.5 * len(shown)), sharex=not parts)
    for number, (axis, (title, length)) in enumerate(zip(axes.flat, shown, strict=True)):
        axis.set_title(theme.letter(number, title))
        if title == DISTANCE:
            _draw_distances(axis, runs.curves)
        else:
            draw_paths(axis, runs)
            axis.set_ylabel("Y (m)")
        if length:
            axis.set_xlim(0.0, length)
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


def _draw_distances(axis: Axes, curves: Sequence[Curve]) -> None:
    """Distance between the places of a reduced and the full vehicle at the same time, over X."""
    for curve in curves:
        x, y = positions(curve.run["reference_outputs"])
        ahead, aside = positions(curve.run["outputs"])
        away = np.hypot(ahead - x, aside - y)
        away[away == 0.0] = np.nan
        if np.isfinite(away).any():
            axis.semilogy(x, away, label=curve.text, **curve.style)
    hide_rounding(axis)
    axis.set_ylabel("distance (m)")
