"""Singular values of the snapshots in control periods, and the energy that is left out."""

from collections.abc import Mapping

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from vehiclemor.report.figures.lines import Style, legend_outside, letter, panels, styles
from vehiclemor.report.spectrum import spectrum

# Variable -> label, and values that are nothing but rounding of the largest.
ROWS = {
    "singular_value": ("singular value\n/ largest", 1e-17),
    "left_out": ("energy left out\n/ energy (eq. 8)", 1e-33),
}
# Preset -> method whose style it has, text.
PRESETS = {"recommended": ("pod", "default settings"), "literal": ("pod_literal", "literal")}


def figure_spectrum(*, models: Mapping[str, str]) -> Figure:
    """A column for each model (name -> title): medians over control periods, and all of them."""
    data = spectrum(list(models))
    figure, axes = panels(len(ROWS), len(models), (6.7, 4.6), sharex="col", sharey="row")
    for number, axis in enumerate(axes.flat):
        row, column = divmod(number, len(models))
        variable, (label, lowest) = list(ROWS.items())[row]
        model = list(models)[column]
        values = data[variable].sel(model=model)
        _draw(axis, values.where(values > lowest))
        keeps = int(data["rank"].sel(model=model))
        axis.axvline(keeps, color="black", linewidth=0.8, label="states that the paper keeps")
        axis.xaxis.set_major_locator(MaxNLocator(integer=True))
        axis.set_title(f"{letter(number)} {models[model]}")
        axis.set_ylabel("" if column else label)
        axis.set_xlabel("number of modes" if row else "")
    legend_outside(figure, [axes[0, 0]], columns=3)
    return figure


def _draw(axis: Axes, values: xr.DataArray) -> None:
    """Values (preset, window, mode) of one model."""
    looks = styles(method for method, _ in PRESETS.values())
    for preset, (method, text) in PRESETS.items():
        chosen = values.sel(preset=preset).dropna("mode", how="all")
        line: Style = {"marker": "o", "markersize": 3, "label": f"{text}: median", **looks[method]}
        axis.semilogy(chosen["mode"], chosen.median("window"), **line)
        band = chosen.min("window"), chosen.max("window")
        shade: Style = {"color": line["color"], "alpha": 0.2, "linewidth": 0.0}
        axis.fill_between(chosen["mode"], *band, label=f"{text}: all control periods", **shade)
