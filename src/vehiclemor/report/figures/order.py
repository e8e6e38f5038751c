"""Dependence of Galerkin projection of algebraic equations on how the equations are written."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np

from vehiclemor.report.figures.perturbations import NUMBERS, OUTPUTS
from vehiclemor.report.published import load_published

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

VARIANTS = {
    "pod_literal": ("Galerkin, other orders and signs", "#D55E00", "o"),
    "pod_literal_reversed_arms": ("the same, arm angles counted the other way", "#CC79A7", "^"),
    "pod": ("least squares", "#0072B2", "s"),
}


def figure_equation_order(results: Mapping[str, xr.Dataset]) -> Figure:
    """Sorted errors of all variants, on a logarithmic axis."""
    dataset = results["equation-order"]
    figure, axes = plt.subplots(1, 2, figsize=(6.7, 3.4))
    published = load_published().numbers
    for axis, (output, label), letter in zip(axes, OUTPUTS.items(), "ab", strict=True):
        for method, (text, color, marker) in VARIANTS.items():
            values = dataset["rms_error"].sel({"method": method, "output": output})
            values = np.sort(values.squeeze(drop=True).values)
            finite = values[np.isfinite(values)]
            style = {"color": color, "marker": marker, "markersize": 4, "linestyle": "none"}
            axis.semilogy(np.arange(1, len(finite) + 1), finite, label=text, **style)
            diverged = len(values) - len(finite)
            if diverged:
                places = np.arange(len(finite) + 1, len(values) + 1)
                top = np.full(diverged, 0.06)
                axis.semilogy(places, top, color=color, marker="x", linestyle="none")
        axis.axhline(published[NUMBERS[output]].value, color="black", linewidth=0.8)
        axis.text(0.6, published[NUMBERS[output]].value * 1.2, "published", fontsize=7)
        axis.set_ylim(1e-7, 0.2)
        axis.text(25.5, 0.085, "x: diverged", fontsize=7, ha="right")
        axis.set_ylabel(label)
        axis.set_xlabel("variant, sorted by error")
        axis.set_title(f"({letter})")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2)
    return figure
