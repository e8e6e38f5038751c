"""Figures that one question asks for: unseen inputs, rounding, order of equations, spectrum."""

import json
import textwrap
from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from vehiclemor.report.figures import theme
from vehiclemor.report.figures.errors import figure_errors, two_digits
from vehiclemor.report.figures.runs import (
    END,
    Curve,
    Runs,
    draw_history,
    draw_paths,
    legend_of,
    runs_of,
)
from vehiclemor.report.figures.theme import THIN, Results, Style, letter, panels, styles
from vehiclemor.report.labels import readable_unit
from vehiclemor.report.published import rms_numbers
from vehiclemor.report.spectrum import spectrum
from vehiclemor.report.unseen import method_rows, protocol_of
from vehiclemor.study.plans.protocol import FULL_ORDER

# Of the largest errors, in m; shorter bars could not be seen.
SHORTEST, LONGEST = 1e-3, 60.0
# Below it nobody measures, in m.
MEASURABLE = 1e-4
ANGLE = "second_euler_angle"
VARIANTS = {"pod_literal": "Galerkin", "pod_literal_reversed_arms": "Galerkin, arm angles reversed"}
# Variable -> label, and values that are nothing but rounding of the largest.
SPECTRA = {
    "singular_value": ("singular value\n/ largest", 1e-16),
    "left_out": ("energy left out\n/ energy (eq. 8)", 1e-32),
}
PRESETS = {"recommended": "default settings", "literal": "literal"}


def figure_unseen(
    results: Results, *, methods: Mapping[str, str], inputs: Mapping[str, float], shown: float
) -> Figure:
    """A column for each input: the first metres of paths above, largest lateral errors below.

    `methods` are texts by labels of any of the studies, `inputs` amplitude factors by title.
    """
    heights = {"height_ratios": [2.0, 1.0]}
    figure, axes = panels(2, len(inputs), (8.0, 4.4), sharey="row", gridspec_kw=heights)
    looks = styles(methods)
    for (upper, lower), (title, amplitude) in zip(axes.T, inputs.items(), strict=True):
        points = [dataset.sel(amplitude_factor=amplitude) for dataset in results.values()]
        found = [runs_of(point, legend_of(point, methods)) for point in points]
        curves = {curve.label: curve for runs in found for curve in runs.curves}
        ordered = [curves[label]._replace(style=looks[label]) for label in methods]
        draw_paths(upper, Runs(found[0].full, ordered))
        _draw_bars(lower, ordered)
        upper.set_title(title)
        upper.set_xlim(0.0, shown)
        upper.set_xlabel("X (m)")
        lower.set_xlabel("largest error of Y (m)")
    axes[0, 0].set_ylabel("Y (m), not to scale")
    theme.legend_below(figure, [axes[0, 0]])
    return figure


def _draw_bars(axis: Axes, curves: Sequence[Curve]) -> None:
    """Largest lateral error of each reduced model, in numbers too, on a logarithmic axis."""
    errors = [c.run["max_error"].sel(output="lateral_position").item() for c in curves]
    colors = [curve.style["color"] for curve in curves]
    bars = axis.barh([c.text for c in curves], np.maximum(errors, SHORTEST), 0.6, color=colors)
    factors = [readable_unit(error, "m") for error in errors]
    texts = [
        f"{two_digits(factor * error)} {unit}" if error >= MEASURABLE else "< 0.1 mm"
        for error, (factor, unit) in zip(errors, factors, strict=True)
    ]
    axis.bar_label(bars, texts, padding=4)
    axis.set_ylim(len(curves) - 0.5, -0.5)
    axis.set_xscale("log")
    axis.set_xlim(SHORTEST, LONGEST)
    axis.set_xticks([1e-3, 1e-1, 1e1], ["0.001", "0.1", "10"])
    axis.minorticks_off()
    axis.grid(visible=False, axis="y")


