"""Figures 6, 7 and 11 to 14, and the order of the suspension's equations."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drawings import look
from vehiclemor.report.figures.runs import draw_errors, draw_history
from vehiclemor.report.published import rms_numbers

# Output -> its symbol and unit.
OUTPUTS = {"spindle_y": ("$y$", "m"), "second_euler_angle": (r"$\eta$", "rad")}
ANGLE = "second_euler_angle"
SYMBOLS = {"frequency_factor": "frequency", "amplitude_factor": "amplitude"}
VARIANTS = {
    "pod_literal": "arm angles as in the model",
    "pod_literal_reversed_arms": "arm angles reversed",
}


def figure_histories(results: look.Results, *, study: str, errors: bool = False) -> Figure:
    """Spindle displacement and second Euler angle, or their errors."""
    labels = look.TRAINED if study == "figures-6-7" else (*look.TRAINED, "replay")
    shown = look.runs(results[study], labels, rank=3)
    figure, grid = look.lettered(2, 1, look.ONE, 2.4, sharex=True)
    for axis, (output, (symbol, unit)) in zip(grid.flat, OUTPUTS.items(), strict=True):
        if errors:
            draw_errors(axis, shown, output)
            axis.set_ylabel(f"error of {symbol} (\N{MICRO SIGN}{unit})")
        else:
            axis.set_ylabel(f"{symbol} ({draw_history(axis, shown, output)})")
        axis.axvline(5.0, **look.BOUND)
    grid[-1, 0].set(xlabel="time (s)", xlim=(0.0, 10.0))
    look.legend(figure, grid.flat, 3 if errors else 4)
    return figure


def figure_perturbations(results: look.Results) -> Figure:
    """RMS errors over perturbations of frequency and amplitude."""
    figure, grid = look.lettered(2, 2, look.TWO, 3.2, sharex="row", sharey="col")
    numbers = rms_numbers("double_wishbone")
    for row, (kind, name) in zip(grid, SYMBOLS.items(), strict=True):
        data = results[f"figure-13-{name}"].squeeze()
        percent = 100.0 * (data[kind].values - 1.0)
        for axis, (output, (symbol, unit)) in zip(row, OUTPUTS.items(), strict=True):
            for label in (*look.TRAINED, "fixed_basis", "replay"):
                values = data["rms_error"].sel(label=label, output=output).values
                style = look.LINES[label] | {"marker": "o", "markersize": 1.8}
                axis.semilogy(percent, np.where(values > 0.0, values, np.nan), **style)
            axis.axhline(numbers[output].value, label="published, nominal", **look.PUBLISHED)
            axis.set_xlabel(f"change of the {name} (%)")
            axis.set_ylabel(f"error of {symbol} ({unit})")
            look.decades(axis.yaxis, 1)
    look.legend(figure, [grid[0, 0]], 5)
    return figure


def figure_spread(results: look.Results) -> Figure:
    """Twice the frequency: three, four and six states."""
    study, spread = results["figure-14"].squeeze(), results["figure-14-spread"].squeeze()
    texts = "r = 3", "more states"
    figure, ((upper,), (lower,)) = look.lettered(2, 1, look.ONE, 3.0, texts, sharex=True)
    draw_history(upper, look.runs(study, (*look.TRAINED, "replay"), rank=3), ANGLE)
    four = look.runs(study, ["pod"], rank=4)
    style = {"color": look.GREEN, "linestyle": look.LINES["pod"]["linestyle"]}
    curve = four.curves[0]._replace(text="POD, r = 4", style=style)
    draw_history(lower, four._replace(curves=[curve]), ANGLE)
    six = 1e3 * spread["outputs"].sel(rank=6, output=ANGLE, label="pod_literal")
    ends = six.min("rounding_seed"), six.max("rounding_seed")
    text = "r = 6, literal, 21 roundings"
    lower.fill_between(six["time"], *ends, color=look.RED, alpha=0.35, linewidth=0.0, label=text)
    lower.autoscale(axis="y")
    for axis in (upper, lower):
        axis.axvline(5.0, **look.BOUND)
        axis.set_ylabel(r"$\eta$ (mrad)")
    lower.set(xlabel="time (s)", xlim=(0.0, 10.0))
    look.legend(figure, (upper, lower), 2)
    return figure


def figure_equation_order(results: look.Results) -> Figure:
    """Sorted errors over the ways to write the same equations."""
    data, nominal = results["equation-order"].squeeze(), results["figures-6-7"].squeeze()
    numbers = rms_numbers("double_wishbone")
    figure, grid = look.lettered(1, 2, look.ONE, 2.2)
    for axis, (output, (symbol, unit)) in zip(grid.flat, OUTPUTS.items(), strict=True):
        for (label, variant), color in zip(VARIANTS.items(), (look.RED, look.BLUE), strict=True):
            _draw_sorted(axis, data.sel(label=label), output, variant, color)
        least = float(nominal["rms_error"].sel(label="pod", rank=3, output=output))
        axis.axhline(least, color=look.GREEN, linestyle="--", label="least squares")
        axis.axhline(numbers[output].value, label="published", **look.PUBLISHED)
        axis.set(xlabel="variants, sorted", ylabel=f"error of {symbol} ({unit})")
        look.decades(axis.yaxis, 1)
    look.legend(figure, [grid[0, 0]], 2)
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
        at = np.full(bad, 0.97 if color == look.RED else 0.92)
        axis.plot(places, at, "x", color=color, transform=axis.get_xaxis_transform())
    axis.plot([], [], "x", color="black", label="diverged")
