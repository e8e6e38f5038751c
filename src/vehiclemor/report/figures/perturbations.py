"""Errors of any model over perturbations of its input: curves and maps."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from vehiclemor.report.figures.lines import Results, Style, legend_above, letter, styles
from vehiclemor.report.labels import error_label
from vehiclemor.report.published import rms_numbers

MARKERS = {"pod": "o", "pod_literal": "x", "fixed_basis": "s", "replay": "."}
FLOOR: Style = {"color": "#BBBBBB", "linewidth": 3.5, "zorder": 1.5}
FACTORS = ("frequency_factor", "amplitude_factor")


def figure_error_curves(
    results: Results, *, outputs: Sequence[str], methods: Mapping[str, str]
) -> Figure:
    """RMS errors against one perturbed factor: a row for each study, a column for each output."""
    shape = len(results), len(outputs)
    figure, axes = plt.subplots(*shape, squeeze=False, figsize=(6.7, 2.6 * len(results)))
    for row, dataset in enumerate(results.values()):
        factor = max(FACTORS, key=lambda name: dataset.sizes[name])
        published = rms_numbers(str(dataset.attrs["model"]))
        percent = 100.0 * (dataset[factor].values - 1.0)
        for column, output in enumerate(outputs):
            axis = axes[row, column]
            chosen = dataset.sel(output=output)
            for method, style in styles(methods).items():
                errors = chosen["rms_error"].sel({"method": method}).squeeze(drop=True).values
                # Replay is exact at the nominal input: no point on a logarithmic axis.
                errors = np.where(errors > 0.0, errors, np.nan)
                marked = {"label": methods[method], "marker": MARKERS.get(method, "^")}
                axis.semilogy(percent, errors, markersize=3, **marked, **style)
            floor = chosen["floor_rms_error"].sel({"method": "pod"}).squeeze(drop=True).values
            axis.semilogy(percent, floor, label="best approximation, control periods", **FLOOR)
            if output in published:
                line: Style = {"color": "black", "linewidth": 0.8, "label": "published, nominal"}
                axis.axhline(published[output].value, **line)
            axis.set_ylabel(error_label(dataset, "RMS error", output))
            axis.set_xlabel(f"{factor.split('_')[0]} perturbation (%)")
            axis.set_title(letter(len(outputs) * row + column))
    legend_above(figure, axes[0, 0], columns=3)
    return figure


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
    figure, axes = plt.subplots(*shape, sharex=True, sharey=True, squeeze=False, figsize=size)
    published = rms_numbers(str(dataset.attrs["model"]))
    frequency, amplitude = (100.0 * (dataset[factor].values - 1.0) for factor in FACTORS)
    nominal = np.isclose(amplitude, 0.0)[:, None] & np.isclose(frequency, 0.0)
    for row, output in enumerate(outputs):
        errors = {method: _errors(dataset, method, output) for method in methods}
        shown = np.array([e[~nominal] if values else e for e in errors.values()])
        norm = LogNorm(float(np.nanmin(shown[shown > 0.0])), float(np.nanmax(shown)))
        assert norm.vmin is not None
        assert norm.vmax is not None
        mesh = None
        for column, (method, found) in enumerate(errors.items()):
            axis = axes[row, column]
            cells = np.maximum(found, 0.5 * norm.vmin) if values else found
            style: Style = {"cmap": "cividis", "shading": "nearest", "rasterized": True}
            mesh = axis.pcolormesh(frequency, amplitude, cells, norm=norm, **style)
            if values:
                _write(axis, frequency, amplitude, found, np.sqrt(norm.vmin * norm.vmax))
            elif output in published:
                bound = [published[output].value]
                white: Style = {"colors": "white", "linewidths": 1.2}
                axis.contour(frequency, amplitude, found, levels=bound, **white)
            axis.grid(visible=False)
            axis.set_title(f"{letter(len(methods) * row + column)} {methods[method]}")
        axes[row, 0].set_ylabel("amplitude perturbation (%)")
        assert mesh is not None
        extend, label = "min" if values else "neither", error_label(dataset, "RMS error", output)
        bar = figure.colorbar(mesh, ax=axes[row, :], label=label, extend=extend)
        if values:
            bar.ax.yaxis.set_minor_formatter(NullFormatter())
    for axis in axes[-1]:
        axis.set_xlabel("frequency perturbation (%)")
    return figure


def _errors(dataset: xr.Dataset, method: str, output: str) -> np.ndarray:
    """RMS errors (amplitudes, frequencies)."""
    chosen = dataset["rms_error"].sel({"method": method, "output": output})
    return chosen.squeeze(drop=True).transpose(*reversed(FACTORS)).values


def _write(
    axis: Axes, frequency: np.ndarray, amplitude: np.ndarray, values: np.ndarray, dark: float
) -> None:
    """Errors with two digits, in white where they are below `dark`."""
    for (j, i), value in np.ndenumerate(values):
        if np.isnan(value):
            continue
        digits = f"{value:#.2g}" if 1e-3 <= value < 100.0 else f"{value:.1g}"
        place = float(frequency[i]), float(amplitude[j])
        color = "white" if value < dark else "black"
        style: Style = {"ha": "center", "va": "center", "fontsize": 5.5, "color": color}
        axis.text(*place, digits.replace("e-0", "e-").replace("e+0", "e"), **style)
