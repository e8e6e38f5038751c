"""Paths of vehicles: reduced models beside full order, and what sets them apart."""

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure

from vehiclemor.report.criteria.finding import at_point
from vehiclemor.report.figures.curves import Curve, draw_distances, positions
from vehiclemor.report.figures.lines import (
    FULL,
    REPLAY,
    Results,
    legend_outside,
    letter,
    panels,
    styles,
)
from vehiclemor.report.labels import axis_label, marked

DISTANCE = "distance from full order at the same time"


def figure_paths(
    results: Results, *, methods: Mapping[str, str], shown: Sequence[float], titles: Sequence[str]
) -> Figure:
    """Path in the plane from equilibrium, a panel for each length (m) shown; distances below."""
    (dataset,) = results.values()
    looks = styles(methods)
    runs = {method: at_point(dataset, method, start="equilibrium") for method in methods}
    curves = [Curve(marked(methods[m], run), looks[m], run) for m, run in runs.items()]
    figure, axes = panels(len(shown) + 1, 1, (6.7, 5.6))
    full = positions(curves[0].run["reference_outputs"])
    for number, (axis, furthest) in enumerate(zip(axes.flat, [*shown, shown[0]], strict=True)):
        if number < len(shown):
            axis.plot(*full, label="full order", **FULL)
            for text, style, run in curves:
                axis.plot(*positions(run["outputs"]), label=text, **style)
            axis.set_ylabel("Y (m)")
        else:
            draw_distances(axis, curves)
        axis.set_xlim(0.0, furthest)
        axis.set_title(f"{letter(number)} {[*titles, DISTANCE][number]}")
    axes[-1, 0].set_xlabel("X (m), not to the scale of Y")
    legend_outside(figure, [axes[0, 0]])
    return figure


def figure_replayed_paths(
    results: Results, *, methods: Mapping[str, str], beside_replay: bool = False, columns: int = 4
) -> Figure:
    """Lateral position over the time without steering, bases from a lane change.

    With `beside_replay` a second panel shows what sets the reduced models apart from replay.
    """
    (dataset,) = results.values()
    output = "lateral_position"
    size = (6.7, 4.8 if beside_replay else 3.2)
    figure, axes = panels(2 if beside_replay else 1, 1, size, sharex=True)
    upper, lower = axes[0, 0], axes[-1, 0]
    runs = dataset["outputs"].sel(start="equilibrium", output=output).squeeze(drop=True)
    replay = runs.sel(label="replay")
    # Wide dots above the lines that coincide with it.
    looks = styles(methods) | {"replay": REPLAY | {"linewidth": 3.0, "zorder": 3.0}}
    for method, text in methods.items():
        run = runs.sel(label=method)
        upper.plot(run.time, run, label=text, **looks[method])
        if beside_replay and method not in ("full_order", "replay"):
            lower.plot(run.time, 1e3 * (run - replay), label=text, **looks[method])
    upper.set_xlim(0.0, float(dataset["time"][-1]))
    upper.set_ylabel(axis_label(dataset, output))
    if beside_replay:
        upper.set_title("(a) lateral position")
        lower.set_title("(b) difference from replay")
        lower.set_ylabel("Y minus replay's Y (mm)")
    lower.set_xlabel("time (s)")
    legend_outside(figure, [upper], columns)
    return figure
