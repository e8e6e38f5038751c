"""Slow-manifold regression: the slow modes of a vehicle with a fitted nonlinear right-hand side.

Fast motion (hop, spins of the wheels, constraints) follows the slow one: trajectories soon lie on a
curved slow manifold (N. Fenichel, J. Differ. Equ. 31 (1979), 53-98; P. Kokotovic, H. Khalil,
J. O'Reilly, Singular Perturbation Methods in Control, SIAM 1999).  Projection on a linear subspace
can't follow its curvature; here the rates of the slow coordinates are fitted on training runs,
which lie on it, and the lag of the fast modes is learnt with them:

    z' = C phi(z, speed, u)

Features phi are z, the inputs, the tire forces of the axles, and products that are chosen one after
the other.  Heave and pitch, as slow as the lateral modes, are coordinates too.  What is linear for
small steering at the model's speed is exact.  The other coefficients are improved on complete runs,
since a heading that is off is a lateral position that is off.
"""

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from pydantic import Field

from vehiclemor.reduction.interface import Method, offline_cost
from vehiclemor.reduction.settings import AnyIntegrator, FallbackSettings, Tolerance
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.axle_forces import add_axles
from vehiclemor.reduction.vehicle.candidates import (
    even_candidates,
    odd_candidates,
    required_terms,
)
from vehiclemor.reduction.vehicle.features import PLANAR, feature_columns
from vehiclemor.reduction.vehicle.fitting import (
    YAW_BOUND,
    forward_selection,
    improved,
    largest,
    ridge_fit,
    targets_of,
)
from vehiclemor.reduction.vehicle.linear_modes import SlowModes, response, slow_modes
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.shape import (
    ShapeSamples,
    VehicleShape,
    no_vehicle,
    shape_samples,
)
from vehiclemor.reduction.vehicle.slow_features import (
    AXLES,
    HULL,
    Names,
    SlowFeatures,
    slow_features,
)
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.trajectory import Trajectory

# Speed (m/s), heading (rad) and position (m) below which their errors count absolutely.
ABSOLUTE = (10.0, 0.03, 10.0, 10.0)
# Symmetric modes that are coordinates: heave and pitch.
SYMMETRIC = 2
# Products chosen for the decoded shape.
DECODED = 24


class SlowManifoldSettings(FallbackSettings):
    """Settings for a vehicle."""

    fastest: float = Field(45.0, gt=0.0, description="modes of up to this |lambda| in 1/s are kept")
    terms: int = Field(48, ge=0, description="chosen products in the lateral equations")
    even_terms: int = Field(
        24, ge=0, description="chosen products in those of speed, heave and pitch"
    )
    ridge: float = Field(1e-12, ge=0.0, description="weight of the coefficients' size in the fit")
    steps: int = Field(8, ge=0, description="Gauss-Newton steps on whole training runs")
    heading_error: float = Field(
        YAW_BOUND,
        gt=0.0,
        description="error of heading in rad that the steps weigh like 0.03 m of place; by "
        "default the paper's bound on yaw, which also judges",
    )


class GuardedSettings(SlowManifoldSettings):
    """The same settings with a fallback."""

    fallback: AnyIntegrator = Field(
        "etdrk4", description="integrator of the full order for runs that are not to be trusted"
    )
    tolerance: Tolerance = 2e-3


