"""Which figures there are: name, studies that they need, how they are drawn, caption."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from vehiclemor.report.figures import histories, mechanism, order, perturbations

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

PARAMETERS = "Parameters: public data, since the paper's were never published."


@dataclass(frozen=True)
class Entry:
    """One figure.

    Attributes
    ----------
    studies
        Studies whose combined datasets it shows.
    draw
        Combined datasets by study -> figure.
    caption
        What it shows.
    """

    studies: tuple[str, ...]
    draw: Callable[[Mapping[str, xr.Dataset]], Figure]
    caption: str


FIGURES: dict[str, Entry] = {
    "5": Entry(
        (),
        mechanism.figure_5,
        "Double-wishbone suspension, front left, drawn from the model at its design position "
        "(a), and its topological graph (b): bodies are nodes, joints are edges, with the "
        "coordinates of the model. R revolute, S spherical, U universal, P prismatic. "
        "The outline of a wheel of 0.30 m radius is drawn for orientation.",
    ),
    "6": Entry(
        ("figures-6-7",),
        histories.figure_6,
        "Spindle displacement in y (a) and second Euler angle (b), full order and POD with r = 3 "
        "of 8, control period 5 s, 10 snapshots; trained on the run that is shown.",
    ),
    "7": Entry(
        ("figures-6-7",),
        histories.figure_7,
        "Errors of figure 6 against the full-order solution, for the default (least squares) and "
        "the paper's literal procedure (Galerkin), beside the RMS error of the "
        "best approximation of the coordinates, "
        "which one output can undercut.",
    ),
    "11": Entry(
        ("figure-11",),
        histories.figure_11,
        "Frequency of the input raised by 20 %, bases from the unperturbed input: spindle "
        "displacement (a) and second Euler angle (b). Replay returns the training run.",
    ),
    "12": Entry(
        ("figure-12",),
        histories.figure_12,
        "Amplitude of the input raised by 20 %, bases from the unperturbed input: spindle "
        "displacement (a) and second Euler angle (b). Replay returns the training run.",
    ),
    "13": Entry(
        ("figure-13-frequency", "figure-13-amplitude"),
        perturbations.figure_13,
        "RMS errors over perturbations of the frequency (top) and of the amplitude (bottom), "
        "r = 3, bases from the unperturbed input.",
    ),
    "13-map": Entry(
        ("perturbation-grid",),
        perturbations.figure_13_map,
        "RMS errors over frequency and amplitude perturbations together: POD with r = 3 and bases "
        "from the unperturbed input (left), and replay (right). White lines: the published nominal "
        "errors.",
    ),
    "14": Entry(
        ("figure-14", "figure-14-spread"),
        histories.figure_14,
        "Second Euler angle at twice the frequency, bases from the unperturbed input: r = 3 (a), "
        "r = 6 and r = 4 (b). The snapshots have rank 4: rounding chooses two of the six "
        "directions, so r = 6 is shown for 21 roundings of the snapshots.",
    ),
    "equation-order": Entry(
        ("equation-order", "figures-6-7"),
        order.figure_equation_order,
        "Nominal RMS errors of Galerkin, U^T Phi = 0, when the same equations are written in 24 "
        "other orders and with other signs; r = 3. Least squares sums the squares of "
        "all equations and can't depend on their order.",
    ),
}