def figure_spread(results: Results) -> Figure:
    """Figure 14, frequency +100 %: three states above; four, and six with their spread, below."""
    dataset, spread = results["figure-14"], results["figure-14-spread"]
    above = {"pod": "r = 3 (least squares)", "pod_literal": "r = 3 (literal)", "replay": "replay"}
    three = runs_of(dataset.sel(rank=3), above)
    below = {"pod_uncut": "r = 6 (least squares)", "pod_literal": "r = 6 (literal)"}
    four = runs_of(dataset.sel(rank=4), {"pod": "r = 4 (least squares)"}).curves
    six = runs_of(spread.sel(rank=6, rounding_seed=0), below).curves
    looks = styles(["pod_state", "pod", "pod_literal"]).values()
    lines = [c._replace(style=look) for c, look in zip([*four, *six], looks, strict=True)]
    figure, axes = panels(2, 1, (6.7, 5.4), sharex=True)
    titles = ("three states", "four and six states")
    for number, (axis, curves) in enumerate(zip(axes.flat, (three.curves, lines), strict=True)):
        draw_history(axis, Runs(three.full, curves), ANGLE)
        axis.axvline(5.0, **END)
        axis.set_title(letter(number, titles[number]))
    lower = axes[1, 0]
    # Of least squares it is no wider than the line.
    found = spread["outputs"].sel(label="pod_literal", rank=6, output=ANGLE).squeeze(drop=True)
    ends = (1e3 * f("rounding_seed") for f in (found.min, found.max))
    band: Style = {"color": lines[-1].style["color"], "alpha": 0.3, "linewidth": 0.0}
    lower.fill_between(found["time"], *ends, label="r = 6 (literal), 21 roundings", **band)
    lower.set_ylim(*(1.6 * limit for limit in lower.get_ylim()))
    lower.set_xlabel("time (s)")
    lower.set_xlim(0.0, float(dataset["time"][-1]))
    theme.legend_below(figure, axes.flat)
    return figure


def figure_equation_order(results: Results) -> Figure:
    """Sorted errors of all variants of the same equations; what has diverged above the axes."""
    dataset, nominal = results["equation-order"], results["figures-6-7"]
    numbers, outputs = rms_numbers(str(dataset.attrs["model"])), ("spindle_y", ANGLE)
    figure = figure_errors({"": dataset}, outputs=outputs, methods=VARIANTS)
    circle: Style = {"marker": "o", "markersize": 10, "markerfacecolor": "none", "color": "black"}
    for axis, output in zip(figure.axes, outputs, strict=True):
        for label in VARIANTS:
            values = dataset["rms_error"].sel(label=label, output=output).squeeze(drop=True).values
            place = np.sum(values < values[0]), values[0]
            axis.plot(*place, linestyle="none", label="natural order", **circle)
        least = nominal["rms_error"].sel(label="pod", rank=3, output=output).item()
        axis.axhline(least, color="#009E73", linestyle="--", label="least squares")
        axis.axhline(numbers[output].value, label="published", **THIN)
    theme.legend_below(figure, figure.axes)
    return figure


def figure_spectrum(*, models: Mapping[str, str]) -> Figure:
    """A column for each model (name -> title): medians over control periods, and all of them."""
    data = spectrum(list(models))
    figure, axes = panels(len(SPECTRA), len(models), (6.7, 4.6), sharex="col", sharey="row")
    for number, axis in enumerate(axes.flat):
        row, column = divmod(number, len(models))
        variable, (label, rounding) = list(SPECTRA.items())[row]
        model, title = list(models.items())[column]
        found = data.sel(model=model)
        for method, (preset, text) in zip(("pod", "pod_literal"), PRESETS.items(), strict=True):
            values = found[variable].sel(preset=preset).transpose("mode", "window")
            values = values.where(values > 0.1 * rounding).dropna("mode", how="all")
            look: Style = {"marker": "o", "markersize": 3, **styles([method])[method]}
            modes, legend = values["mode"], f"{text}: median, all periods"
            axis.plot(modes, values.median("window"), label=legend, **look)
            band: Style = {"color": look["color"], "alpha": 0.15, "linewidth": 0.0}
            axis.fill_between(modes, values.min("window"), values.max("window"), **band)
        axis.set_yscale("log")
        axis.set_ylim(bottom=rounding)
        axis.axvline(int(found["rank"]), label="states that the paper keeps", **THIN)
        axis.xaxis.set_major_locator(MaxNLocator(integer=True))
        axis.set_title(letter(number, title))
        axis.set_ylabel("" if column else label)
        axis.set_xlabel("number of modes" if row else "")
    theme.legend_below(figure, [axes[0, 0]])
    return figure


