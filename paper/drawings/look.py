"""What the paper's figures share: sizes, panels, legends, axes and the curves of a study."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from vehiclemor.report.figures.theme import COLORS, letter, method_style
from vehiclemor.report.labels import declared

# Width of a column, and of both, in inches.
ONE, TWO = 8.6 / 2.54, 17.8 / 2.54
BLUE, RED, GREEN, PINK, ORANGE, CYAN = COLORS
FULL: dict[str, Any] = {"color": "black", "linewidth": 2.4, "alpha": 0.35, "label": "full order"}
THIN: dict[str, Any] = {"color": "black", "linewidth": 0.7}
PUBLISHED: dict[str, Any] = {"color": "black", "linewidth": 0.8, "linestyle": ":"}
BOUND: dict[str, Any] = {"color": "#777777", "linewidth": 0.6}
# Method -> its line, as in all figures.
LINES: Mapping[str, dict[str, Any]] = {
    name: method_style(look) | {"label": look.words} for name, look in declared().methods.items()
}
# A logarithmic axis of errors shows so many decades.
DECADES = 6.0

Results = Mapping[str, xr.Dataset]


def panels(
    rows: int, columns: int, width: float, height: float, **options: Any
) -> tuple[Figure, np.ndarray]:
    """Figure of a size in inches, and its panels (rows, columns), lettered."""
    figure = Figure(figsize=(width, height))
    grid = figure.subplots(rows, columns, squeeze=False, **options)
    return figure, grid


def titles(grid: np.ndarray, texts: Iterable[str] = ()) -> None:
    """Letters above the panels, with texts where there are some."""
    texts = list(texts)
    for number, axis in enumerate(grid.flat):
        axis.set_title(letter(number, texts[number] if number < len(texts) else ""), pad=3)


def legend(figure: Figure, axes: Iterable[Axes], columns: int, **options: Any) -> None:
    """One legend below all panels, each text once."""
    found = {text: h for a in axes for h, text in zip(*a.get_legend_handles_labels(), strict=True)}
    where: dict[str, Any] = {"loc": "outside lower center", "ncols": columns, "borderpad": 0.1}
    figure.legend(found.values(), found, **(where | options))


def history(axis: Axes, runs: xr.Dataset, output: str, labels: Iterable[str], scale: float) -> None:
    """One output of full order and reduced models over the time, times a scale."""
    reference = runs["reference_outputs"].sel(output=output)
    full = reference.isel(label=int(reference.notnull().any("time").argmax("label")))
    axis.plot(full["time"], scale * full, **FULL)
    low, high = scale * float(full.min()), scale * float(full.max())
    reach = 0.25 * (high - low)
    for label in labels:
        values = scale * runs["outputs"].sel(label=label, output=output).values
        # A curve ends where it first leaves the neighbourhood of the signal.
        outside = ~((values > low - 3.0 * reach) & (values < high + 3.0 * reach))
        gone = np.cumsum(outside) > 0
        axis.plot(full["time"], np.where(gone, np.nan, values), **LINES[label])
        if gone.any():
            last = max(0, int(np.argmax(gone)) - 1)
            at = full["time"].values[last], np.clip(values[last], low - reach, high + reach)
            axis.plot(*at, "x", color=LINES[label]["color"], label="diverges")


def error(runs: xr.Dataset, output: str, label: str) -> np.ndarray:
    """Error (time,) of one output of a reduced model."""
    run = runs.sel(label=label, output=output)
    return (run["outputs"] - run["reference_outputs"]).values


def largest(time: np.ndarray, errors: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Ends of control periods, and the largest error in each; a sample at an end is of the first.

    The first value is repeated for lines that are drawn as steps.
    """
    window = np.maximum(np.ceil(time / period - 1e-9).astype(int) - 1, 0)
    _, first = np.unique(window, return_index=True)
    most = np.fmax.reduceat(abs(errors), first)
    most[most == 0.0] = np.nan
    return period * np.arange(len(most) + 1), np.append(most[:1], most)


def errors_in_periods(
    axis: Axes, runs: xr.Dataset, output: str, labels: Iterable[str], period: float, bound: float
) -> None:
    """Largest errors in each control period; RMS errors of the run as marks at the right edge."""
    labels, tops = list(labels), [bound]
    # Marks side by side within the axes.
    for number, label in enumerate(labels):
        ends, most = largest(runs["time"].values, error(runs, output, label), period)
        axis.semilogy(ends, most, drawstyle="steps-pre", **LINES[label])
        tops.append(float(np.nanmax(most)))
        rms = float(runs["rms_error"].sel(label=label, output=output))
        if np.isfinite(rms):
            mark = {"color": LINES[label]["color"], "marker": "<", "markersize": 4.5}
            place = 0.985 - 0.05 * number, rms
            axis.plot(*place, linestyle="none", transform=axis.get_yaxis_transform(), **mark)
    axis.axhline(bound, label="published RMS error", **PUBLISHED)
    axis.plot([], [], "<", color="black", markersize=4.5, label="RMS error of the run")
    axis.set_ylim(10.0 ** (np.log10(max(tops)) - DECADES), 2.0 * max(tops))


def decades(axis: Axes, step: int = 2) -> None:
    """Every so many decades a tick of the vertical axis."""
    axis.yaxis.set_major_locator(LogLocator(base=10.0**step, numticks=99))
    axis.yaxis.set_minor_locator(NullLocator())
