"""Errors over two dimensions of a study's grid, as cells in colours."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from vehiclemor.report.figures.scales import places_of, tick_decades
from vehiclemor.report.figures.theme import CROSS, Style, letter, panels
from vehiclemor.report.labels import error_label, readable_unit, unit_of
from vehiclemor.report.published import rms_numbers
from vehiclemor.study.plans.study_file import FACTORS

# Columns of maps, cells of a map with their number, and cells that a contour must enclose.
COLUMNS, WRITTEN, ENCLOSED = 3, 100, 4


def figure_map(
    dataset: xr.Dataset,
    errors: xr.DataArray,
    methods: Mapping[str, str],
    outputs: Sequence[str],
    axes: Sequence[str],
) -> Figure:
    """Errors over two dimensions (across and upwards), a column for each method.

    Of few cells each has its number, and colours leave the nominal input out, whose error is far
    below all others; of many a white line is where the error is the published one.
    """
    errors = errors.transpose("output", "label", *reversed(axes))
    each = -(-len(methods) // COLUMNS)
    columns = -(-len(methods) // each)
    size = 3.35 * columns, 2.8 * each * len(outputs) + 0.3
    figure, grid = panels(each * len(outputs), columns, size, sharex=True, sharey=True)
    across, up = (places_of(dataset, name).even() for name in axes)
    written = across.at.size * up.at.size <= WRITTEN
    # Factors, though not their places, are 1 there.
    one, other = (np.isclose(dataset[name], 1.0) for name in axes)
    nominal = other[:, None] & one & (written and tuple(axes) == FACTORS)
    spare: list[Axes] = []
    for row, output in enumerate(outputs):
        block = grid[row * each : (row + 1) * each]
        found = errors.sel(output=output, label=list(methods)).values
        colored = found[:, ~nominal]
        colored = colored[np.isfinite(colored) & (colored > 0.0)]
        # A map on which nothing differs from zero, or nothing has come to its end, is still one.
        colored = colored if colored.size else np.array([1.0, 10.0])
        factor, unit = 1.0, unit_of(dataset, output)
        if written:
            factor, unit = readable_unit(float(np.median(colored)), unit)
        limits = factor * float(colored.min()), factor * float(colored.max())
        published = rms_numbers(str(dataset.attrs["model"])).get(output)
        for number, (axis, text) in enumerate(zip(block.flat, methods.values(), strict=False)):
            values = factor * found[number]
            _draw_cells(axis, (across.at, up.at), values, LogNorm(*limits), written=written)
            if published and not written and np.sum(values < published.value) >= ENCLOSED:
                logarithms = np.log(np.maximum(values, limits[0]))
                level: Style = {"levels": [np.log(published.value)], "linestyles": "solid"}
                axis.contour(across.at, up.at, logarithms, colors="white", linewidths=1.2, **level)
            axis.set_title(letter(row * len(methods) + number, text))
        bar = figure.colorbar(
            block[0, 0].collections[0],
            ax=block,
            label=error_label(dataset, "RMS error", output, unit),
            extend="min" if nominal.any() else None,
        )
        tick_decades(bar.ax.yaxis, *limits)
        for axis in block[:, 0]:
            up.tick(axis.yaxis)
        spare += block.flat[len(methods) :].tolist()
    for axis in grid.flat if each > 1 else grid[-1]:
        across.tick(axis.xaxis)
        axis.tick_params(labelbottom=True)
    # They share the ticks of the others until these are set.
    for axis in spare:
        axis.remove()
    return figure


def _draw_cells(
    axis: Axes,
    places: tuple[np.ndarray, np.ndarray],
    values: np.ndarray,
    norm: LogNorm,
    *,
    written: bool,
) -> None:
    """Cells in colours, with their numbers if `written`; a run that has failed has a cross."""
    cells = np.where(np.isfinite(values), np.maximum(values, norm.vmin or 0.0), np.nan)
    style: Style = {"cmap": "cividis", "shading": "nearest", "rasterized": True}
    mesh = axis.pcolormesh(*places, cells, norm=norm, **style)
    j, i = np.nonzero(~np.isfinite(values))
    axis.plot(places[0][i], places[1][j], color="#D55E00", **CROSS)
    axis.grid(visible=False)
    for j, i in np.argwhere(np.isfinite(values)) if written else ():
        # Black or white, whichever has more contrast.
        lightness = luminance(mesh.get_cmap()(norm(cells[j, i]))[:3])
        color = "white" if 1.05 / (lightness + 0.05) > (lightness + 0.05) / 0.05 else "black"
        text: Style = {"ha": "center", "va": "center", "fontsize": 7, "color": color}
        axis.text(float(places[0][i]), float(places[1][j]), two_digits(float(values[j, i])), **text)


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