# Letters of a title in a line.
TITLE = 60
# Full-order integrators: of twelve no two look alike.
GREYS: list[Style] = [
    {"color": color, "linestyle": line, "marker": marker, "markersize": 4, "linewidth": 0.8}
    for line, marker in (("-", "o"), ("--", "*"), (":", "X"))
    for color in ("#000000", "#777777", "#AAAAAA", "#444444")
]


def figure_pareto(results: Results) -> Figure:
    """Score (worst error over its bound) over the mean time of a whole call, one model.

    Each full-order integrator is a line through its tolerances; a cross below the upper edge is a
    reduced model of which a run has failed.  Bars: between the quartiles of the rounds.
    """
    (dataset,) = results.values()
    rows: Any = pd.DataFrame(method_rows(dataset, protocol_of(dataset)))
    rows["time"] = 1e6 * rows["seconds"]
    rows["bar"] = 0.5 * rows["spread"] * rows["time"]
    rows["tolerance"] = [json.loads(text).get("tolerance", 0.0) for text in rows["settings"]]
    known = rows[np.isfinite(rows["score"]) & (rows["score"] > 0.0)]
    top = 10.0 ** np.ceil(np.log10(max([1.0, *known["score"]])) + 0.5)
    figure, axes = theme.panels(1, 1, (6.7, 4.2))
    axis = axes[0, 0]
    full = known[known["role"] == FULL_ORDER].sort_values("tolerance")
    for (name, line), look in zip(full.groupby("series", sort=False), cycle(GREYS)):
        bars: Style = {"xerr": line["bar"], "elinewidth": 0.8, "capsize": 1.5, **look}
        label = f"full order, {str(name).removeprefix('full order')}".removesuffix(", ")
        axis.errorbar(line["time"], line["score"], label=label, **bars)
    for score in rows["score"][rows["method"] == "replay"]:
        axis.axhline(score, color="#666666", linestyle=":", label="replay (no time)")
    reduced = rows[(rows["role"] != FULL_ORDER) & (rows["method"] != "replay")]
    looks = zip(cycle(theme.COLORS), cycle(theme.MARKERS))
    for row in reduced[np.isfinite(reduced["time"])].itertuples():
        color, marker = next(looks)
        failed = not np.isfinite(row.score)
        # Hollow, so that one shows through the other.
        look = {"color": color, "marker": "x" if failed else marker, "linestyle": "none"}
        look |= {"markersize": 11, "markeredgewidth": 2.4} if row.winner else {"markersize": 7}
        look |= {"xerr": row.bar, "elinewidth": 1.0, "capsize": 2, "markerfacecolor": "none"}
        label = f"{row.label}{' (fails)' * failed}{' (chosen)' * bool(row.winner)}"
        axis.errorbar(row.time, top / 1.5 if failed else row.score, label=label, **look)
    axis.axhline(1.0, **theme.THIN)
    axis.text(0.99, 1.08, "bounds", fontsize=7, ha="right", transform=axis.get_yaxis_transform())
    axis.set_yscale("log")
    axis.set_xscale("log")
    axis.set_ylim(0.5 * min([1.0, *known["score"]]), top)
    axis.set_xlabel("mean CPU time of a whole call, all outputs delivered, in µs")
    axis.set_ylabel("worst error / bound, judged runs")
    theme.tick_decades(axis.xaxis, *axis.get_xlim())
    # Of what is chosen the mark is larger than a line of the legend.
    figure.legend(loc="outside right upper", fontsize=7, markerscale=0.7)
    # The legend stands beside the axes, whose title can't be wrapped by itself.
    axis.set_title(textwrap.fill(str(dataset.attrs["title"]), TITLE))
    return figure
