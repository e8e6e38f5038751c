"""Which figures there are: name, studies that they need, how they are drawn, caption."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from vehiclemor.report.figures import (
    high_fidelity_histories,
    high_fidelity_perturbations,
    high_fidelity_schematic,
    histories,
    mechanism,
    order,
    pareto,
    perturbations,
    vehicle_histories,
    vehicle_perturbations,
    vehicle_schematic,
)

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
    default
        Whether it is drawn where no figure is asked for: the paper's are, and what belongs to them.
    """

    studies: tuple[str, ...]
    draw: Callable[[Mapping[str, xr.Dataset]], Figure]
    caption: str
    default: bool = True


PARETO = (
    "worst error on test inputs that no method has seen, as a multiple of its bound, over the mean "
    "time of a run: full-order integrators at several tolerances, replay, and reduced models with "
    "settings chosen on other inputs. Crosses: runs of the test set have failed. Training is not "
    "in the time. Parameters are public data."
)
FIGURES: dict[str, Entry] = {
    "1": Entry(
        (),
        vehicle_schematic.figure_1,
        "14-DOF vehicle in static equilibrium, drawn from the model with its public data (a), "
        "and its topological graph (b) with the coordinates of the model: 6 of the free chassis, "
        "P prismatic joints of 4 lumped masses along the chassis z axis, R revolute joints of 4 "
        "wheels. Axes: ISO 8855. Outline of the sprung body and steering angle (20 degrees, "
        "where the lane change needs 2) are drawn for orientation.",
    ),
    "2": Entry(
        ("figures-2-4",),
        vehicle_histories.figure_2,
        "Path of the 14-DOF vehicle from equilibrium (a) and its lane change alone (b): full order "
        "and POD with r = 3 of 14, control period 0.5 s, 10 snapshots. Parameters are public data. "
        "Nominal only: trained on the run that is shown, which replay returns exactly.",
    ),
    "3": Entry(
        ("figures-2-4",),
        vehicle_histories.figure_3,
        "Pitch and yaw of the 14-DOF vehicle, started in equilibrium and dropped onto the road "
        "with its nose down; r = 3 of 14. A cross marks where the literal procedure leaves the "
        "axes: it diverges from the dropped start. Parameters are public data. Nominal only: "
        "trained on the run that is shown.",
    ),
    "4": Entry(
        ("figures-2-4",),
        vehicle_histories.figure_4,
        "Errors of figure 3, the largest in each control period, beside the published RMS errors "
        "over the run. The literal procedure diverges from the dropped start. The parameters are "
        "public data, so the published numbers are for orders of magnitude. Nominal only: trained "
        "on the run that is shown, for which replay has no error.",
    ),
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
    "8": Entry(
        (),
        high_fidelity_schematic.figure_8,
        "High-fidelity vehicle at rest in static equilibrium, drawn from the model with its public "
        "data (a): wheelbase l, track T, height h of the chassis' CG; and its topological graph "
        "(b) with the coordinates of the model, of which each front corner has 8 and each rear one "
        "2. R revolute, S spherical, U universal, P prismatic joints; the motion s(t) of the rack "
        "is prescribed; dashed: cut joints, 12 constraints in all. Choices that the sources leave "
        "open: the rack has no mass, and the tie rods have the inertia of a steel rod. Axes: "
        "ISO 8855. The outline of the chassis is drawn for orientation.",
    ),
    "9": Entry(
        ("figures-9-10",),
        high_fidelity_histories.figure_9,
        "Path of the high-fidelity vehicle from equilibrium (a) and its lane change alone (b): "
        "full order and POD with r = 1 of 52 states, control period 0.1 s, 5 snapshots. Parameters "
        "are public data, since the paper's were never published. Nominal only: trained on the run "
        "that is shown, which replay returns exactly.",
    ),
    "10": Entry(
        ("figures-9-10",),
        high_fidelity_histories.figure_10,
        "Lateral speed (chassis component) and vertical speed of the chassis' CG in the "
        "high-fidelity vehicle, started in equilibrium and dropped onto the road with its nose "
        "down: r = 1 of 52 states, control period 0.1 s, 5 snapshots. Below each its errors, the "
        "largest in each control period, beside the published RMS errors over the run. From the "
        "dropped start the literal procedure runs backwards in the first control period and "
        "stays 2.3 m behind. Parameters are public data, since the paper's were never published: "
        "the published numbers are for orders of magnitude. Nominal only: trained on the run "
        "that is shown, which replay returns exactly.",
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
    "vehicle-map": Entry(
        ("vehicle-perturbations",),
        vehicle_perturbations.figure_vehicle_map,
        "14-DOF vehicle, start in equilibrium: RMS errors of the lateral position (top) and of yaw "
        "(bottom) over frequency and amplitude perturbations of the lane change, POD with r = 3 "
        "and bases from the unperturbed lane change (left), and replay (right). In position POD "
        "errs as much as replay, which knows nothing of the input; in yaw by a factor of 0.6 to "
        "1.4. Parameters are public data. Colours leave out the nominal input.",
    ),
    "vehicle-zero-steer": Entry(
        ("vehicle-zero-steer",),
        vehicle_histories.figure_zero_steer,
        "14-DOF vehicle without steering, bases from the lane change, start in equilibrium: the "
        "full model drives straight on, replay and POD with r = 3 change lane all the same. "
        "Parameters are public data.",
    ),
    "high-fidelity-map": Entry(
        ("high-fidelity-perturbations",),
        high_fidelity_perturbations.figure_high_fidelity_map,
        "High-fidelity vehicle, start in equilibrium: RMS errors of the lateral speed (top) and of "
        "the vertical speed (bottom) over frequency and amplitude perturbations of the lane "
        "change, POD with r = 1, control period 0.1 s, 5 snapshots and bases from the unperturbed "
        "lane change (left), and replay (right). Wherever the input is perturbed, POD errs as much "
        "as replay, which knows nothing of the input: to 1 % in the lateral and 4 % in the "
        "vertical speed. Parameters are public data. Colours leave out the nominal input.",
    ),
    "high-fidelity-zero-steer": Entry(
        ("high-fidelity-zero-steer",),
        high_fidelity_histories.figure_zero_steer,
        "High-fidelity vehicle with its rack held, bases from the lane change, control period "
        "0.1 s, 5 snapshots, start in equilibrium (a): the full model drives straight on, replay "
        "and POD, even with r = 3, change lane all the same. What sets POD apart from replay (b) "
        "is less than 40 mm of 3.5 m. Parameters are public data.",
    ),
    "pareto-suspension": Entry(
        ("predictive-double_wishbone",),
        pareto.figure_pareto,
        f"Double wishbone: {PARETO}",
        default=False,
    ),
    "pareto-vehicle": Entry(
        ("predictive-independent_suspension_vehicle",),
        pareto.figure_pareto,
        f"14-DOF vehicle: {PARETO}",
        default=False,
    ),
    "pareto-high-fidelity": Entry(
        ("predictive-high_fidelity_vehicle",),
        pareto.figure_pareto,
        f"High-fidelity vehicle: {PARETO}",
        default=False,
    ),
}