def fit(model: DynamicModel, training: Training, settings: SlowManifoldSettings) -> ReducedVehicle:
    """Fit the slow dynamics and the manifold on the training runs."""
    began = time.process_time()
    runs, shape = [run.recorded() for run in training], VehicleShape(model)
    modes = slow_modes(shape, settings.fastest, SYMMETRIC)
    samples = shape_samples(shape, runs)
    listing = slow_features(shape, modes, samples)
    z = modes.coordinates(samples.deviations, samples.inputs)
    add_axles(listing, model, samples, z)
    reduced = _fitted_on_rates(shape, modes, listing, samples, settings)
    if settings.steps:
        targets = targets_of(reduced, training, runs, settings.heading_error)
        (odd, lateral), (even, symmetric) = reduced.features.groups
        # What small steering does is exact, and what torques of left wheels, heave and pitch do in
        # straight running; speed is constant there.
        required = required_terms(listing)
        odd, even = odd[len(required.small) :], even[len(required.straight) :]
        free = [(odd, i) for i in lateral]
        free += [(even, i) for i in symmetric]
        reduced = improved(reduced, targets, free, settings.steps)
    linear = listing.lateral + shape.inputs.steering
    reduced = _with_decoding(reduced, training, runs, samples, linear, settings.ridge)
    return replace(
        reduced,
        settling=modes.settling,
        offline=offline_cost(began, model, runs, len(samples.inputs)),
        solver=settings.solver,
        tolerance=settings.tolerance,
    )


def _fitted_on_rates(
    shape: VehicleShape,
    modes: SlowModes,
    listing: SlowFeatures,
    samples: ShapeSamples,
    settings: SlowManifoldSettings,
) -> ReducedVehicle:
    """Equations fitted on the rates of the training runs; nothing is decoded yet."""
    u, motion, k, n = samples.inputs, samples.planar_velocity, listing.lateral, listing.speed
    z = modes.coordinates(samples.deviations, u)
    # Of the steering the next input is the derivative.
    moved = modes.input_shift[:, : shape.inputs.steering - 1]
    rates = samples.rates @ modes.encoding.T - u[:, 1 : shape.inputs.steering] @ moved.T
    lateral = np.column_stack([rates[:, :k], motion[:, 0], motion[:, 2]])
    # Of heave and pitch in straight running: their rates, and the forward speed.
    heave, forward = modes.rates[k:, k:], shape.linearised.velocity_a[1] @ modes.right[:, k:]
    speed = z[:, k:n] @ forward + z[:, n]
    straight_rates = np.column_stack([z[:, k:n] @ heave.T, np.zeros(len(z)), speed])
    symmetric = np.column_stack([rates[:, k:], motion[:, 1] - shape.speed]) - straight_rates

    def chosen(
        fixed: Sequence[Names], others: Sequence[Names], values: np.ndarray, more: int
    ) -> list[Names]:
        terms = [*fixed, *(term for term in others if term not in fixed)]
        columns = listing.columns(terms, z, u)
        return [terms[i] for i in forward_selection(columns, values, len(fixed), more)]

    required, even_others = required_terms(listing), even_candidates(listing)
    small, straight, scale = required.small, required.straight, largest(z[:, :n])
    exact, shapes = _small_motion(shape, modes, scale[:k], largest(u[:, : shape.inputs.steering]))
    if shape.inputs.torques:
        exact = np.vstack([exact, left_torques(shape, modes, listing)])
    odd = chosen([*small, *required.odd], odd_candidates(listing), rates[:, :k], settings.terms)
    even = chosen(required.even, even_others, symmetric, settings.even_terms)
    terms, known = [*odd, *straight, *even], len(small)
    columns, first, last = listing.columns(terms, z, u), len(odd), len(odd) + len(straight)
    c = np.zeros((len(terms), n + 1 + PLANAR))
    c[:known, listing.odd_columns] = exact
    c[known:first, listing.odd_columns] = ridge_fit(
        columns[:, known:first], lateral - columns[:, :known] @ exact, settings.ridge
    )
    # Straight running at any speed is an equilibrium: the terms 1 and speed make up U.
    forward_speed = n + 2
    c[[first, first + 1], forward_speed] = shape.speed, 1.0
    c[first + 2 : last, k:n] = heave.T * scale[k:, None]
    c[first + 2 : last, forward_speed] = forward * scale[k:]
    c[last:, listing.even_columns] = ridge_fit(columns[:, last:], symmetric, settings.ridge)
    every_term = [*terms, *even_others]
    linear = [*small, *required.odd, *straight, *required.even]
    decoded = chosen(linear, every_term, samples.deviations, DECODED)
    decoded.sort(key=lambda term: term not in odd)
    decoding = np.zeros((len(decoded), len(shape.indices)))
    decoding[: len(shapes)] = shapes
    return ReducedVehicle(
        shape.model,
        shape,
        features=listing.of_terms(terms, first),
        parameters=np.array(listing.values),
        coefficients=c,
        decoding=decoding,
        encoding=modes.encoding,
        feedthrough=modes.input_shift,
        error_scale=np.concatenate([3.0 * scale, ABSOLUTE]),
        decoded_features=listing.of_terms(decoded, sum(term in odd for term in decoded)),
    )


