"""Errors over two dimensions of a study's grid, as cells in colours."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from vehiclemor.report.figures.scales import Places, places_of, tick_decades
from vehiclemor.report.figures.theme import CROSS, Style, letter, panels
from vehiclemor.report.labels import error_label, readable_unit, unit_of
from vehiclemor.report.published import rms_numbers

# Columns of maps, cells of a map with their number, and cells that a contour must enclose.
COLUMNS, WRITTEN, ENCLOSED = 3, 100, 4
# In % of the cells, those whose small errors the colours leave out; luminance of a colour on which
# white has more contrast than black.
LEAST, DARK = 2.0, 0.179


def figure_map(
    dataset: xr.Dataset,
    errors: xr.DataArray,
    methods: Mapping[str, str],
    outputs: Sequence[str],
    axes: Sequence[str],
) -> Figure:
    """Errors over two dimensions (across and upwards), a column for each method.

    Of few cells each has its number; of many a white line is where the error is the published one.
    Colours leave out the least errors, as that of replay's training run, far below all others.
    """
    errors = errors.squeeze([d for d in errors.dims if d not in ("output", "label", *axes)])
    errors = errors.transpose("output", "label", *reversed(axes))
    each = -(-len(methods) // COLUMNS)
    columns = -(-len(methods) // each)
    size = 3.35 * columns, 2.8 * each * len(outputs) + 0.3
    figure, grid = panels(each * len(outputs), columns, size, sharex=True, sharey=True)
    across, up = (places_of(dataset, name).even() for name in axes)
    written = across.at.size * up.at.size <= WRITTEN
    for row, output in enumerate(outputs):
        block = grid[row * each : (row + 1) * each]
        found = errors.sel(output=output, label=list(methods)).values
        # A map on which nothing differs from zero, or nothing has come to its end, is still one.
        colored = found[np.isfinite(found) & (found > 0.0)]
        colored = colored if colored.size else np.array([1.0, 10.0])
        factor, unit = 1.0, unit_of(dataset, output)
        if written:
            factor, unit = readable_unit(float(np.median(colored)), unit)
        low, high = factor * np.percentile(colored, (LEAST, 100.0), method="nearest")
        norm = LogNorm(low, high, clip=True)
        published = rms_numbers(str(dataset.attrs["model"])).get(output)
        for number, (axis, text) in enumerate(zip(block.flat, methods.values(), strict=False)):
            _draw_cells(axis, across, up, factor * found[number], norm, written=written)
            if published and not written and np.sum(found[number] < published.value) >= ENCLOSED:
                lines: Style = {"levels": [np.log(published.value)], "linestyles": "solid"}
                logarithms = np.log(np.maximum(found[number], low))
                axis.contour(across.at, up.at, logarithms, colors="white", linewidths=1.2, **lines)
            axis.set_title(letter(row * len(methods) + number, text))
        bar = figure.colorbar(
            block[0, 0].collections[0],
            ax=block,
            label=error_label(dataset, "RMS error", output, unit),
            extend="min" if factor * colored.min() < low else None,
        )
        tick_decades(bar.ax.yaxis, low, high)
        for axis in block[:, 0]:
            up.tick(axis.yaxis)
    for axis in grid.flat if each > 1 else grid[-1]:
        across.tick(axis.xaxis)
        axis.tick_params(labelbottom=True)
    # They share the ticks of the others until these are set.
    for axis in grid.flat:
        if not axis.collections:
            axis.remove()
    return figure


def _draw_cells(
    axis: Axes, across: Places, up: Places, values: np.ndarray, norm: LogNorm, *, written: bool
) -> None:
    """Cells in colours, with their numbers if `written`; a run that has failed has a cross."""
    failed = ~np.isfinite(values)
    style: Style = {"cmap": "cividis", "shading": "nearest", "rasterized": True}
    cells = np.where(failed, np.nan, np.maximum(values, norm.vmin or 0.0))
    mesh = axis.pcolormesh(across.at, up.at, cells, norm=norm, **style)
    j, i = np.nonzero(failed)
    axis.plot(across.at[i], up.at[j], color="#D55E00", **CROSS)
    axis.grid(visible=False)
    for j, i in np.argwhere(~failed) if written else ():
        color = "white" if luminance(mesh.get_cmap()(norm(cells[j, i]))[:3]) < DARK else "black"
        text: Style = {"ha": "center", "va": "center", "fontsize": 7, "color": color}
        axis.text(across.at[i], up.at[j], two_digits(float(values[j, i])), **text)


def luminance(color: ArrayLike) -> float:
    """Relative luminance of a colour (red, green, blue), as WCAG 2 defines it."""
    parts = np.asarray(color, dtype=float)
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def two_digits(value: float) -> str:
    """A number with two significant digits, below a hundredth with one, without an exponent."""
    if value == 0.0:
        return "0"
    rounded = float(f"{value:.1e}")
    decimals = (1 if rounded >= 0.01 else 0) - int(np.floor(np.log10(abs(rounded))))
    return f"{value:.{max(0, decimals)}f}"
