"""Errors over perturbations of the input: figure 13 and its map."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LogNorm

from vehiclemor.report.figures.histories import DEFAULT, LITERAL, REPLAY
from vehiclemor.report.published import load_published

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

Results = Mapping[str, "xr.Dataset"]
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
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


def figure_13_map(results: Results) -> Figure:
    """RMS errors over both perturbations, for POD and for replay."""
    dataset = results["perturbation-grid"]
    figure, axes = plt.subplots(2, 2, sharex=True, sharey=True, figsize=(6.7, 5.6))
    published = load_published().numbers
    frequency = 100.0 * (dataset["frequency_factor"].values - 1.0)
    amplitude = 100.0 * (dataset["amplitude_factor"].values - 1.0)
    for row, (output, label) in enumerate(OUTPUTS.items()):
        errors = {
            method: dataset["rms_error"]
            .sel({"method": method, "output": output})
            .squeeze(drop=True)
            .transpose("amplitude_factor", "frequency_factor")
            .values
            for method in ("pod", "replay")
        }
        norm = LogNorm(
            min(float(np.nanmin(e[e > 0.0])) for e in errors.values()),
            max(float(np.nanmax(e)) for e in errors.values()),
        )
        meshes = []
        for column, (method, values) in enumerate(errors.items()):
            axis = axes[row, column]
            mesh = axis.pcolormesh(
                frequency,
                amplitude,
                values,
                norm=norm,
                cmap="cividis",
                shading="nearest",
                rasterized=True,
            )
            meshes.append(mesh)
            bound = published[NUMBERS[output]].value
            axis.contour(
                frequency, amplitude, values, levels=[bound], colors="white", linewidths=1.2
            )
            axis.grid(visible=False)
            name = "POD, r = 3" if method == "pod" else "replay"
            axis.set_title(f"({'abcd'[2 * row + column]}) {name}")
            if column == 0:
                axis.set_ylabel("amplitude perturbation (%)")
            if row == 1:
                axis.set_xlabel("frequency perturbation (%)")
        figure.colorbar(meshes[-1], ax=axes[row, :], label=label)
    return figure
