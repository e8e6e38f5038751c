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
from vehiclemor.report.criteria.finding import at_point
from vehiclemor.report.figures.error_map import figure_map
from vehiclemor.report.figures.runs import legend_of
from vehiclemor.report.figures.scales import FEW_DECADES, Places, places_of, tick_decades
from vehiclemor.report.figures.theme import (
    CROSS,
    MARKERS,
    THIN,
    ZERO,
    Results,
    Style,
    legend_below,
    letter,
    panels,
    styles,
)
from vehiclemor.report.labels import (
    error_label,
    full_label,
    method_text,
    readable_unit,
    trained_runs,
    unit_of,
)
from vehiclemor.report.published import rms_numbers
from vehiclemor.simulation.trajectory import FINISHED
from vehiclemor.study.plans.study_file import FACTORS, PARAMETER

# Lines of a panel, starts with panels of their own, methods with maps, and sampled quantities.
LINES, STARTS, MAPS, SAMPLED = 8, 3, 4, 3
FLOOR: Style = {"color": "#BBBBBB", "linewidth": 3.5, "zorder": 1.5}


class Panel(NamedTuple):
    """Errors of one output.

    Attributes
    ----------
    errors
        Name of a line -> errors over `axis` and what bands are over.
    texts
        Of the legend.
    """

    dataset: xr.Dataset
    output: str
    title: str
    axis: str
    errors: Mapping[str, xr.DataArray]
    texts: Mapping[str, str]


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
    if methods is None:
        known = [str(label) for label in first["label"].values]
        reduced = [label for label in known if not label.startswith("full_order")]
        methods = {label: method_text(label) for label in reduced}
    methods = {m: text for m, text in methods.items() if m in first["label"].values}
    if not methods:
        raise InputError("full order alone: no errors to draw")
    sizes = _sizes(first)
    if not sizes:
        return _of_a_point(first, methods)
    if sample := next((d for d in sizes if d == "sample" or d.endswith("_seed")), ""):
        return _samples(first, sample, methods, outputs)
    shown: list[Panel] = []
    rest: list[str] = []
    for dataset in results.values():
        axis, *others = _axes(dataset)
        lines = _lines(dataset, methods, others)
        many = len(lines) > max(LINES, len(methods))
        numbers = [d for d in others if np.issubdtype(dataset[d].dtype, np.number)]
        if set(FACTORS) <= set(_sizes(dataset)):
            return _map(dataset, methods, outputs, FACTORS)
        if many and len(others) == len(numbers) == 1 and len(methods) <= MAPS:
            return _map(dataset, methods, outputs, (axis, others[0]))
        if many:
            found = _finished(dataset)
            lines = {m: (text, found.sel(label=m, drop=True)) for m, text in methods.items()}
            rest += [d for d in others if d not in rest]
        shown += _panels(dataset, outputs, axis, lines)
    figure = _curves(shown)
    more = f"medians over {_words(rest)}, bands from the smallest to the largest error"
    return _finish(figure, results, methods, more if rest else "")


def _sizes(dataset: xr.Dataset) -> dict[str, int]:
    """What the study varies, beside the method."""
    sizes = {str(d): dataset.sizes[d] for d in dataset["status"].dims if d != "label"}
    return {name: size for name, size in sizes.items() if size > 1}


def _finished(dataset: xr.Dataset) -> xr.DataArray:
    """RMS errors, infinite where a run has failed."""
    return dataset["rms_error"].where(dataset["status"].isin(FINISHED), np.inf)


def _starts(dataset: xr.Dataset, axis: str) -> bool:
    """Whether each start has a panel."""
    return axis != "start" and 1 < _sizes(dataset).get("start", 1) <= STARTS


def _axes(dataset: xr.Dataset) -> list[str]:
    """The dimension that lines go over, and the others without those of panels."""
    sizes = _sizes(dataset)
    numbers = [d for d in sizes if np.issubdtype(dataset[d].dtype, np.number)]
    axis = max(numbers or sizes, key=lambda d: (d in FACTORS, sizes[d]))
    panels = "start" if _starts(dataset, axis) else ""
    return [axis, *(d for d in sizes if d not in (axis, panels))]


def _lines(
    dataset: xr.Dataset, methods: Mapping[str, str], others: Sequence[str]
) -> dict[str, tuple[str, xr.DataArray]]:
    """A line for each combination of what a method's errors depend on: text, errors."""
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


def _words(dimensions: Sequence[str]) -> str:
    *head, last = (d.removeprefix(PARAMETER).replace("_", " ") for d in dimensions or [""])
    return f"{', '.join(head)} and {last}" if head else last


