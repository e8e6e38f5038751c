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

from vehiclemor.multibody.components.tire_coefficients import FIALA
from vehiclemor.multibody.quantities import WHEELS
from vehiclemor.reduction.interface import Method, Offline, offline_cost
from vehiclemor.reduction.settings import OnlineSettings, Solver, Tolerance
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle import tire_features as tf
from vehiclemor.reduction.vehicle.acceptance import no_steered_vehicle
from vehiclemor.reduction.vehicle.feature_system import feature_columns
from vehiclemor.reduction.vehicle.features import PLANAR, Features
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.regression import forward_selection, largest, ridge_fit
from vehiclemor.reduction.vehicle.shape import ShapeSamples, VehicleShape, shape_samples
from vehiclemor.reduction.vehicle.slow_modes import SlowModes, slow_modes
from vehiclemor.reduction.vehicle.trajectory_fit import improved, targets
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model

# The states that are coordinates.
COORDINATES = ("y_dot", "psi_dot", "phi", "phi_dot")
# Symmetric states for which the lifting has terms of its own.
SEEN = ("theta", "z_dot")
RIDGE = 1e-12


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
        25, ge=0, description="Gauss-Newton steps of all coefficients on whole training runs"
    )
    hull: float = Field(
        1.1, gt=0.0, description="arguments are held beyond this multiple of their training range"
    )
    saturation: float = Field(
        1.5,
        gt=0.0,
        description="a run with a tire beyond this multiple of the slip at which all of its "
        "contact slides is not trusted",
    )
    solver: Solver = "etdrk4"
    tolerance: Tolerance = 1e-3


class Samples(NamedTuple):
    """Samples of all training runs.

    Attributes
    ----------
    z, inputs
        Reduced coordinates (samples, 5), inputs (samples, inputs).
    rates
        Their rates (samples, 5).
    shape
        Of the vehicle's shape.
    """

    z: np.ndarray
    inputs: np.ndarray
    rates: np.ndarray
    shape: ShapeSamples


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
    runs = [run.recorded() for run in training]
    shape = VehicleShape(model)
    modes = slow_modes(shape, np.inf)
    of_shape = shape_samples(shape, runs)
    encoding = np.zeros((tf.STATES, len(shape.names)))
    for i, name in enumerate(COORDINATES):
        encoding[i, shape.names.index(name)] = 1.0
    encoding[tf.SPEED] = modes.speed_left
    samples = Samples(
        of_shape.deviations @ encoding.T, of_shape.inputs, of_shape.rates @ encoding.T, of_shape
    )
    outputs = np.concatenate([run.outputs for run in runs])
    text = tire_text(model, shape.speed, samples, outputs, settings)
    reduced = _fitted_on_rates(shape, modes, encoding, text, samples, settings)
    if settings.sweeps:
        goals = targets(reduced, training, runs, stride=1)
        (odd, lateral), (even, symmetric) = reduced.features.groups
        free = [(odd, 0), (odd, 1), (odd, 3), *((even[1:], column) for column in symmetric)]
        reduced = improved(reduced, goals, free, settings.sweeps)
    return replace(
        reduced,
        offline=offline_cost(began, model, runs, len(samples.inputs)),
        solver=settings.solver,
        tolerance=settings.tolerance,
    )


def tire_text(
    model: DynamicModel, speed: float, samples: Samples, outputs: np.ndarray, settings: TwoTrackSettings
) -> tf.Text:
    """Lines of the arguments, of slips and loads fitted to the training runs, and of the tires."""
    z, u = samples.z, samples.inputs
    part = 1.0 / (speed + z[:, tf.SPEED])
    values = np.column_stack([z[:, 0] * part, z[:, 1] * part, z[:, 2], z[:, 3] * part, u[:, 0]])
    ranges = largest(np.column_stack([values, z[:, tf.SPEED]]))
    inputs = u.shape[1]
    text = tf.arguments(speed, ranges, settings.hull, inputs)
    odd = [*tf.linear_terms(inputs), *tf.CUBIC, *tf.FASTER]
    even = ["1.0", "m", *tf.SQUARE, *tf.FASTER_SQUARE]

    def column(kind: str, wheel: str) -> np.ndarray:
        return outputs[:, model.outputs.index(f"{kind}_{wheel}")]

    parameters = {name: float(model.parameters[name]) for name in FIALA}
    parameters["saturation"] = settings.saturation
    full = text.copy()
    tables = {}
    for name, terms in (("odd", odd), ("even", even)):
        features = text.features(inputs, terms)
        tables[name] = terms, feature_columns(features, z, u, np.array(text.values))
    for axle, (left, right) in enumerate(tf.AXLES):
        slips = [np.tan(column("slip_angle", wheel)) for wheel in (left, right)]
        loads = [column("Fz", wheel) for wheel in (left, right)]
        linear = len(tf.linear_terms(inputs))
        for name, parity, target, given in (
            (f"slip{axle}", "odd", 0.5 * (slips[0] + slips[1]), linear),
            (f"slip_half{axle}", "even", 0.5 * (slips[0] - slips[1]), 1),
            (f"load{axle}", "even", 0.5 * (loads[0] + loads[1]), 1),
            (f"load_half{axle}", "odd", 0.5 * (loads[0] - loads[1]), linear),
        ):
            terms, columns = tables[parity]
            chosen = forward_selection(columns, target[:, None], given, settings.wheel_terms)
            weights = ridge_fit(columns[:, chosen], target, RIDGE)
            full.sum(name, [terms[i] for i in chosen], weights)
        static = float(np.mean(loads))
        tf.axle_lines(full, axle, static, parameters)
    return full


