"""Errors of any study over what it varies or samples, or of one point.

Which picture it is follows from the dimensions of the study's grid, whatever model and methods it
has: curves over one, bands where more varies, a map over two, clouds over samples.
"""

import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vehiclemor.errors import InputError
from vehiclemor.report import labels
from vehiclemor.report.figures import theme
from vehiclemor.report.figures.error_map import figure_map
from vehiclemor.report.figures.runs import legend_of
from vehiclemor.report.figures.scales import FEW_DECADES, Places, places_of, tick_decades
from vehiclemor.report.figures.theme import CROSS, MARKERS, THIN, ZERO, Results, Style
from vehiclemor.report.findings import at_point
from vehiclemor.report.published import rms_numbers
from vehiclemor.simulation.trajectory import FINISHED
from vehiclemor.study.plans.study_file import FACTORS, PARAMETER

# Lines of a panel, starts with panels of their own, methods with maps, and sampled quantities.
LINES, STARTS, MAPS, SAMPLED = 8, 3, 4, 3
# Between marks of two lines above the axes, as a share of their height.
SHIFT = 0.025
FLOOR: Style = {"color": "#BBBBBB", "linewidth": 3.5, "zorder": 1.5, "label": "best approximation"}
# Text, errors on the dimensions output, start, the axis, and what bands are over.
Lines = Mapping[str, tuple[str, xr.DataArray]]


class Panel(NamedTuple):
    """Errors of one output over a dimension `axis`, whose values stand at `places`."""

    dataset: xr.Dataset
    output: str
    title: str
    axis: str
    places: Places
    lines: Lines


def figure_errors(
    results: Results, *, outputs: Sequence[str], methods: Mapping[str, str] | None = None
) -> Figure:
    """RMS errors of studies over all that they vary.

    Parameters
    ----------
    methods
        Labels with their texts; by default all but the full order.
    """
    first = next(iter(results.values()))
    if not {"rms_error", "signal_range"} <= set(first):
        raise InputError("no errors in this result: it was not compared with full order")
    known = {str(label): labels.method_text(str(label)) for label in first["label"].values}
    reduced = {m: text for m, text in known.items() if not m.startswith("full_order")}
    methods = {m: text for m, text in (methods or reduced or known).items() if m in known}
    if not _sizes(first):
        return _of_a_point(first, reduced and methods)
    shown: list[Panel] = []
    more: list[str] = []
    for dataset in results.values():
        axis, *others = _axes(dataset)
        sample, across = _is_sample(axis), ()
        lines = {} if sample else _lines(dataset, methods, others)
        if not sample and set(FACTORS) <= {axis, *others}:
            across = FACTORS
        elif sample or len(lines) > max(LINES, len(methods)):
            errors, words = _largest(dataset, [axis]) if sample else (_finished(dataset), "")
            lines = {m: (text, errors.sel(label=m, drop=True)) for m, text in methods.items()}
            medians = f"medians over {_words(others)}, bands from the smallest to the largest error"
            more += [f"{dataset.sizes[axis]} samples", words] if sample else [medians]
            numbers = [d for d in others if np.issubdtype(dataset[d].dtype, np.number)]
            if not sample and len(others) == len(numbers) == 1 and len(methods) <= MAPS:
                across = axis, others[0]
        if across:
            errors, words = _largest(dataset, across)
            more = [words, "a cross where a run has failed" * bool(np.isinf(errors).any())]
            figure = figure_map(dataset, errors, methods, outputs, across)
            return _finish(figure, results, methods, more)
        shown += _panels(dataset, outputs, axis, lines)
    columns = len(shown) // len(outputs) // len(results)
    return _finish(_figure(shown, columns), results, methods, more)


def _sizes(dataset: xr.Dataset) -> dict[str, int]:
    """What the study varies, beside the method."""
    sizes = {str(d): dataset.sizes[d] for d in dataset["status"].dims if d != "label"}
    return {name: size for name, size in sizes.items() if size > 1}


