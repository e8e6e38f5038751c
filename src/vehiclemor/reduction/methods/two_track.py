"""Two-track model with roll: exact tires at quasi-static slips and wheel loads, fitted to runs.

Lateral speed, yaw rate, roll and speed are the slow motion of a vehicle; hop, spins and linkages
follow it (N. Fenichel, J. Differ. Equ. 31 (1979), 53-98).  So the slip and the load of every wheel
are functions of the slow motion and of the steering, and the tires' own law makes forces of them
(two-track model with load transfer: M. Mitschke, H. Wallentowitz, Dynamik der Kraftfahrzeuge, 5th
ed., Springer 2014).  The accelerations are linear in these forces, in the coordinates and the
steering, and in a few products that are chosen one after the other; their coefficients are fitted
to the accelerations of training runs, then to whole runs.
"""

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from pydantic import Field

from vehiclemor.errors import InputError
from vehiclemor.multibody.components.tire_coefficients import FIALA
from vehiclemor.reduction.interface import Method, offline_cost
from vehiclemor.reduction.settings import OnlineSettings, Solver, Tolerance
from vehiclemor.reduction.training import Training, TrainingRun
from vehiclemor.reduction.vehicle import tire_features as tf
from vehiclemor.reduction.vehicle.features import PLANAR, Term, feature_columns
from vehiclemor.reduction.vehicle.reach_of_runs import training_reach
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.regression import forward_selection, largest, ridge_fit
from vehiclemor.reduction.vehicle.shape import (
    ShapeSamples,
    VehicleShape,
    no_steered_vehicle,
    shape_samples,
)
from vehiclemor.reduction.vehicle.slow_modes import SlowModes, slow_modes
from vehiclemor.reduction.vehicle.trajectory_fit import improved, targets
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.mirror_image import partners
from vehiclemor.simulation.model import Model

# The states that are coordinates, and those of them whose rates are accelerations.
COORDINATES = ("y_dot", "psi_dot", "phi", "phi_dot")
ACCELERATIONS = (0, 1, 3)
# Symmetric states for which the lifting has terms of its own.
SEEN = ("theta", "z_dot")
RIDGE = 1e-12
# States that move less than this part of their range count as not moved.
STILL = 1e-6
# How often steering is followed through the equations; relative singular values that are rounding.
POWERS, RANK = 4, 1e-10


class TwoTrackSettings(OnlineSettings):
    """Settings for a vehicle."""

    terms: int = Field(24, ge=0, description="chosen products in the lateral equations")
    even_terms: int = Field(16, ge=0, description="chosen products in those of the speed")
    wheel_terms: int = Field(
        9, ge=0, description="chosen products in the slip, and in the load, of an axle's wheels"
    )
    lifted_terms: int = Field(
        20, ge=0, description="products chosen for pitch and heave, beside those of the equations"
    )
    sweeps: int = Field(
        8, ge=0, description="Gauss-Newton steps on whole training runs, once and again"
    )
    hull: float = Field(
        1.1, gt=0.0, description="arguments are held beyond this multiple of their training range"
    )
    reversal: float = Field(
        0.5,
        gt=0.0,
        description="largest part of the training's product of steering and its rate that is "
        "trusted",
    )
    saturation: float = Field(
        1.2,
        gt=0.0,
        description="a run with a tire beyond this multiple of the slip at which all of its "
        "contact slides is not trusted",
    )
    solver: Solver = "etdrk4"
    tolerance: Tolerance = 1e-3


class Samples(NamedTuple):
    """Samples of all training runs: reduced coordinates z (samples, 5) and their rates first."""

    z: np.ndarray
    inputs: np.ndarray
    rates: np.ndarray
    shape: ShapeSamples
    outputs: np.ndarray


def straight(model: DynamicModel, training: Training) -> list[TrainingRun]:
    """Training runs that begin in straight running, at any speed; `InputError` if none does."""
    shape = VehicleShape(model)
    dropped = slow_modes(shape, np.inf).symmetric

    def deviation(run: TrainingRun) -> np.ndarray:
        return shape.of(model.start(run.start)[None])[0] - shape.reference

    found = [run for run in training if not len(dropped.amplitudes(deviation(run)))]
    if not found:
        raise InputError(f"no training run of {model.name} begins in straight running")
    return found


