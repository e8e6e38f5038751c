"""Figures 6, 7 and 11 to 14, and the order of the suspension's equations."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drawings import look
from drawings.look import (
    BOUND,
    GREEN,
    LINES,
    ONE,
    PUBLISHED,
    RED,
    TWO,
    Results,
    legend,
    panels,
    titles,
)
from vehiclemor.report.published import rms_numbers

OUTPUTS = {"spindle_y": "$y$", "second_euler_angle": r"$\eta$"}
ANGLE = "second_euler_angle"
TRAINED = "pod", "pod_literal"
# Units of the histories.
UNITS = {"spindle_y": "mm", ANGLE: "mrad"}
SYMBOLS = {"frequency_factor": "frequency", "amplitude_factor": "amplitude"}
VARIANTS = {
    "pod_literal": "arm angles as in the model",
    "pod_literal_reversed_arms": "arm angles reversed",
}


def figure_histories(results: Results, *, study: str) -> Figure:
    """Spindle displacement and second Euler angle."""
    runs = results[study].sel(rank=3).squeeze()
    known = study != "figures-6-7"
    figure, grid = panels(2, 1, ONE, 2.4, sharex=True)
    for axis, (output, text) in zip(grid.flat, OUTPUTS.items(), strict=True):
        look.history(axis, runs, output, (*TRAINED, *(["replay"] * known)), 1e3)
        axis.axvline(5.0, **BOUND)
        axis.set_ylabel(f"{text} ({UNITS[output]})")
    grid[-1, 0].set_xlabel("time (s)")
    grid[-1, 0].set_xlim(0.0, 10.0)
    titles(grid)
    legend(figure, grid.flat, 4)
    return figure


def figure_errors(results: Results) -> Figure:
    """Errors of figure 6."""
    runs = results["figures-6-7"].sel(rank=3).squeeze()
    figure, grid = panels(2, 1, ONE, 2.4, sharex=True)
    for axis, (output, text) in zip(grid.flat, OUTPUTS.items(), strict=True):
        for label in TRAINED:
            axis.plot(runs["time"], 1e6 * look.error(runs, output, label), **LINES[label])
        best = 1e6 * float(runs["floor_rms_error"].sel(label="pod", output=output))
        shade = {"color": "#BBBBBB", "alpha": 0.5, "linewidth": 0.0}
        axis.axhspan(-best, best, label="RMS of best approximation", **shade)
        axis.axvline(5.0, **BOUND)
        axis.set_ylabel(
            f"error of {text} (\N{MICRO SIGN}{'m' if output == 'spindle_y' else 'rad'})"
        )
    grid[-1, 0].set_xlabel("time (s)")
    grid[-1, 0].set_xlim(0.0, 10.0)
    titles(grid)
    legend(figure, [grid[0, 0]], 3)
    return figure


def figure_perturbations(results: Results) -> Figure:
    """RMS errors over perturbations of frequency and amplitude."""
    figure, grid = panels(2, 2, TWO, 3.2, sharex="row", sharey="col")
    numbers = rms_numbers("double_wishbone")
    for row, (kind, name) in zip(grid, SYMBOLS.items(), strict=True):
        data = results[f"figure-13-{name}"].squeeze()
        percent = 100.0 * (data[kind].values - 1.0)
        for axis, (output, text) in zip(row, OUTPUTS.items(), strict=True):
            for label in (*TRAINED, "fixed_basis", "replay"):
                values = data["rms_error"].sel(label=label, output=output).values
                style = LINES[label] | {"marker": "o", "markersize": 1.8}
                axis.semilogy(percent, np.where(values > 0.0, values, np.nan), **style)
            axis.axhline(numbers[output].value, label="published, nominal", **PUBLISHED)
            axis.set_xlabel(f"change of the {name} (%)")
            axis.set_ylabel(f"error of {text} ({'m' if output == 'spindle_y' else 'rad'})")
            look.decades(axis, 1)
    titles(grid)
    legend(figure, [grid[0, 0]], 5)
    return figure


def figure_spread(results: Results) -> Figure:
    """Twice the frequency: three, four and six states."""
    data, spread = results["figure-14"].squeeze(), results["figure-14-spread"].squeeze()
    figure, grid = panels(2, 1, ONE, 3.0, sharex=True)
    upper, lower = grid.flat
    look.history(upper, data.sel(rank=3), ANGLE, (*TRAINED, "replay"), 1e3)
    look.history(lower, data.sel(rank=4), ANGLE, (), 1e3)
    found = 1e3 * spread["outputs"].sel(rank=6, output=ANGLE, label="pod_literal")
    ends = found.min("rounding_seed"), found.max("rounding_seed")
    text = "r = 6, literal, 21 roundings"
    lower.fill_between(found["time"], *ends, color=RED, alpha=0.35, linewidth=0.0, label=text)
    four = 1e3 * data["outputs"].sel(rank=4, label="pod", output=ANGLE)
    lower.plot(data["time"], four, **(LINES["pod"] | {"color": GREEN, "label": "POD, r = 4"}))
    for axis in (upper, lower):
        axis.axvline(5.0, **BOUND)
        axis.set_ylabel(r"$\eta$ (mrad)")
    lower.set_xlabel("time (s)")
    lower.set_xlim(0.0, 10.0)
    titles(grid, ["r = 3", "more states"])
    legend(figure, grid.flat, 2)
    return figure


def figure_equation_order(results: Results) -> Figure:
    """Sorted errors over the ways to write the same equations."""
    data, nominal = results["equation-order"].squeeze(), results["figures-6-7"].squeeze()
    numbers = rms_numbers("double_wishbone")
    figure, grid = panels(1, 2, ONE, 2.2)
    for axis, (output, text) in zip(grid.flat, OUTPUTS.items(), strict=True):
        for (label, variant), color in zip(VARIANTS.items(), (RED, look.BLUE), strict=True):
            _draw_sorted(axis, data.sel(label=label), output, variant, color)
        least = float(nominal["rms_error"].sel(label="pod", rank=3, output=output))
        axis.axhline(least, color=GREEN, linestyle="--", label="least squares")
        axis.axhline(numbers[output].value, label="published", **PUBLISHED)
        axis.set_ylabel(f"error of {text} ({'m' if output == 'spindle_y' else 'rad'})")
        axis.set_xlabel("variants, sorted")
        look.decades(axis, 1)
    titles(grid)
    legend(figure, [grid[0, 0]], 2)
    return figure


def _draw_sorted(axis: Axes, data, output: str, text: str, color: str) -> None:  # noqa: ANN001
    values = data["rms_error"].sel(output=output).where(data["status"] == "ok").values
    ends = np.sort(values)
    style = {"color": color, "marker": "o", "markersize": 2.2, "linestyle": "none"}
    axis.semilogy(np.arange(len(ends)), ends, label=text, **style)
    natural = {"color": color, "marker": "o", "markersize": 7, "markerfacecolor": "none"}
    axis.plot(np.sum(values < values[0]), values[0], **natural)
    if bad := int(np.isnan(values).sum()):
        places = np.arange(len(ends) - bad, len(ends))
        at = np.full(bad, 0.97 if color == RED else 0.92)
        axis.plot(places, at, "x", color=color, transform=axis.get_xaxis_transform())
    axis.plot([], [], "x", color="black", label="diverged")