def _is_sample(dimension: str) -> bool:
    """Whether places of a dimension have no order."""
    return dimension == "sample" or dimension.endswith("_seed")


def _finished(dataset: xr.Dataset) -> xr.DataArray:
    """RMS errors, infinite where a run has failed."""
    return dataset["rms_error"].where(dataset["status"].isin(FINISHED), np.inf)


def _largest(dataset: xr.Dataset, kept: Sequence[str]) -> tuple[xr.DataArray, str]:
    """Largest errors over all dimensions but the ones `kept`, and what is said of that."""
    rest = [d for d in _sizes(dataset) if d not in kept]
    errors = _finished(dataset).max(rest)
    single = [d for d in errors.dims if d not in (*kept, "label", "output")]
    words = f"the largest error over {_words(rest)}" if rest else ""
    return errors.squeeze(single, drop=True), words


def _words(dimensions: Sequence[str]) -> str:
    *head, last = (d.removeprefix(PARAMETER).replace("_", " ") for d in dimensions or [""])
    return f"{', '.join(head)} and {last}" if head else last


def _starts(dataset: xr.Dataset, axis: str) -> bool:
    """Whether each start has a panel."""
    return axis != "start" and 1 < _sizes(dataset).get("start", 1) <= STARTS


def _axes(dataset: xr.Dataset) -> list[str]:
    """The dimension that lines go over, and the others without those of panels."""
    sizes = _sizes(dataset)
    numbers = [d for d in sizes if np.issubdtype(dataset[d].dtype, np.number)]
    largest = max(numbers or sizes, key=lambda d: (d in FACTORS, sizes[d]))
    axis = next(filter(_is_sample, sizes), largest)
    panels = "start" if _starts(dataset, axis) and not _is_sample(axis) else ""
    return [axis, *(d for d in sizes if d not in (axis, panels))]


def _lines(dataset: xr.Dataset, methods: Mapping[str, str], others: Sequence[str]) -> Lines:
    """A line for each combination of what a method's errors depend on."""
    found: dict[str, tuple[str, xr.DataArray]] = {}
    for label, text in methods.items():
        errors = _finished(dataset).sel(label=label, drop=True)
        own = [d for d in others if not bool((errors == errors.isel({d: 0})).all())]
        errors = errors.isel({d: 0 for d in others if d not in own}, drop=True)
        units = [str(errors[d].attrs.get("units", "")).removesuffix("1") for d in own]
        for place in itertools.product(*(errors[d].values.tolist() for d in own)):
            values = [v if isinstance(v, str) else f"{v:g}" for v in place]
            parts = zip(map(_words, zip(own)), values, units, strict=True)
            words = [" ".join(filter(None, part)) for part in parts]
            chosen = errors.sel(dict(zip(own, place, strict=True)), drop=True)
            found[", ".join([label, *words])] = ", ".join([text, *words]), chosen
    return found


def _panels(dataset: xr.Dataset, outputs: Sequence[str], axis: str, lines: Lines) -> list[Panel]:
    """One for each output and start, or for each output and sampled quantity."""
    if _is_sample(axis):
        names = _sampled(dataset, axis, lines)
        every = [places_of(dataset, name) for name in names]
        # What has no quantity is sorted.
        numbers = np.arange(dataset.sizes[axis])
        every = every or [Places(numbers, f"{_words([axis])}, sorted by error")]
        parts = [("", places, lines) for places in every]
    else:
        starts = dataset["start"].values.tolist() if _starts(dataset, axis) else [None]
        parts = []
        for start in starts:
            place = {} if start is None else {"start": start}
            chosen = {name: (text, e.sel(place)) for name, (text, e) in lines.items()}
            title = "" if start is None else f"{start} start"
            parts.append((title, places_of(dataset, axis), chosen))
    return [
        Panel(dataset, output, title, axis, places, chosen)
        for output in outputs
        for title, places, chosen in parts
    ]