def tire_features(
    shape: VehicleShape, samples: Samples, settings: TwoTrackSettings
) -> tf.TireFeatures:
    """The arguments, slips and loads fitted to the training runs, and what the tires do."""
    z, u = samples.z, samples.inputs
    model = shape.model
    reach = settings.hull * largest(tf.argument_values(shape.speed, z, u))
    reversal = settings.reversal * float(largest(u[:, :1] * u[:, 1:2])[0])
    made = tf.arguments(u.shape[1], shape.speed, reach, reversal)
    linear = linear_terms(made)
    odd = [*linear, *made.cubic, *made.faster(made.alone(made.a))]
    even = [(made.number(1.0),), (made.m,), *made.square, *made.faster(made.square)]
    columns = feature_columns(made.of([*odd, *even]), z, u, np.array(made.parameters))
    parities = (
        (odd, columns[:, : len(odd)], len(linear)),
        (even, columns[:, len(odd) :], 1),
    )

    def of_wheels(kind: str, wheels: Sequence[str]) -> np.ndarray:
        return samples.outputs[:, [model.outputs.index(f"{kind}_{wheel}") for wheel in wheels]]

    for axle, wheels in enumerate(tf.AXLES):
        slips, loads = np.tan(of_wheels("slip_angle", wheels)), of_wheels("Fz", wheels)
        for name, values, mean_parity in (("slip", slips, 0), ("load", loads, 1)):
            mean, half = values @ [0.5, 0.5], values @ [0.5, -0.5]
            for end, target, parity in (("", mean, mean_parity), ("_half", half, 1 - mean_parity)):
                terms, table, first = parities[parity]
                chosen = forward_selection(table, target[:, None], first, settings.wheel_terms)
                weights = ridge_fit(table[:, chosen], target, RIDGE)
                total = made.sum([terms[i] for i in chosen], weights.tolist())
                made.by_name[f"{name}{end}{axle}"] = total
        parameters = {name: float(model.parameters[name]) for name in FIALA}
        tf.add_axle(made, axle, tf.Tire(parameters, float(loads.mean()), settings.saturation))
    return made


def linear_terms(made: tf.TireFeatures) -> list[Term]:
    """The arguments and derivatives of the steering; they are not held."""
    return made.alone([*made.raw[:5], *made.raw[6:]])


def fitted_on_rates(
    shape: VehicleShape,
    modes: SlowModes,
    encoding: np.ndarray,
    made: tf.TireFeatures,
    samples: Samples,
    settings: TwoTrackSettings,
) -> ReducedVehicle:
    """Equations fitted to the accelerations of the training runs."""
    z, u, rates, of_shape, _ = samples
    inputs, parameters = u.shape[1], np.array(made.parameters)

    def columns_of(terms: Sequence[Term]) -> np.ndarray:
        return feature_columns(made.of(terms), z, u, parameters)

    def chosen(
        given: Sequence[Term], others: Sequence[Term], values: np.ndarray, more: int
    ) -> list[Term]:
        terms = [*given, *(term for term in others if term not in given)]
        scaled = values / np.sqrt(np.mean(values**2, axis=0))
        numbers = forward_selection(columns_of(terms), scaled, len(given), more)
        return [terms[i] for i in numbers]

    forces = made.alone(made.by_name[name] for name in ("F0", "F1", "M0", "M1"))
    plain = [*made.alone(made.z[:4]), *linear_terms(made)[4:], *forces]
    odd = chosen(plain, tf.odd_candidates(made), rates[:, ACCELERATIONS], settings.terms)
    forward = of_shape.motion[:, 1] - shape.speed - z[:, tf.SPEED]
    symmetric = np.column_stack([rates[:, tf.SPEED], forward])
    candidates = tf.even_candidates(made)
    even = chosen([(made.z[tf.SPEED],)], candidates, symmetric, settings.even_terms)
    terms = [*odd, (made.number(1.0),), *even]
    seen = of_shape.deviations[:, [shape.names.index(name) for name in SEEN]]
    lifted = chosen(terms, candidates, seen, settings.lifted_terms)
    columns = columns_of(terms)
    k, c = len(odd), np.zeros((len(terms), tf.STATES + PLANAR))
    lateral = np.column_stack([rates[:, :4], of_shape.motion[:, [0, 2]]])
    c[:k, tf.LATERAL] = ridge_fit(columns[:, :k], lateral, RIDGE)
    # Straight running at any speed is an equilibrium.
    c[k, 6], c[k + 1, 6] = shape.speed, 1.0
    c[k + 2 :, tf.SYMMETRIC] = ridge_fit(columns[:, k + 2 :], symmetric, RIDGE)
    return ReducedVehicle(
        shape.model,
        shape,
        made.of(terms, len(odd)),
        parameters,
        c,
        both_sides(shape, columns_of(lifted), len(odd), of_shape.deviations),
        encoding,
        np.zeros((tf.STATES, inputs)),
        np.concatenate([3.0 * largest(z[:, :4]), [10.0, 1.0, 10.0, 10.0]]),
        transient=modes.symmetric,
        lifted_features=made.of(lifted),
    )


