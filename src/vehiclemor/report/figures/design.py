"""Design studies: the front of springs and dampers, toe and camber of moved hard points."""

import numpy as np
from matplotlib.figure import Figure

from vehiclemor.report.design_studies import design_studies
from vehiclemor.report.figures.lines import COLORS, FULL, Style, legend_outside, letter, panels

MARKERS = ("o", "s", "^", "D", "v")
# Camber that is asked for, in rad for a metre of travel; no toe is.
CAMBER = 0.35
CURVES: dict[str, Style] = {
    "today": {"color": "#666666", "linestyle": "--"},
    "designed": {"color": COLORS[0]},
}


def figure_front() -> Figure:
    """Both objectives of each contestant's designs: as it tells them, as the full car has them."""
    stored = design_studies()
    figure, axes = panels(1, 2, (6.7, 3.4), sharex=True, sharey=True)
    looks = iter(zip(COLORS, MARKERS, strict=False))
    for name, points in stored["fronts"].items():
        # Derivatives and tolerances lead to the same.
        if name.startswith("full order,"):
            continue
        full = name == "full order"
        color, marker = ("black", "") if full else next(looks)
        style: Style = {"marker": marker, "fillstyle": "none", "linestyle": ":", "color": color}
        for axis, kind in zip(axes[0], ("told", "real"), strict=True):
            roll, yaw = 1e3 * np.array([point[kind] for point in points]).T
            axis.plot(roll, yaw, label=name, **(FULL if full else style))
    for k, (axis, title) in enumerate(zip(axes[0], ("as told", "in full order"), strict=True)):
        axis.set_title(f"{letter(k)} {title}")
        axis.set_xlabel("peak roll (mrad)")
    axes[0, 0].set_ylabel("yaw rate left (mrad/s)")
    legend_outside(figure, [axes[0, 0]], columns=3)
    return figure


def figure_curves() -> Figure:
    """Toe and camber over travel, today, designed, and as asked for."""
    curves = design_studies()["curves"]
    figure, axes = panels(1, 2, (6.7, 3.0))
    for k, (axis, name, target) in enumerate(
        zip(axes[0], ("toe", "camber"), (0, CAMBER), strict=True)
    ):
        for label, style in CURVES.items():
            own = curves[label]
            axis.plot(1e3 * np.array(own["z"]), 1e3 * np.array(own[name]), label=label, **style)
        travel = np.array(curves["today"]["z"])
        axis.plot(1e3 * travel, 1e3 * target * travel, label="asked for", **FULL)
        axis.set_title(f"{letter(k)} {name}")
        axis.set_xlabel("wheel travel (mm)")
        axis.set_ylabel(f"{name} (mrad)")
    legend_outside(figure, [axes[0, 0]], columns=3)
    return figure