def _sampled(dataset: xr.Dataset, sample: str, lines: Lines) -> list[str]:
    """Sampled quantities; of many those that the errors follow most (rank correlation)."""
    names = [
        str(name)
        for name, values in dataset.coords.items()
        if values.dims == (sample,) and name != sample and values.dtype.kind == "f"
        if np.ptp(values.values) > 0.0
    ]
    errors = [e.transpose(sample, ...).values for _, e in lines.values()]
    ranks = np.concatenate(errors, axis=1).mean(axis=1).argsort().argsort()

    def follows(name: str) -> float:
        return abs(np.corrcoef(dataset[name].values.argsort().argsort(), ranks)[0, 1])

    return sorted(names, key=follows, reverse=True)[:SAMPLED] if len(names) > SAMPLED else names


def _figure(shown: Sequence[Panel], columns: int) -> Figure:
    """Panels in columns, outputs beside each other where there is room."""
    wide = columns if columns > 1 else min(2, len(shown))
    rows = -(-len(shown) // wide)
    figure, grid = theme.panels(rows, wide, (6.7 if wide < 3 else 8.5, 2.5 * rows + 0.8))
    for number, (axis, panel) in enumerate(zip(grid.flat, shown, strict=False)):
        axis.set_title(theme.letter(number, panel.title))
        _draw_panel(axis, panel)
        panel.places.scale(axis)
        below = shown[number + wide :][:1]
        if below and below[0].places.label == panel.places.label:
            axis.set_xlabel("")
    for axis in grid.flat[len(shown) :]:
        axis.remove()
    return figure


def _finish(
    figure: Figure, results: Results, methods: Mapping[str, str], more: Sequence[str]
) -> Figure:
    """A line above the panels, how many runs were trained on, and the legend."""
    held = [labels.trained_runs(dataset).sel(label=list(methods)) for dataset in results.values()]
    count, size = sum(int(runs.sum()) for runs in held), sum(runs.size for runs in held)
    trained = f"{count} of {size} runs were in their own training" if count else ""
    lines = filter(None, (", ".join(filter(None, more)), trained))
    if words := "\n".join(lines):
        figure.suptitle(words, fontsize="medium")
    theme.legend_below(figure, figure.axes)
    return figure


def _draw_panel(axis: Axes, panel: Panel) -> None:
    """Lines of one output; over perturbations the best approximation and the published error."""
    dataset, output, places = panel.dataset, panel.output, panel.places
    cloud = _is_sample(panel.axis)
    errors = {n: e.sel(output=output).squeeze(drop=True) for n, (_, e) in panel.lines.items()}
    values = {name: e.transpose(panel.axis, ...).values for name, e in errors.items()}
    if cloud and panel.places.label.endswith("sorted by error"):
        values = {name: np.sort(v) for name, v in values.items()}
    every = np.concatenate([v.ravel() for v in values.values()])
    factor, unit = (1.0, "") if cloud else _unit(every, labels.unit_of(dataset, output))
    looks = theme.styles(values)
    for marker, (name, (text, _)) in zip(itertools.cycle(MARKERS), panel.lines.items()):
        look: Style = {**looks[name], "marker": marker, "markersize": 3.5}
        # Names and samples have no order that a line could follow.
        look |= {"linestyle": "none"} if places.names or cloud else {}
        if cloud:
            look |= {"alpha": 0.6, "markeredgewidth": 0.0, "rasterized": len(places.at) > 1000}
        draw_errors(axis, places.at, factor * values[name], look, text)
    if panel.axis in FACTORS:
        if "pod" in values and "floor_rms_error" in dataset:
            floor = dataset["floor_rms_error"].sel(label="pod", output=output).squeeze(drop=True)
            if floor.dims == (panel.axis,) and bool(floor.notnull().any()):
                axis.plot(places.at, factor * floor, **FLOOR)
        if published := rms_numbers(str(dataset.attrs["model"])).get(output):
            axis.axhline(factor * published.value, label="published, nominal", **THIN)
    scale_errors(axis)
    axis.set_ylabel(labels.error_label(dataset, "RMS error", output, unit))


def _unit(values: np.ndarray, unit: str) -> tuple[float, str]:
    """Factor and unit in which errors of few decades have few digits."""
    values = values[np.isfinite(values) & (values > 0.0)]
    # Axes are a tenth longer.
    if not values.size or 1.1 * np.log10(values.max() / values.min()) >= FEW_DECADES:
        return 1.0, unit
    return labels.readable_unit(float(np.median(values)), unit)


def draw_band(
    axis: Axes, at: np.ndarray, values: np.ndarray, look: Style, text: str | None
) -> None:
    """Medians of values (places, others), and a band from the smallest to the largest."""
    values = values.reshape(len(at), -1)
    known = np.where(np.isfinite(values) & (values > 0.0), values, np.nan)
    some = np.isfinite(known).any(axis=1)
    middle = np.full(len(at), np.nan)
    middle[some] = np.nanmedian(known[some], axis=1)
    axis.plot(at, middle, label=text, **look)
    if values.shape[1] > 1:
        low, high = (f(known[some], axis=1) for f in (np.nanmin, np.nanmax))
        axis.fill_between(at[some], low, high, color=look["color"], alpha=0.15, linewidth=0.0)


def draw_errors(
    axis: Axes, at: np.ndarray, values: np.ndarray, look: Style, text: str | None
) -> None:
    """A line or cloud of errors; crosses above it and triangles below for what a log can't show."""
    draw_band(axis, at, values, look, text)
    values = values.reshape(len(at), -1)
    edge: Style = {"color": look["color"], "transform": axis.get_xaxis_transform()}
    for mark, height, found in ((CROSS, 1.0, ~np.isfinite(values)), (ZERO, 0.0, values == 0.0)):
        places = at[found.any(axis=1)]
        if places.size:
            # Above those of other lines.
            others = sum(line.get_marker() == mark["marker"] for line in axis.lines)
            at_edge = np.full(places.size, height + SHIFT * others)
            axis.plot(places, at_edge, clip_on=False, **(mark | edge))


def scale_errors(axis: Axes) -> None:
    """A logarithmic axis of errors, and last in the legend what it can't show."""
    axis.set_yscale("log")
    tick_decades(axis.yaxis, *axis.get_ylim())
    for mark, text in ((CROSS, "a run has failed"), (ZERO, "error 0, off the log axis")):
        if any(line.get_marker() == mark["marker"] for line in axis.lines):
            axis.plot([], [], color="black", label=text, **mark)


def _of_a_point(dataset: xr.Dataset, methods: Mapping[str, str]) -> Figure:
    """RMS errors of all outputs as shares of their ranges, a mark for each method."""
    if not methods:
        raise InputError("full order alone: no errors to draw")
    names = [str(output) for output in dataset["output"].values]
    figure, grid = theme.panels(1, 1, (6.7, 1.6 + 0.19 * len(names)))
    axis, places = grid[0, 0], np.arange(len(names))
    texts, looks = legend_of(dataset, methods), theme.styles(methods)
    for marker, (label, text) in zip(itertools.cycle(MARKERS), texts.items()):
        run = at_point(dataset, label)
        share = run["rms_error"] / run["signal_range"]
        share = 100.0 * share.where(np.isfinite(share) & (share > 0.0)).values
        look: Style = {"color": looks[label]["color"], "marker": marker, "markersize": 5}
        exact = " (error 0)" if bool((run["rms_error"] == 0.0).all()) else ""
        axis.semilogx(share, places, label=text + exact, linestyle="none", **look)
    tick_decades(axis.xaxis, *axis.get_xlim())
    axis.set_yticks(places, map(labels.full_label, names), fontsize=7)
    axis.set_ylim(len(names) - 0.5, -0.5)
    axis.set_xlabel("RMS error (% of the output's range)")
    theme.legend_below(figure, [axis])
    return figure
