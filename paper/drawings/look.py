"""What the paper's figures share: sizes, panels, legends, and the runs that are drawn."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from vehiclemor.report.figures.runs import Runs, runs_of
from vehiclemor.report.figures.theme import COLORS, letter, method_style, panels
from vehiclemor.report.labels import declared, method_text

# Width of a column, and of both, in inches.
ONE, TWO = 8.6 / 2.54, 17.8 / 2.54
BLUE, RED, GREEN, PINK, ORANGE, CYAN = COLORS
THIN: dict[str, Any] = {"color": "black", "linewidth": 0.7}
PUBLISHED: dict[str, Any] = {"color": "black", "linewidth": 0.8, "linestyle": ":"}
BOUND: dict[str, Any] = {"color": "#777777", "linewidth": 0.6}
# Method -> its line, as in all figures.
LINES: Mapping[str, dict[str, Any]] = {
    name: method_style(look) | {"label": look.words} for name, look in declared().methods.items()
}
# Both variants of POD.
TRAINED = "pod", "pod_literal"

Results = Mapping[str, xr.Dataset]


def lettered(
    rows: int, columns: int, width: float, height: float, texts: Iterable[str] = (), **options: Any
) -> tuple[Figure, np.ndarray]:
    """Figure of a size in inches, and its panels (rows, columns) with letters and texts above."""
    figure, grid = panels(rows, columns, (width, height), **options)
    texts = list(texts)
    for number, axis in enumerate(grid.flat):
        axis.set_title(letter(number, texts[number] if number < len(texts) else ""), pad=5)
    return figure, grid


def legend(figure: Figure, axes: Iterable[Axes], columns: int) -> None:
    """One legend below all panels, each text once."""
    lines: dict[str, Any] = {}
    for axis in axes:
        handles, texts = axis.get_legend_handles_labels()
        lines |= dict(zip(texts, handles, strict=True))
    where: dict[str, Any] = {"loc": "outside lower center", "ncols": columns, "borderpad": 0.1}
    figure.legend(lines.values(), lines, **where)


def runs(
    data: xr.Dataset, labels: Iterable[str] = TRAINED, end: float | None = None, **point: object
) -> Runs:
    """Runs of some methods at a point of a study up to a time, beside the full order."""
    texts = {label: method_text(label) for label in labels}
    return runs_of(data.sel(point).sel(label=[*texts], time=slice(0.0, end)), texts)


def decades(axis: Axis, step: int = 2) -> None:
    """A tick every so many decades."""
    axis.set_major_locator(LogLocator(base=10.0**step, numticks=99))
    axis.set_minor_locator(NullLocator())
