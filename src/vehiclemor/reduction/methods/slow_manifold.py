"""Slow-manifold regression: the slow modes of a vehicle with a fitted nonlinear right-hand side.

Fast motion (hop, spins of the wheels, constraints) follows the slow one: trajectories soon lie on a
curved slow manifold (N. Fenichel, J. Differ. Equ. 31 (1979), 53-98; P. Kokotovic, H. Khalil,
J. O'Reilly, Singular Perturbation Methods in Control, SIAM 1999).  Projection on a linear subspace
can't follow its curvature; here the rates of the slow coordinates are fitted on training runs,
which lie on it, and the lag of the fast modes is learnt with them:

    z' = Lambda z + b u + N(z, speed, u)

Lambda and b are exact at straight running.  N is odd in the lateral quantities (the vehicle is its
own mirror image): cubic, and in the axles' slip angles also quintic, terms; the speed and what is
symmetric have even terms.  What whole runs hardly need is eliminated again.  The heading is fitted
twice: as a rate, then as its integral along reduced runs, since a heading that is off is a lateral
position that is off.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from vehiclemor.reduction.interface import Offline
from vehiclemor.reduction.online_settings import online_settings
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.vehicle.features import PLANAR
from vehiclemor.reduction.vehicle.pruning import pruned
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.regression import largest, ridge_fit
from vehiclemor.reduction.vehicle.shape import VehicleShape, is_vehicle
from vehiclemor.reduction.vehicle.slow_features import OUTPUTS, feature_table
from vehiclemor.reduction.vehicle.slow_modes import slow_modes
from vehiclemor.reduction.vehicle.trajectory_fit import finishes, improved, targets
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Trajectory

SUMMARY = "slow modes with a right-hand side fitted on training runs, fast motion slaved"
REFERENCE = "10.1137/1.9781611971118"
# Accuracy of the reduced runs on which the heading is fitted.
REFIT_TOLERANCE = 1e-6
REFIT_RIDGE = 1e-9
_SETTINGS = {
    "fastest": Setting(
        "number", 45.0, "modes of up to this |lambda| in 1/s are kept", minimum=0.0, above=True
    ),
    "nonlinearity": Setting(
        "text",
        "quintic",
        "of the lateral terms: cubic; quintic in slip angles too; sliding: and |slip| slip terms; "
        "rich: and cubic terms that change with the speed",
        choices=("cubic", "quintic", "sliding", "rich"),
    ),
    "ridge": Setting("number", 1e-10, "weight of the coefficients' size in the fit", minimum=0.0),
    "refits": Setting("integer", 2, "how often the heading is fitted on reduced runs", minimum=0),
    "sweeps": Setting(
        "integer", 4, "Gauss-Newton steps of all coefficients on whole training runs", minimum=0
    ),
    "terms": Setting(
        "integer",
        20,
        "lateral nonlinear terms that the equations keep, those that whole runs need most, and a "
        "quarter as many symmetric ones; 0: all; only with sweeps, which are done again after it",
        minimum=0,
    ),
    "hull": Setting(
        "number",
        1.1,
        "arguments of nonlinear terms are held beyond this multiple of their training range",
        minimum=0.0,
        above=True,
    ),
    **online_settings("etdrk4", 2e-3),
}


def settings(kind: str) -> Mapping[str, Setting]:
    """Settings for models of that kind."""
    return _SETTINGS if kind in ("ode", "dae") else {}


def presets(model: Model) -> Mapping[str, Mapping[str, Value]]:
    """Presets; the same for every model."""
    del model
    return {"recommended": {}}


def accepts(model: Model) -> tuple[bool, str]:
    """Vehicles whose inputs are the steering and its derivatives."""
    accepted, reason = is_vehicle(model)
    if not accepted:
        return accepted, reason
    missing = [name for name in OUTPUTS if name not in model.outputs]
    if missing:
        return False, f"{model.name} has no output {missing[0]}"
    first, *others = model.inputs
    if others != [f"{first}_dot", f"{first}_ddot"][: len(others)]:
        return False, f"the inputs of {model.name} are not a steering and its derivatives"
    return True, ""


def check(model: Model, settings: Mapping[str, Value]) -> None:
    """All validated settings fit every vehicle."""
    del model, settings


def fit(
    model: Model, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> ReducedVehicle:
    """Fit the slow dynamics and the manifold on the training runs."""
    assert isinstance(model, DynamicModel)
    began = time.perf_counter()
    runs = [run.at(run.maneuver.times) for run in training]
    shape = VehicleShape(model)
    modes = slow_modes(shape, float(settings["fastest"]))
    u = np.concatenate([run.inputs for run in runs])
    shapes = np.concatenate([shape.of(run.states) for run in runs])
    rates, motion = shape.motion(shapes, u)
    deviations = shapes - shape.reference
    z, speed = modes.coordinates(deviations, u)
    table = feature_table(shape, modes, z, speed, u, settings)
    features, odd, even, curved = table.features, table.odd, table.even, table.curved
    k, inputs = len(modes.rates), u.shape[1]
    columns = features.at(np.column_stack([z, speed]), u, table.parameters)
    ridge = float(settings["ridge"])
    slow_rates = rates @ modes.left.T - u[:, 1:] @ modes.feedthrough[:, : inputs - 1].T
    linear = z @ modes.rates.T + np.outer(u[:, 0], modes.drive)
    c = np.zeros((len(features.terms), k + 1 + PLANAR))
    c[curved, :k] = ridge_fit(columns[:, curved], slow_rates - linear, ridge)
    # Linear terms are scaled by the ranges of the training runs.
    c[odd[:k], :k] = modes.rates.T * largest(z)[:, None]
    c[odd[k], :k] = modes.drive * largest(u)[0]
    # Straight running at any speed goes on for ever: the speed changes by what is even alone.
    bent = table.bent
    c[bent, k] = ridge_fit(columns[:, bent], rates @ modes.speed_left, ridge)
    c[odd, k + 1] = ridge_fit(columns[:, odd], motion[:, 0], ridge)
    c[even[0], k + 2], c[even[1], k + 2] = shape.speed, 1.0
    c[bent, k + 2] = ridge_fit(columns[:, bent], motion[:, 1] - shape.speed - speed, ridge)
    c[odd, k + 3] = ridge_fit(columns[:, odd], motion[:, 2], ridge)
    reduced = ReducedVehicle(
        model,
        shape,
        features,
        table.parameters,
        c,
        ridge_fit(columns, deviations, ridge),
        np.vstack([modes.left, modes.speed_left]),
        np.vstack([modes.feedthrough, np.zeros(inputs)]),
        np.concatenate([3.0 * largest(z), [10.0, 1.0, 10.0, 10.0]]),
        Offline(),
        "explicit",
        REFIT_TOLERANCE,
        modes.symmetric,
    )
    for _ in range(int(settings["refits"])):
        reduced = _with_heading(reduced, training, runs, odd, k + 1)
    sweeps, kept = int(settings["sweeps"]), int(settings["terms"])
    if sweeps:
        goals = targets(reduced, training, runs)
        reduced = improved(reduced, goals, table.free, sweeps)
        if kept and finishes(reduced, goals):
            slow = np.column_stack([z, speed])
            fewer, kept_table = pruned(reduced, table, goals, slow, u, kept)
            fewer = improved(fewer, goals, kept_table.free, sweeps)
            # With too few terms a training run may fail.
            if finishes(fewer, goals):
                reduced = fewer
    evaluations = sum(run.counts[model.evaluations] for run in runs) + len(u)
    offline = Offline(time.perf_counter() - began, evaluations)
    return replace(
        reduced,
        offline=offline,
        solver=str(settings["solver"]),
        tolerance=float(settings["tolerance"]),
    )


def _with_heading(
    reduced: ReducedVehicle,
    training: Sequence[TrainingRun],
    runs: Sequence[Trajectory],
    odd: Sequence[int],
    column: int,
) -> ReducedVehicle:
    """The heading's coefficients fitted on its integral along reduced training runs."""
    integrals, headings = [], []
    k, heading = reduced.features.states, reduced.model.planar[2]
    for run, true in zip(training, runs, strict=True):
        path, failure = reduced.path(run.maneuver, run.start)
        if failure or not np.isfinite(path).all():
            continue
        columns = reduced.features.at(path[:, :k], true.inputs, reduced.parameters)[:, odd]
        steps = np.diff(true.time)[:, None]
        sums = np.cumsum(0.5 * steps * (columns[1:] + columns[:-1]), axis=0)
        integrals.append(np.vstack([np.zeros(len(odd)), sums]))
        headings.append(true.states[:, heading] - true.states[0, heading])
    if not integrals:
        return reduced
    along = np.concatenate(integrals)
    gap = np.concatenate(headings) - along @ reduced.coefficients[odd, column]
    coefficients = reduced.coefficients.copy()
    coefficients[odd, column] += ridge_fit(along, gap, REFIT_RIDGE)
    return replace(reduced, coefficients=coefficients)
