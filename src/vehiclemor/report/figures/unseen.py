"""One picture of what a reduced model is for: paths on inputs that it was not trained on."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vehiclemor.report.criteria.finding import at_point
from vehiclemor.report.figures.curves import Curve, positions
from vehiclemor.report.figures.error_map import two_digits
from vehiclemor.report.figures.lines import FULL, Results, legend_outside, panels, styles
from vehiclemor.report.labels import readable_unit

# Of the largest errors, in m; shorter bars could not be seen.
SHORTEST, LONGEST = 1e-3, 60.0


def figure_unseen(
    results: Results, *, methods: Mapping[str, str], inputs: Mapping[str, float], shown: float
) -> Figure:
    """A column for each input: paths above, largest lateral errors below.

    Parameters
    ----------
    methods
        Label in any of the studies -> text.
    inputs
        Title of a column -> amplitude factor.
    shown
        Length in m.
    """
    heights = {"height_ratios": [2.0, 1.0]}
    figure, axes = panels(2, len(inputs), (8.0, 4.4), sharey="row", gridspec_kw=heights)
    looks = styles(methods)
    for (upper, lower), (title, amplitude) in zip(axes.T, inputs.items(), strict=True):
        points = {m: _point(results, m, amplitude) for m in methods}
        curves = [Curve(methods[m], looks[m], point) for m, point in points.items()]
        upper.plot(*positions(curves[0].run["reference_outputs"]), label="full order", **FULL)
        for text, style, run in curves:
            upper.plot(*positions(run["outputs"]), label=text, **style)
        _draw_bars(lower, curves)
        upper.set_title(title)
        upper.set_xlim(0.0, shown)
        upper.set_xlabel("X (m)")
        lower.set_xlabel("largest error of Y (m)")
    axes[0, 0].set_ylabel("Y (m), not to scale")
    legend_outside(figure, [axes[0, 0]])
    return figure


def _point(results: Results, method: str, amplitude: float) -> xr.Dataset:
    dataset = next(d for d in results.values() if method in d["label"].values)
    return at_point(dataset, method, amplitude_factor=amplitude)


def _draw_bars(axis: Axes, curves: Sequence[Curve]) -> None:
    """Largest lateral error of each reduced model, in numbers too, on a logarithmic axis."""
    for place, (_, style, run) in enumerate(curves):
        error = run["max_error"].sel(output="lateral_position").item()
        bar = max(error, SHORTEST) - SHORTEST
        axis.barh(place, bar, left=SHORTEST, height=0.6, color=style["color"])
        # Below a tenth of a millimetre nobody measures.
        error = error if error >= 1e-4 else 0.0
        factor, unit = readable_unit(error, "m")
        words = f"{two_digits(factor * error)} {unit}"
        axis.annotate(
            words, (SHORTEST + bar, place), (4, 0), textcoords="offset points", va="center"
        )
    axis.set_yticks(np.arange(len(curves)), [curve.text for curve in curves])
    axis.set_ylim(len(curves) - 0.5, -0.5)
    axis.set_xscale("log")
    axis.set_xlim(SHORTEST, LONGEST)
    axis.set_xticks([1e-3, 1e-1, 1e1], ["0.001", "0.1", "10"])
    axis.minorticks_off()
    axis.grid(visible=False, axis="y")