def both_sides(
    shape: VehicleShape, columns: np.ndarray, odd: int, deviations: np.ndarray
) -> np.ndarray:
    """Coefficients (terms, n) of the shape: of its odd part by odd terms, which are the first."""
    image = deviations @ mirror(shape).T
    parts = np.split(columns, [odd], axis=1)
    return np.vstack(
        [
            ridge_fit(part, 0.5 * (deviations + sign * image), RIDGE)
            for part, sign in zip(parts, (-1, 1), strict=True)
        ]
    )


def mirror(shape: VehicleShape) -> np.ndarray:
    """Signed permutation (n, n): the deviation of the shape in the vehicle's mirror image.

    Names tell the partners.  Signs follow from what steering moves, which changes its sign in the
    mirror: of a state without a partner, and against its partner's of any other.
    """
    # Not its modes: a symmetric one of the same frequency would be mixed with a lateral one.
    linear = shape.linearised
    parts = [np.linalg.lstsq(linear.a, linear.b[:, :1], rcond=RANK)[0], linear.b]
    for _ in range(POWERS):
        parts.append(linear.a @ parts[-1])
    moved = np.hstack(parts)
    moved /= largest(moved)
    partner = partners(shape.names)
    matrix = np.zeros((len(partner), len(partner)))
    for i, j in enumerate(partner):
        if i == j:
            matrix[i, i] = -1.0 if np.abs(moved[i]).max() > STILL else 1.0
        else:
            matrix[i, j] = -1.0 if moved[i] @ moved[j] > 0.0 else 1.0
    return matrix


def lifted_anew(reduced: ReducedVehicle, training: Training, samples: Samples) -> ReducedVehicle:
    """The lifting fitted to where the reduced runs are, whose speed has become their own."""
    paths = [reduced.path(run.maneuver, run.start) for run in training]
    kept = [path for path in paths if path is not None]
    if len(kept) < len(paths):
        return reduced
    assert reduced.lifted_features is not None
    z = np.ascontiguousarray(np.concatenate(kept)[:, : tf.STATES])
    columns = feature_columns(reduced.lifted_features, z, samples.inputs, reduced.parameters)
    odd = len(reduced.features.groups[0][0])
    lifting = both_sides(reduced.shape, columns, odd, samples.shape.deviations)
    return replace(reduced, lifting=lifting)


def refusal(model: Model) -> str:
    """Why a model has not the coordinates or the tires."""
    if reason := no_steered_vehicle(model):
        return reason
    known = (*model.coordinates, *model.speeds, *model.parameters.entries)
    missing = [name for name in (*COORDINATES, *FIALA) if name not in known]
    return f"{model.name} has no {', '.join(missing)}" if missing else ""


def fit(model: DynamicModel, training: Training, settings: TwoTrackSettings) -> ReducedVehicle:
    """Fit slips, loads, accelerations and the other states to the training runs."""
    began = time.process_time()
    own = straight(model, training)
    runs = [run.recorded() for run in own]
    shape = VehicleShape(model)
    modes, of_shape = slow_modes(shape, np.inf), shape_samples(shape, runs)
    encoding = np.zeros((tf.STATES, len(shape.names)))
    for i, name in enumerate(COORDINATES):
        encoding[i, shape.names.index(name)] = 1.0
    encoding[tf.SPEED] = modes.speed_left
    samples = Samples(
        of_shape.deviations @ encoding.T,
        of_shape.inputs,
        of_shape.rates @ encoding.T,
        of_shape,
        np.concatenate([run.outputs for run in runs]),
    )
    made = tire_features(shape, samples, settings)
    reduced = fitted_on_rates(shape, modes, encoding, made, samples, settings)
    if settings.sweeps:
        goals = targets(reduced, own, runs, stride=1)
        (odd, _), (even, symmetric) = reduced.features.groups
        free = [*((odd, i) for i in ACCELERATIONS), *((even[2:], i) for i in symmetric)]
        reduced = improved(reduced, goals, free, settings.sweeps, power=1.0)
        reduced = improved(reduced, goals, free, settings.sweeps)
        reduced = lifted_anew(reduced, own, samples)
    return replace(
        reduced,
        reach=training_reach(reduced, own, runs),
        offline=offline_cost(began, model, runs, len(samples.inputs)),
        solver=settings.solver,
        tolerance=settings.tolerance,
    )


METHOD = Method(
    name="two_track",
    summary="two-track model with roll: exact tires at fitted slips and wheel loads",
    reference="10.1007/978-3-658-05068-9",
    settings=dict.fromkeys(("ode", "dae"), TwoTrackSettings),
    refusal=refusal,
    fit=fit,
)