def _small_motion(
    shape: VehicleShape, modes: SlowModes, coordinates: np.ndarray, steering: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What small steering does at the model's speed: rates (terms, lateral + 2), shapes (terms, n).

    Terms are the lateral coordinates, the steering and its derivatives, as parts of ranges.
    """
    k, linear, sideways = len(coordinates), shape.linearised, [0, 2]
    scale = np.concatenate([coordinates, HULL * steering])[:, None]
    shapes = np.vstack([modes.right[:, :k].T, modes.slaved.T])
    rates = np.zeros((len(shapes), k + len(sideways)))
    rates[: k + 1, :k] = np.vstack([modes.rates[:k, :k].T, modes.input_matrix[:k]])
    rates[:, k:] = shapes @ linear.velocity_a[sideways].T
    rates[k:, k:] += linear.velocity_b[sideways, : len(steering)].T
    return scale * rates, scale * shapes


def left_torques(shape: VehicleShape, modes: SlowModes, listing: SlowFeatures) -> np.ndarray:
    """Coefficients (terms, odd columns) of what left wheels have more, linearised."""
    rows = np.zeros((len(AXLES), len(listing.odd_columns)))
    for axle in range(len(rows)):
        change = shape.inputs.left_torque(*AXLES[axle]) * listing.reach[f"D{axle}"]
        rates, velocity = response(shape, modes, change)
        rows[axle] = [*rates[: listing.lateral], velocity[0], velocity[2]]
    return rows


def _with_decoding(
    reduced: ReducedVehicle,
    training: Training,
    runs: Sequence[Trajectory],
    samples: ShapeSamples,
    linear: int,
    ridge: float,
) -> ReducedVehicle:
    """The reduced vehicle whose shapes are fitted along its own runs.

    Where one of these fails they are fitted along the training run.  Antisymmetric shapes use odd
    terms, of which the first are linear and stay, symmetric ones even terms.
    """
    features, states = reduced.decoded_features, reduced.features.states
    assert features is not None
    paths = [reduced.path(run.maneuver, run.start) for run in training]
    parts = [
        reduced.encoded_path(true.states, true.inputs) if path is None else path
        for path, true in zip(paths, runs, strict=True)
    ]
    z = np.ascontiguousarray(np.concatenate(parts)[:, :states])
    columns = feature_columns(features, z, samples.inputs, reduced.parameters)
    decoding, image = reduced.decoding.copy(), samples.deviations @ reduced.shape.mirror.T
    odd, even = (list(terms) for terms, _ in features.groups)
    known, odd = odd[:linear], odd[linear:]
    antisymmetric = 0.5 * (samples.deviations - image) - columns[:, known] @ decoding[known]
    decoding[odd] = ridge_fit(columns[:, odd], antisymmetric, ridge)
    decoding[even] = ridge_fit(columns[:, even], 0.5 * (samples.deviations + image), ridge)
    return replace(reduced, decoding=decoding)


METHOD = Method(
    name="slow_manifold",
    summary="slow modes with a right-hand side fitted on training runs, fast motion slaved",
    reference="10.1137/1.9781611971118",
    settings=dict.fromkeys(("ode", "dae"), SlowManifoldSettings),
    refusal=no_vehicle,
    fit=fit,
)

GUARDED = replace(
    METHOD,
    name="guarded",
    summary="slow_manifold where it can be trusted, the full order where not",
    settings=dict.fromkeys(("ode", "dae"), GuardedSettings),
    variant_of="slow_manifold",
)
