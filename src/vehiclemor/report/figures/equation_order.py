"""Dependence of Galerkin projection of algebraic equations on how the equations are written."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from vehiclemor.report.figures.lines import Results, legend_above, letter
from vehiclemor.report.labels import error_label
from vehiclemor.report.published import rms_numbers

VARIANTS = {
    "pod_literal": ("Galerkin", "#D55E00", "o", -0.15),
    "pod_literal_reversed_arms": ("Galerkin, arm angles reversed", "#CC79A7", "^", 0.15),
}


OUTPUTS = ("spindle_y", "second_euler_angle")


def figure_equation_order(results: Results) -> Figure:
    """Sorted errors of all variants, on a logarithmic axis."""
    dataset = results["equation-order"]
    figure, axes = plt.subplots(1, 2, figsize=(6.7, 3.4))
    numbers = rms_numbers(str(dataset.attrs["model"]))
    for panel, (axis, output) in enumerate(zip(axes, OUTPUTS, strict=True)):
        published = numbers[output].value
        for method, (text, color, marker, shift) in VARIANTS.items():
            chosen = dataset["rms_error"].sel({"method": method, "output": output})
            values = chosen.squeeze(drop=True).values
            order = np.argsort(values)
            finite = int(np.isfinite(values).sum())
            places = np.arange(1, len(values) + 1) + shift
            style = {"color": color, "marker": marker, "markersize": 4, "linestyle": "none"}
            axis.semilogy(places[:finite], values[order[:finite]], label=text, **style)
            natural = int(np.flatnonzero(order == 0)[0])
            axis.semilogy(
                places[natural],
                values[0],
                label="natural order" if shift < 0.0 else None,
                marker="o",
                markersize=10,
                markerfacecolor="none",
                color="black",
                linestyle="none",
            )
            style["marker"] = "x"
            axis.semilogy(places[finite:], np.full(len(values) - finite, 0.06), **style)
        nominal = results["figures-6-7"].sel({"method": "pod", "rank": 3, "output": output})
        least_squares = float(nominal["rms_error"].squeeze())
        axis.axhline(least_squares, color="#0072B2", linestyle="--", label="least squares")
        axis.axhline(published, color="black", linewidth=0.8)
        axis.text(0.6, published * 1.2, "published", fontsize=7)
        axis.set_ylim(1e-7, 0.2)
        axis.text(25.5, 0.085, "x: diverged, no error", fontsize=7, ha="right")
        axis.set_ylabel(error_label(dataset, "RMS error", output))
        axis.set_xlabel("variant, sorted by error")
        axis.set_title(letter(panel))
    legend_above(figure, axes[0])
    return figure
