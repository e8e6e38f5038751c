"""Errors of any model over two dimensions of a study's grid, one column for each method."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import Colormap, LogNorm
from matplotlib.figure import Figure

from vehiclemor.report.figures.lines import CROSS, Results, Style, letter, panels
from vehiclemor.report.figures.places import places_of, tick_decades
from vehiclemor.report.labels import error_label, readable_unit, unit_of
from vehiclemor.report.published import rms_numbers
from vehiclemor.study.plans.study_file import FACTORS

# Most columns; points of a contour in a cell, and cells that it must enclose.
COLUMNS, FINE, ENCLOSED = 3, 8, 4


def figure_error_map(
    results: Results,
    *,
    outputs: Sequence[str],
    methods: Mapping[str, str],
    values: bool = False,
    axes: tuple[str, str] = FACTORS,
) -> Figure:
    """RMS errors over two dimensions, one column for each method; crosses where a run has failed.

    Parameters
    ----------
    outputs
        One row of panels each.  A published number is drawn as a white line.
    methods
        Label of a method in the study -> title of its column.
    values
        Write the error into each cell instead; the colours then leave the nominal input out,
        whose error is far below all others.
    axes
        Dimensions, across and upwards: by default the perturbations.
    """
    (dataset,) = results.values()
    each = -(-len(methods) // COLUMNS)
    columns = -(-len(methods) // each)
    size = (3.35 * columns, 2.8 * each * len(outputs))
    figure, grid = panels(each * len(outputs), columns, size, sharex=True, sharey=True)
    published = rms_numbers(str(dataset.attrs["model"]))
    across, up = (places_of(dataset, name).even() for name in axes)
    nominal = np.isclose(up.at, 0.0)[:, None] & np.isclose(across.at, 0.0)
    nominal &= tuple(axes) == FACTORS
    spare: list[Axes] = []
    for row, output in enumerate(outputs):
        block = grid[row * each : (row + 1) * each]
        errors = np.array([_errors(dataset, method, output, axes) for method in methods])
        shown = errors[:, ~nominal] if values else errors
        shown = shown[np.isfinite(shown) & (shown > 0.0)]
        # A map on which nothing differs from zero, or nothing has come to its end, is still one.
        shown = shown if shown.size else np.array([1.0, 10.0])
        factor, unit = 1.0, unit_of(dataset, output)
        if values:
            factor, unit = readable_unit(float(np.median(shown)), unit)
        limits = factor * float(shown.min()), factor * float(shown.max())
        bound = published[output].value if output in published and not values else None
        for axis, found in zip(block.flat, factor * errors, strict=False):
            mesh = _draw(axis, (across.at, up.at), found, LogNorm(*limits))
            if values:
                _write(axis, (across.at, up.at), found, (mesh.get_cmap(), LogNorm(*limits)))
            elif bound is not None and np.isfinite(found).all():
                _outline(axis, across.at, up.at, np.maximum(found, limits[0]), bound)
        label = error_label(dataset, "RMS error", output, unit)
        extend = "min" if values and nominal.any() else None
        bar = figure.colorbar(block[0, 0].collections[0], ax=block, label=label, extend=extend)
        tick_decades(bar.ax.yaxis, *limits)
        for axis in block[:, 0]:
            up.tick(axis.yaxis)
        for number, text in enumerate(methods.values()):
            block.flat[number].set_title(f"{letter(row * len(methods) + number)} {text}")
        spare += block.flat[len(methods) :].tolist()
    for axis in grid.flat if each > 1 else grid[-1]:
        across.tick(axis.xaxis)
        axis.tick_params(labelbottom=True)
    # They share the ticks of the others until these are set.
    for axis in spare:
        axis.remove()
    return figure


def _draw(
    axis: Axes, places: tuple[np.ndarray, np.ndarray], values: np.ndarray, norm: LogNorm
) -> QuadMesh:
    """Cells in colours; a run that has failed has none, and a cross."""
    cells = np.where(np.isfinite(values), np.maximum(values, norm.vmin or 0.0), np.nan)
    style: Style = {"cmap": "cividis", "shading": "nearest", "rasterized": True}
    mesh = axis.pcolormesh(*places, cells, norm=norm, **style)
    j, i = np.nonzero(~np.isfinite(values))
    axis.plot(places[0][i], places[1][j], color="#D55E00", **CROSS)
    axis.grid(visible=False)
    return mesh


def _errors(dataset: xr.Dataset, method: str, output: str, axes: tuple[str, str]) -> np.ndarray:
    """RMS errors (upwards, across)."""
    chosen = dataset["rms_error"].sel(label=method, output=output)
    return chosen.squeeze(drop=True).transpose(*reversed(axes)).values


def _outline(
    axis: Axes, frequency: np.ndarray, amplitude: np.ndarray, values: np.ndarray, bound: float
) -> None:
    """Where the error has a value: its logarithm is interpolated between the cells."""
    from scipy.interpolate import RectBivariateSpline

    if np.sum(values < bound) < ENCLOSED:
        return
    fine = [np.linspace(a[0], a[-1], FINE * len(a)) for a in (amplitude, frequency)]
    degrees = {f"k{axis}": min(2, n - 1) for axis, n in zip("xy", values.shape, strict=True)}
    smooth = RectBivariateSpline(amplitude, frequency, np.log(values), **degrees)(*fine)
    lines: Style = {"colors": "white", "linewidths": 1.2, "linestyles": "solid"}
    axis.contour(fine[1], fine[0], smooth, levels=[np.log(bound)], **lines)


def two_digits(value: float) -> str:
    """A number with two significant digits, below a hundredth with one, without an exponent."""
    if value == 0.0:
        return "0"
    rounded = float(f"{value:.1e}")
    decimals = (1 if rounded >= 0.01 else 0) - int(np.floor(np.log10(abs(rounded))))
    return f"{value:.{max(0, decimals)}f}"


def _write(
    axis: Axes,
    places: tuple[np.ndarray, np.ndarray],
    values: np.ndarray,
    colors: tuple[Colormap, LogNorm],
) -> None:
    """Errors with two digits, in black or white, whichever has more contrast with the cell."""
    paint, norm = colors
    for (j, i), value in np.ndenumerate(values):
        if not np.isfinite(value):
            continue
        lightness = luminance(paint(norm(max(value, norm.vmin or 0.0)))[:3])
        color = "white" if 1.05 / (lightness + 0.05) > (lightness + 0.05) / 0.05 else "black"
        style: Style = {"ha": "center", "va": "center", "fontsize": 7, "color": color}
        axis.text(float(places[0][i]), float(places[1][j]), two_digits(float(value)), **style)


def luminance(color: Sequence[float]) -> float:
    """Relative luminance of a colour (red, green, blue), as WCAG 2 defines it."""
    parts = np.asarray(color, dtype=float)
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])
