"""Errors over perturbations of the input: figure 13 and its map."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.ticker import NullFormatter

from vehiclemor.report.figures.lines import DEFAULT, LITERAL, REPLAY, Results, legend_above
from vehiclemor.report.published import load_published

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

OUTPUTS = {
    "spindle_y": "RMS error of y (m)",
    "second_euler_angle": r"RMS error of $\eta$ (rad)",
}
MARKERS = {"pod": "o", "pod_literal": "x", "fixed_basis": "s", "replay": "."}
ONE_BASIS: dict[str, Any] = {"color": "#009E73", "linestyle": (0, (5, 1, 1, 1, 1, 1))}
FLOOR: dict[str, Any] = {"color": "#BBBBBB", "linewidth": 3.5, "zorder": 1.5}
NUMBERS = {"spindle_y": "dw_rms_spindle_y", "second_euler_angle": "dw_rms_second_euler_angle"}


def figure_13(results: Results) -> Figure:
    """RMS errors against frequency (top) and amplitude (bottom) perturbations."""
    figure, axes = plt.subplots(2, 2, figsize=(6.7, 5.2))
    published = load_published().numbers
    for row, (study, factor) in enumerate(
        (("figure-13-frequency", "frequency_factor"), ("figure-13-amplitude", "amplitude_factor"))
    ):
        dataset = results[study]
        percent = 100.0 * (dataset[factor].values - 1.0)
        for column, (output, label) in enumerate(OUTPUTS.items()):
            axis = axes[row, column]
            chosen = dataset.sel(output=output)
            for method, text, style in (
                ("pod", "POD, r = 3 (least squares)", DEFAULT),
                ("pod_literal", "POD, r = 3 (literal: Galerkin)", LITERAL),
                ("fixed_basis", "one basis for the run, r = 3", ONE_BASIS),
                ("replay", "replay", REPLAY),
            ):
                errors = chosen["rms_error"].sel({"method": method}).squeeze(drop=True).values
                # Replay is exact at the nominal input: no point on a logarithmic axis.
                errors = np.where(errors > 0.0, errors, np.nan)
                axis.semilogy(
                    percent, errors, label=text, marker=MARKERS[method], markersize=3, **style
                )
            floor = chosen["floor_rms_error"].sel({"method": "pod"}).squeeze(drop=True).values
            axis.semilogy(percent, floor, label="best approximation, control periods", **FLOOR)
            axis.axhline(
                published[NUMBERS[output]].value,
                color="black",
                linewidth=0.8,
                label="published, nominal",
            )
            axis.set_ylabel(label)
            axis.set_xlabel(f"{factor.split('_')[0]} perturbation (%)")
            axis.set_title(f"({'abcd'[2 * row + column]})")
    legend_above(figure, axes[0, 0], columns=3)
    return figure


def figure_13_map(results: Results) -> Figure:
    """RMS errors over both perturbations, for POD and for replay."""
    return error_map(results["perturbation-grid"], OUTPUTS, NUMBERS)


def error_map(
    dataset: xr.Dataset,
    outputs: Mapping[str, str],
    numbers: Mapping[str, str],
    values_in_cells: bool = False,
    rank: int = 3,
) -> Figure:
    """RMS errors over frequency and amplitude perturbations, POD beside replay.

    Parameters
    ----------
    dataset
        Grid of both factors.
    outputs
        Output -> label of its colours; one row of panels each.
    numbers
        Output -> id of the published number that is drawn as a white line, if there is one.
    values_in_cells
        Write the error into each cell; the colours then leave the nominal input out, whose error
        is far below all others.
    rank
        That of POD, for its title.
    """
    figure, axes = plt.subplots(2, 2, sharex=True, sharey=True, figsize=(6.7, 5.6))
    published = load_published().numbers
    frequency = 100.0 * (dataset["frequency_factor"].values - 1.0)
    amplitude = 100.0 * (dataset["amplitude_factor"].values - 1.0)
    nominal = np.isclose(amplitude, 0.0)[:, None] & np.isclose(frequency, 0.0)
    for row, (output, label) in enumerate(outputs.items()):
        errors = {
            method: dataset["rms_error"]
            .sel({"method": method, "output": output})
            .squeeze(drop=True)
            .transpose("amplitude_factor", "frequency_factor")
            .values
            for method in ("pod", "replay")
        }
        shown = [e[~nominal] if values_in_cells else e for e in errors.values()]
        lowest = min(float(np.nanmin(e[e > 0.0])) for e in shown)
        highest = max(float(np.nanmax(e)) for e in shown)
        norm = LogNorm(lowest, highest)
        meshes = []
        for column, (method, values) in enumerate(errors.items()):
            axis = axes[row, column]
            mesh = axis.pcolormesh(
                frequency,
                amplitude,
                np.maximum(values, 0.5 * lowest) if values_in_cells else values,
                norm=norm,
                cmap="cividis",
                shading="nearest",
                rasterized=True,
            )
            meshes.append(mesh)
            if output in numbers:
                bound = published[numbers[output]].value
                axis.contour(
                    frequency, amplitude, values, levels=[bound], colors="white", linewidths=1.2
                )
            if values_in_cells:
                _write(axis, frequency, amplitude, values, np.sqrt(lowest * highest))
            axis.grid(visible=False)
            name = f"POD, r = {rank}" if method == "pod" else "replay"
            axis.set_title(f"({'abcd'[2 * row + column]}) {name}")
            if column == 0:
                axis.set_ylabel("amplitude perturbation (%)")
            if row == 1:
                axis.set_xlabel("frequency perturbation (%)")
        extend = "min" if values_in_cells else "neither"
        bar = figure.colorbar(meshes[-1], ax=axes[row, :], label=label, extend=extend)
        if values_in_cells:
            bar.ax.yaxis.set_minor_formatter(NullFormatter())
    return figure


def _write(
    axis: Axes, frequency: np.ndarray, amplitude: np.ndarray, values: np.ndarray, dark: float
) -> None:
    """Errors with two digits, in white where they are below `dark`."""
    for (j, i), value in np.ndenumerate(values):
        digits = f"{value:.1g}" if value < 1e-3 else f"{value:#.2g}"
        axis.text(
            float(frequency[i]),
            float(amplitude[j]),
            digits.replace("e-0", "e-"),
            ha="center",
            va="center",
            fontsize=5.5,
            color="white" if value < dark else "black",
        )
