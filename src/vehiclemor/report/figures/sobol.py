"""Sobol indices of objectives by parameter: first order within total order, by model."""

from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vehiclemor.report.figures.lines import COLORS, legend_outside, letter, panels
from vehiclemor.report.sobol import sobol_dataset

# Width of all bars of a parameter.
WIDTH = 0.8


def figure_sobol(*, model: str, results: str) -> Figure:
    """A panel for each objective: bars of each parameter, with intervals of 95 %.

    Legends tell the CPU time of all runs of a model, and the part that it does not trust.
    """
    data = sobol_dataset(model, Path(results))
    names = data["objective"].values
    figure, axes = panels(len(names), 1, (6.7, 1.2 + 2.2 * len(names)), sharex=True)
    for number, (axis, name) in enumerate(zip(axes[:, 0], names, strict=True)):
        own = data.sel(objective=name)
        _draw(axis, own)
        words, unit = str(name).replace("_", " "), str(own["objective_unit"].item())
        mean, spread = float(own["mean"][0]), float(own["standard_deviation"][0])
        value = f"{mean:.3g} ± {spread:.2g}{'' if unit == '1' else f' {unit}'}"
        axis.set_title(f"{letter(number)} {words}, {value} in full order")
        axis.set_ylabel("part of the variance")
    parameters = [
        str(name).replace("_", "\n", 1).replace("_", " ") for name in data["parameter"].values
    ]
    axes[-1, 0].set_xticks(
        np.arange(len(parameters)), [p.replace(" ", "\n", 1) for p in parameters]
    )
    legend_outside(figure, [axes[0, 0]], columns=2)
    return figure


def _draw(axis: Axes, data: xr.Dataset) -> None:
    """Bars (model, parameter) of one objective."""
    places, count = np.arange(data.sizes["parameter"]), data.sizes["model"]
    for k, (label, color) in enumerate(zip(data["model"].values, COLORS, strict=False)):
        own, width = data.isel(model=k), WIDTH / count
        at = places + (k - 0.5 * (count - 1)) * width
        for name, opacity, shift in (("total_order", 0.35, 0.2), ("first_order", 1.0, -0.2)):
            values = own[name].values
            ends = np.array([values - own[f"{name}_low"], own[f"{name}_high"] - values])
            told = f"{label} ({float(own['seconds']):.0f} s"
            if share := 100.0 * float(own["untrusted"]):
                told += f", {share:.2g} % untrusted"
            text = f"{told})" if opacity == 1.0 else None
            axis.bar(at, values, width, color=color, alpha=opacity, label=text)
            # Of the first order on the left of a bar, of the total on its right.
            interval = {"yerr": np.maximum(ends, 0.0), "fmt": "none", "ecolor": "black"}
            axis.errorbar(at + shift * width, values, elinewidth=0.8, capsize=2, **interval)
    axis.bar(places[:1], [0.0], color="#666666", alpha=0.35, label="with interactions (total)")
    axis.axhline(0.0, color="black", linewidth=0.8)
    axis.tick_params(axis="x", length=0)