def _fitted_on_rates(
    shape: VehicleShape,
    modes: SlowModes,
    encoding: np.ndarray,
    text: tf.Text,
    samples: Samples,
    settings: TwoTrackSettings,
) -> ReducedVehicle:
    """Equations fitted to the accelerations of the training runs."""
    z, u, rates, of_shape = samples
    inputs, parameters = u.shape[1], np.array(text.values)
    forces = ["F0", "F1", "M0", "M1"]
    given_odd = [*(f"z{i}" for i in range(4)), *tf.linear_terms(inputs)[4:], *forces]
    odd_terms = [*given_odd, *tf.odd_candidates()]
    even_terms = ["z4", *tf.even_candidates(inputs)]

    def columns_of(terms: Sequence[str]) -> np.ndarray:
        return feature_columns(text.features(inputs, terms), z, u, parameters)

    def chosen(terms: Sequence[str], values: np.ndarray, given: int, more: int) -> list[str]:
        scaled = values / np.sqrt(np.mean(values**2, axis=0))
        return [terms[i] for i in forward_selection(columns_of(terms), scaled, given, more)]

    odd = chosen(odd_terms, rates[:, [0, 1, 3]], len(given_odd), settings.terms)
    forward = of_shape.motion[:, 1] - shape.speed - z[:, tf.SPEED]
    symmetric = np.column_stack([rates[:, tf.SPEED], forward])
    even = chosen(even_terms, symmetric, 1, settings.even_terms)
    terms = [*odd, "1.0", *even]
    features = text.features(inputs, terms, len(odd))
    columns = feature_columns(features, z, u, parameters)
    seen = [shape.names.index(name) for name in SEEN]
    lifting_terms = [*terms, *(term for term in even_terms if term not in even)]
    lifted_terms = chosen(
        lifting_terms, of_shape.deviations[:, seen], len(terms), settings.lifted_terms
    )
    k, c = len(odd), np.zeros((len(terms), tf.STATES + PLANAR))
    lateral = np.column_stack([rates[:, :4], of_shape.motion[:, [0, 2]]])
    c[:k, [0, 1, 2, 3, 5, 7]] = ridge_fit(columns[:, :k], lateral, RIDGE)
    # Straight running at any speed is an equilibrium.
    c[k + 2 :, [4, 6]] = ridge_fit(
        columns[:, k + 2 :], np.column_stack([rates[:, tf.SPEED], forward]), RIDGE
    )
    c[k, 6], c[k + 1, 6] = shape.speed, 1.0
    return ReducedVehicle(
        shape.model,
        shape,
        features,
        parameters,
        c,
        ridge_fit(columns_of(lifted_terms), of_shape.deviations, RIDGE),
        encoding,
        np.zeros((tf.STATES, inputs)),
        np.concatenate([3.0 * largest(z[:, :4]), [10.0, 1.0, 10.0, 10.0]]),
        Offline(),
        "dopri5",
        1e-6,
        modes.symmetric,
        text.features(inputs, lifted_terms),
    )


METHOD = Method(
    name="two_track",
    summary="two-track model with roll: exact tires at fitted slips and wheel loads",
    reference="10.1007/978-3-658-05068-9",
    settings=dict.fromkeys(("ode", "dae"), TwoTrackSettings),
    refusal=refusal,
    fit=fit,
)
