"""Dependence of Galerkin projection of algebraic equations on how the equations are written."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vehiclemor.report.figures.lines import Results, Style, legend_outside, letter, panels
from vehiclemor.report.labels import error_label
from vehiclemor.report.published import rms_numbers

# Method -> text, colour, marker, its face, height of the crosses above the frame.
VARIANTS = {
    "pod_literal": ("Galerkin", "#D55E00", "o", "#D55E00", 1.035),
    "pod_literal_reversed_arms": ("Galerkin, arm angles reversed", "#0072B2", "^", "none", 1.085),
}
CIRCLE: Style = {"marker": "o", "markersize": 10, "markerfacecolor": "none", "linestyle": "none"}
OUTPUTS = ("spindle_y", "second_euler_angle")


def figure_equation_order(results: Results) -> Figure:
    """Sorted errors of all variants, on a logarithmic axis; diverged ones above it."""
    dataset = results["equation-order"]
    figure, axes = panels(1, 2, (6.7, 3.6))
    numbers = rms_numbers(str(dataset.attrs["model"]))
    for panel, (axis, output) in enumerate(zip(axes.flat, OUTPUTS, strict=True)):
        for method in VARIANTS:
            chosen = dataset["rms_error"].sel(label=method, output=output)
            _draw_sorted(axis, method, chosen.squeeze(drop=True).values)
        nominal = results["figures-6-7"].sel(label="pod", rank=3, output=output)
        least_squares = float(nominal["rms_error"].squeeze())
        axis.axhline(least_squares, color="#009E73", linestyle="--", label="least squares")
        line: Style = {"color": "black", "linewidth": 0.8, "label": "published"}
        axis.axhline(numbers[output].value, **line)
        axis.set_ylim(1e-7, 0.1)
        axis.set_xticks([1, 5, 10, 15, 20, 25])
        axis.set_ylabel(error_label(dataset, "RMS error", output))
        axis.set_xlabel("variant, sorted by error")
        axis.set_title(letter(panel), pad=14)
    legend_outside(figure, axes.flat, 3)
    return figure


def _draw_sorted(axis: Axes, method: str, values: np.ndarray) -> None:
    """Errors (variants,) of one way to measure the angles, the natural order first among them."""
    text, color, marker, face, height = VARIANTS[method]
    order = np.argsort(values)
    finite = int(np.isfinite(values).sum())
    places = np.arange(1, len(values) + 1)
    style: Style = {"color": color, "markersize": 5, "linestyle": "none"}
    drawn = style | {"marker": marker, "markerfacecolor": face, "label": text}
    axis.semilogy(places[:finite], values[order[:finite]], **drawn)
    natural = places[int(np.flatnonzero(order == 0)[0])]
    axis.semilogy(natural, values[0], color="black", label="natural order", **CIRCLE)
    # Above the frame: these have no error.
    above = {"transform": axis.get_xaxis_transform(), "clip_on": False, "markeredgewidth": 1.2}
    axis.plot(places[finite:], np.full(len(values) - finite, height), marker="x", **style, **above)
    axis.plot([], [], "x", color="black", markersize=4, label="diverged: no error")