def _panels(
    dataset: xr.Dataset,
    outputs: Sequence[str],
    axis: str,
    lines: Mapping[str, tuple[str, xr.DataArray]],
) -> list[Panel]:
    """One for each output and start."""
    starts = dataset["start"].values.tolist() if _starts(dataset, axis) else [None]
    texts = {name: text for name, (text, _) in lines.items()}
    found = []
    for output, start in itertools.product(outputs, starts):
        place = {"output": output} | ({} if start is None else {"start": start})
        errors = {name: errors.sel(place) for name, (_, errors) in lines.items()}
        title = "" if start is None else f"{start} start"
        found.append(Panel(dataset, output, title, axis, errors, texts))
    return found


def _curves(shown: Sequence[Panel]) -> Figure:
    """A panel for each output of a study, columns for starts."""
    starts = len({panel.title for panel in shown})
    wide = starts if starts > 1 else min(2, len(shown))
    rows = -(-len(shown) // wide)
    figure, grid = panels(rows, wide, (6.7 if wide < STARTS else 8.5, 2.5 * rows + 0.8))
    for number, (axis, panel) in enumerate(zip(grid.flat, shown, strict=False)):
        places = places_of(panel.dataset, panel.axis)
        axis.set_title(letter(number, panel.title))
        _draw_panel(axis, panel, places)
        places.scale(axis)
        below = shown[number + wide :][:1]
        if below and below[0].axis == panel.axis:
            axis.set_xlabel("")
    for axis in grid.flat[len(shown) :]:
        axis.remove()
    return figure


def _finish(figure: Figure, results: Results, methods: Mapping[str, str], more: str) -> Figure:
    """A line above the panels, how many runs were trained on, and the legend."""
    held = [trained_runs(dataset).sel(label=list(methods)) for dataset in results.values()]
    count, size = sum(int(runs.sum()) for runs in held), sum(runs.size for runs in held)
    trained = f"{count} of {size} runs were in their own training" if count else ""
    if lines := list(filter(None, (more, trained))):
        figure.suptitle("\n".join(lines), fontsize="medium")
    legend_below(figure, figure.axes)
    return figure


def _draw_panel(axis: Axes, panel: Panel, places: Places) -> None:
    """Lines of one output; over perturbations the best approximation and the published error."""
    dataset, output = panel.dataset, panel.output
    values = {
        name: errors.squeeze(drop=True).transpose(panel.axis, ...).values
        for name, errors in panel.errors.items()
    }
    factor, unit = _unit(np.concatenate([v.ravel() for v in values.values()]), dataset, output)
    looks = styles(values)
    for marker, name in zip(itertools.cycle(MARKERS), values):
        look: Style = {**looks[name], "marker": marker, "markersize": 3.5}
        # Names have no order that a line could follow.
        look |= {"linestyle": "none"} if places.names else {}
        draw_errors(axis, places.at, factor * values[name], look, panel.texts[name])
    if panel.axis in FACTORS:
        if "pod" in values and "floor_rms_error" in dataset:
            floor = dataset["floor_rms_error"].sel(label="pod", output=output).squeeze(drop=True)
            if floor.dims == (panel.axis,) and bool(floor.notnull().any()):
                axis.plot(places.at, factor * floor, label="best approximation", **FLOOR)
        if published := rms_numbers(str(dataset.attrs["model"])).get(output):
            axis.axhline(factor * published.value, label="published, nominal", **THIN)
    scale_errors(axis)
    axis.set_ylabel(error_label(dataset, "RMS error", output, unit))


def _unit(values: np.ndarray, dataset: xr.Dataset, output: str) -> tuple[float, str]:
    """Factor and unit in which errors of few decades have few digits."""
    values = values[np.isfinite(values) & (values > 0.0)]
    # Axes are a tenth longer.
    if not values.size or 1.1 * np.log10(values.max() / values.min()) >= FEW_DECADES:
        return 1.0, unit_of(dataset, output)
    return readable_unit(float(np.median(values)), unit_of(dataset, output))


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
            axis.plot(places, np.full(places.size, height), clip_on=False, **(mark | edge))


def scale_errors(axis: Axes) -> None:
    """A logarithmic axis of errors, and last in the legend what it can't show."""
    axis.set_yscale("log")
    tick_decades(axis.yaxis, *axis.get_ylim())
    for mark, text in ((CROSS, "a run has failed"), (ZERO, "error 0, off the log axis")):
        if any(line.get_marker() == mark["marker"] for line in axis.lines):
            axis.plot([], [], color="black", label=text, **mark)


def _largest(dataset: xr.Dataset, kept: Sequence[str]) -> tuple[xr.DataArray, str]:
    """Largest errors over all dimensions but the ones `kept`, and what is said of that."""
    errors = _finished(dataset)
    rest = [str(d) for d in errors.dims if d not in (*kept, "label", "output")]
    several = [d for d in rest if dataset.sizes[d] > 1]
    return errors.max(rest), f"the largest error over {_words(several)}" if several else ""


def _map(
    dataset: xr.Dataset, methods: Mapping[str, str], outputs: Sequence[str], axes: Sequence[str]
) -> Figure:
    errors, words = _largest(dataset, axes)
    figure = figure_map(dataset, errors, methods, outputs, axes)
    crosses = "a cross where a run has failed" if bool(np.isinf(errors).any()) else ""
    more = ", ".join(filter(None, (words, crosses)))
    return _finish(figure, {"": dataset}, methods, more)


def _samples(
    dataset: xr.Dataset, sample: str, methods: Mapping[str, str], outputs: Sequence[str]
) -> Figure:
    """Clouds over what was sampled, or beside each other for each method."""
    errors, words = _largest(dataset, [sample])
    columns = _sampled(dataset, sample, errors.sel(label=list(methods))) or [""]
    size = max(5.0, 1.2 + 2.4 * len(columns)), 2.4 * len(outputs) + 0.9
    figure, grid = panels(len(outputs), len(columns), size, sharex="col", sharey="row")
    looks = styles(methods)
    for number, axis in enumerate(grid.flat):
        row, column = divmod(number, len(columns))
        name = columns[column]
        for place, (label, text) in enumerate(methods.items()):
            values = errors.sel(label=label, output=outputs[row]).values
            # Spread evenly beside each other, the same each time.
            spread = (0.5 + np.arange(values.size) * 0.6180339887) % 1.0
            at = dataset[name].values if name else place + 0.6 * (spread - 0.5)
            look: Style = {"color": looks[label]["color"], "linestyle": "none", "alpha": 0.6}
            look |= {"marker": MARKERS[place % len(MARKERS)], "markersize": 3}
            look |= {"markeredgewidth": 0.0, "rasterized": values.size > 1000}
            draw_errors(axis, at, values, look, text if name else None)
            known = values[np.isfinite(values) & (values > 0.0)]
            if not name and known.size:
                axis.plot(place + np.array([-0.4, 0.4]), np.full(2, np.median(known)), "k-")
        scale_errors(axis)
        axis.set_title(letter(number))
        if name and row == len(outputs) - 1:
            places_of(dataset, name).scale(axis)
        elif not name:
            axis.set_xticks(range(len(methods)), list(methods.values()), fontsize=7)
        if not column:
            axis.set_ylabel(error_label(dataset, "RMS error", outputs[row]))
    count = f"{dataset.sizes[sample]} samples"
    more = ", ".join(filter(None, (count, words)))
    return _finish(figure, {"": dataset}, methods, more)


def _sampled(dataset: xr.Dataset, sample: str, errors: xr.DataArray) -> list[str]:
    """Sampled quantities; of many those that the errors follow most (rank correlation)."""
    from scipy.stats import rankdata

    names = [
        str(name)
        for name, values in dataset.coords.items()
        if values.dims == (sample,) and name != sample and values.dtype.kind == "f"
        if np.ptp(values.values) > 0.0
    ]
    ranks = rankdata(
        errors.transpose(sample, ...).values.reshape(dataset.sizes[sample], -1), axis=0
    ).mean(axis=1)

    def follows(name: str) -> float:
        # Errors that are all the same follow nothing.
        return (
            -abs(np.corrcoef(rankdata(dataset[name].values), ranks)[0, 1]) if np.ptp(ranks) else 0.0
        )

    return sorted(names, key=follows)[:SAMPLED]


def _of_a_point(dataset: xr.Dataset, methods: Mapping[str, str]) -> Figure:
    """RMS errors of all outputs as shares of their ranges, a mark for each method."""
    names = [str(output) for output in dataset["output"].values]
    figure, grid = panels(1, 1, (6.7, 1.6 + 0.19 * len(names)))
    axis, places = grid[0, 0], np.arange(len(names))
    texts, looks = legend_of(dataset, methods), styles(methods)
    for marker, (label, text) in zip(itertools.cycle(MARKERS), texts.items()):
        run = at_point(dataset, label)
        share = run["rms_error"] / run["signal_range"]
        share = 100.0 * share.where(np.isfinite(share) & (share > 0.0)).values
        look: Style = {"color": looks[label]["color"], "marker": marker, "markersize": 5}
        exact = " (error 0)" if bool((run["rms_error"] == 0.0).all()) else ""
        axis.semilogx(share, places, label=text + exact, linestyle="none", **look)
    tick_decades(axis.xaxis, *axis.get_xlim())
    axis.set_yticks(places, map(full_label, names), fontsize=7)
    axis.set_ylim(len(names) - 0.5, -0.5)
    axis.set_xlabel("RMS error (% of the output's range)")
    legend_below(figure, [axis])
    return figure
