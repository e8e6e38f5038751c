"""Errors of any model over the axes of a study's grid: curves and maps."""

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import Colormap, LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from vehiclemor.report.figures.lines import Results, Style, legend_outside, letter, panels, styles
from vehiclemor.report.labels import error_label, readable_unit, unit_of
from vehiclemor.report.published import rms_numbers
from vehiclemor.study.plans.study_file import FACTORS

MARKERS = {"pod": "o", "pod_literal": "x", "fixed_basis": "s", "replay": "."}
UNITS = {"control_period": " (s)"}
FLOOR: Style = {"color": "#BBBBBB", "linewidth": 3.5, "zorder": 1.5}
NOTHING: Style = {"marker": 7, "markersize": 7, "linestyle": "none", "clip_on": False}
# Decades up to which a colour bar has 1, 2 and 5 of each; points of a contour in a cell, and cells
# that it must enclose.
FEW_DECADES, FINE, ENCLOSED = 2.5, 8, 4


def figure_error_curves(
    results: Results,
    *,
    outputs: Sequence[str],
    methods: Mapping[str, str],
    axis: str = "",
    legend: Literal["upper", "lower"] = "upper",
) -> Figure:
    """RMS errors against one axis of the grid: panels for each study and output.

    Parameters
    ----------
    axis
        Dimension; by default the factor that is perturbed.
    legend
        `upper` or `lower` edge.
    """
    contents = [(dataset, output) for dataset in results.values() for output in outputs]
    columns = min(2, len(contents))
    rows = -(-len(contents) // columns)
    figure, axes = panels(rows, columns, (6.7, 2.6 * rows))
    for number, (panel, (dataset, output)) in enumerate(zip(axes.flat, contents, strict=False)):
        dimension = axis or max(FACTORS, key=lambda name: dataset.sizes[name])
        _draw_curves(panel, dataset.sel(output=output), methods, dimension)
        panel.set_ylabel(error_label(dataset, "RMS error", output))
        published = rms_numbers(str(dataset.attrs["model"]))
        if output in published:
            line: Style = {"color": "black", "linewidth": 0.8, "label": "published, nominal"}
            panel.axhline(published[output].value, **line)
        panel.set_title(letter(number))
    for panel in axes.flat[len(contents) :]:
        panel.remove()
    legend_outside(figure, figure.axes, 2, legend)
    return figure


def _draw_curves(axis: Axes, chosen: xr.Dataset, methods: Mapping[str, str], factor: str) -> None:
    """Errors of one output; a triangle below the logarithmic axis where the error is 0."""
    places = chosen[factor].values
    if factor in FACTORS:
        places = 100.0 * (places - 1.0)
        axis.set_xlabel(f"{factor.split('_', maxsplit=1)[0]} perturbation (%)")
    else:
        axis.set_xlabel(factor.replace("_", " ") + UNITS.get(factor, ""))
        axis.locator_params(axis="x", integer=places.dtype.kind == "i")
    for method, style in styles(methods).items():
        errors = chosen["rms_error"].sel({"method": method}).squeeze(drop=True).values
        shown = np.where(errors > 0.0, errors, np.nan)
        marked = {"label": methods[method], "marker": MARKERS.get(method, "^")}
        axis.semilogy(places, shown, markersize=3, **marked, **style)
        none = places[errors == 0.0]
        if none.size:
            below = {"color": style["color"], "transform": axis.get_xaxis_transform()}
            axis.plot(
                none,
                np.zeros(none.size),
                label=f"{methods[method]}: error 0, off the log axis",
                **below,
                **NOTHING,
            )
    if "pod" in methods:
        floor = chosen["floor_rms_error"].sel({"method": "pod"}).squeeze(drop=True).values
        if np.isfinite(floor).any():
            axis.semilogy(places, floor, label="best approximation, control periods", **FLOOR)


def figure_error_map(
    results: Results, *, outputs: Sequence[str], methods: Mapping[str, str], values: bool = False
) -> Figure:
    """RMS errors over frequency and amplitude perturbations, one column for each method.

    Parameters
    ----------
    outputs
        One row of panels each.  A published number is drawn as a white line.
    methods
        Label of a method in the study -> title of its column.
    values
        Write the error into each cell instead; the colours then leave the nominal input out,
        whose error is far below all others.
    """
    (dataset,) = results.values()
    shape = len(outputs), len(methods)
    size = ((3.35 if len(methods) < 4 else 2.4) * len(methods), 2.8 * len(outputs))
    figure, axes = panels(*shape, size, sharex=True, sharey=True)
    published = rms_numbers(str(dataset.attrs["model"]))
    frequency, amplitude = (100.0 * (dataset[factor].values - 1.0) for factor in FACTORS)
    nominal = np.isclose(amplitude, 0.0)[:, None] & np.isclose(frequency, 0.0)
    for row, output in enumerate(outputs):
        errors = np.array([_errors(dataset, method, output) for method in methods])
        shown = errors[:, ~nominal] if values else errors
        factor, unit = readable_unit(float(np.nanmedian(shown)), unit_of(dataset, output))
        if not values:
            factor, unit = 1.0, unit_of(dataset, output)
        errors, shown = factor * errors, factor * shown
        limits = float(np.nanmin(shown[shown > 0.0])), float(np.nanmax(shown))
        norm = LogNorm(*limits)
        for axis, found in zip(axes[row], errors, strict=True):
            cells = np.maximum(found, limits[0])
            style: Style = {"cmap": "cividis", "shading": "nearest", "rasterized": True}
            mesh = axis.pcolormesh(frequency, amplitude, cells, norm=norm, **style)
            if values:
                _write(axis, (frequency, amplitude), found, (mesh.get_cmap(), norm))
            elif output in published:
                _outline(axis, frequency, amplitude, cells, published[output].value)
            axis.grid(visible=False)
        axes[row, 0].set_ylabel("amplitude perturbation (%)")
        label = error_label(dataset, "RMS error", output, unit)
        bar = figure.colorbar(
            axes[row, 0].collections[0],
            ax=axes[row, :],
            label=label,
            extend="min" if values else None,
        )
        tick_decades(bar.ax.yaxis, *limits)
    for number, axis in enumerate(axes.flat):
        axis.set_title(f"{letter(number)} {list(methods.values())[number % len(methods)]}")
    for axis in axes[-1]:
        axis.set_xlabel("frequency perturbation (%)")
    return figure


def _errors(dataset: xr.Dataset, method: str, output: str) -> np.ndarray:
    """RMS errors (amplitudes, frequencies)."""
    chosen = dataset["rms_error"].sel({"method": method, "output": output})
    return chosen.squeeze(drop=True).transpose(*reversed(FACTORS)).values


def _outline(
    axis: Axes, frequency: np.ndarray, amplitude: np.ndarray, values: np.ndarray, bound: float
) -> None:
    """Where the error has a value: its logarithm is interpolated between the cells."""
    from scipy.interpolate import RectBivariateSpline

    if np.sum(values < bound) < ENCLOSED:
        return
    fine = [np.linspace(a[0], a[-1], FINE * len(a)) for a in (amplitude, frequency)]
    smooth = RectBivariateSpline(amplitude, frequency, np.log(values), kx=2, ky=2)(*fine)
    lines: Style = {"colors": "white", "linewidths": 1.2, "linestyles": "solid"}
    axis.contour(fine[1], fine[0], smooth, levels=[np.log(bound)], **lines)


def tick_decades(axis: Axis, low: float, high: float) -> None:
    """Ticks of a logarithmic axis: 1, 2, 5 of each decade where there are few decades."""
    if np.log10(high / low) < FEW_DECADES:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())


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
        if np.isnan(value):
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
