"""Reductions of the linearised model, without training: single track, modes, balanced.

A vehicle is linearised at straight running:

    z' = a z + b s,  shape = straight running + V z + K (s, s', ...) + speed mode

Where the inputs contain derivatives of the steering s (a rack that is prescribed), the deviation d
with d' = A d + B0 s + B1 s' + B2 s'' has none left in the rate of d - K0 s - K1 s', where K1 = B2
and K0 = B1 + A B2.  What is left drives no stabilised constraint: the eigenvalues at which those
cluster are no motion.  Speed, heading and position are those of every reduced vehicle: the speed
stays that of the start, and the dynamics are those at the speed of the model.

Reductors choose coordinates of the lateral modes, those that steering moves:

- `modal_truncation` (E. Davison, IEEE Trans. Autom. Control 11 (1966), 93-101) takes the slow
  modes.  The others follow the steering without delay (static correction), so that
  steady cornering is that of the linearisation.  Of a structure it takes all modes up to a
  frequency, linearised at the static state.
- `balanced_truncation` (B. C. Moore, IEEE Trans. Autom. Control 26 (1981), 17-32) is pyMOR's; its
  outputs are the yaw rate and the lateral speed.  A structure is balanced with free velocities
  (D. G. Meyer, S. Srinivasan, IEEE Trans. Autom. Control 41 (1996), 1632-1644).  Inputs are the
  forces of the ports, outputs their deflections; strains, many among a model's outputs, would crowd
  out the motion.  The projection is Galerkin's, in pyMOR's right basis alone: matrices stay
  symmetric.  Gramians need damping, and motion in soft springs has hardly any.  So they are those
  of q exp(-t / FADING), which weighs late motion less; nothing of this is in the reduced structure.

The single-track car (P. Riekert, T. E. Schunck, Ing.-Arch. 11 (1940), 210-224; M. Mitschke,
H. Wallentowitz, Dynamik der Kraftfahrzeuge, Springer) has the lateral speed V and the yaw rate r at
constant speed U.  With C_i, l_i effective cornering stiffness and position of the axles:

    m V' = -m U r + sum_i F_i,   J r' = sum_i l_i F_i,   F_i = C_i (steer_i - (V + l_i r) / U)

All other lateral states of the linearised model are eliminated as if they were at rest
(A_kk - A_kf A_ff^-1 A_fk, static condensation).  So the stiffnesses are effective ones: pneumatic
trail, roll steer, camber and, for a prescribed rack, the wheels' angle per rack are in them.  The
2x2 matrix of the car at U0 gives that at all speeds,

    A(U) = U [[0, -1], [0, 0]] + U0 / U A1

Velocity and acceleration of the rack are left out, and so are heave and pitch.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from pydantic import Field

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.interface import Method, OfflineCost, installed, offline_cost
from vehiclemor.reduction.projection.structural import (
    MASSLESS,
    ReducedStructure,
    StructuralSettings,
    modes_below,
    port_rates,
    reduced,
)
from vehiclemor.reduction.settings import FallbackSettings
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.features import PLANAR, FeatureListing
from vehiclemor.reduction.vehicle.linear_modes import (
    SlowModes,
    lateral_modes,
    slow_modes,
    within,
)
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.shape import VehicleShape, no_steered_vehicle
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.structures.system import factored

# Lateral acceleration (m/s^2) of steady cornering that gives states their typical size (ISO 7401).
CORNERING = 4.0
# Error scales: a multiple of steady cornering; of the speed (m/s), heading (rad), position (m).
MARGIN = 3.0
SPEED, HEADING, POSITION = 10.0, 1.0, 10.0
# Lateral speed (m/s) of a typical maneuver.
SIDEWARD = 0.5
# Time in s in which the motion of a structure counts less by a factor e.
FADING = 2.0
# Most coordinates n: from 2 n = 1000 on pyMOR iterates, which did not converge on the truck.
LARGEST = 499


class ModalVehicleSettings(FallbackSettings):
    """Settings for a vehicle."""

    fastest: float = Field(45.0, gt=0.0, description="modes of up to this |lambda| in 1/s are kept")


class RankedVehicleSettings(FallbackSettings):
    """Settings of what pyMOR reduces."""

    rank: int = Field(4, ge=1, description="coordinates of the lateral dynamics")


class StructuralModesSettings(StructuralSettings):
    """Settings for a structure."""

    highest: float = Field(100.0, gt=0.0, le=1e5, description="modes of up to so many Hz are kept")


class BalancedStructureSettings(StructuralSettings):
    """Settings for a structure."""

    rank: int = Field(45, ge=1, description="basis vectors")


def truncated(shape: VehicleShape, settings: ModalVehicleSettings) -> tuple[SlowModes, np.ndarray]:
    """The slow lateral modes, and what of the shape (n, inputs) follows the inputs at once.

    `InputError` if there are none.
    """
    modes, static_response = lateral_modes(shape)
    # In real form, rows of a block have the length |lambda|.
    slow = np.linalg.norm(modes.rates, axis=1) <= settings.fastest
    if not slow.any():
        limit = settings.fastest
        raise InputError(f"fastest is {limit:g} 1/s: no mode that steering moves is that slow")
    if not slow.all():
        steady = np.linalg.solve(modes.rates[~slow][:, ~slow], modes.input_matrix[~slow])
        static_response[:, 0] -= modes.right[:, ~slow] @ steady
    chosen = np.eye(len(slow))[slow]
    return within(modes, chosen, chosen.T), static_response


def balanced_modes(
    shape: VehicleShape, settings: RankedVehicleSettings
) -> tuple[SlowModes, np.ndarray]:
    """The lateral modes in pyMOR's bases, and what of the shape follows the inputs at once.

    `InputError` if pyMOR is missing or the rank is too high.
    """
    with installed("pyMOR"):
        from pymor.core.logger import log_levels
        from pymor.models.iosys import LTIModel
        from pymor.reductors.bt import BTReductor
    modes, static_response = lateral_modes(shape)
    if settings.rank >= (most := len(modes.rates)):
        raise InputError(f"rank is {settings.rank}; {shape.model.name} allows at most {most - 1}")
    outputs = shape.linearised.velocity_a[[0, 2]] @ modes.right
    full = LTIModel.from_matrices(modes.rates, modes.input_matrix[:, None], outputs)
    with log_levels({"pymor": "ERROR"}):
        projection: Any = BTReductor(full)
        projection.reduce(settings.rank)
    trial, test = projection.V.to_numpy(), projection.W.to_numpy()
    return within(modes, np.linalg.solve(test.T @ trial, test.T), trial), static_response


def linear_vehicle(model: DynamicModel, settings: Any, choose: Callable) -> ReducedVehicle:
    """The reduced vehicle of linear dynamics, in modes that `truncated` or the like chooses."""
    began = time.process_time()
    shape = VehicleShape(model)
    modes, static_response = choose(shape, settings)
    linear = shape.linearised
    k, inputs = len(modes.rates), linear.b.shape[1]
    listing = FeatureListing(k + 1, inputs)
    # Terms, rows of `c`: one, the lateral coordinates, the deviation of the speed, the inputs.
    # Columns of `c`: rates of coordinates and speed; yaw rate, forward and lateral speed.
    terms = [(value,) for value in (listing.number(1.0), *listing.z, *listing.u)]
    odd, even = [*range(1, k + 1), *range(k + 2, k + 2 + inputs)], [0, k + 1]
    # The vehicle equals its mirror image: the speed moves nothing sideways, steering changes no U.
    groups = ((tuple(odd), (*range(k), k + 1, k + 3)), (tuple(even), (k, k + 2)))
    features = listing.features(terms, groups)
    decoding = np.zeros((len(features.terms), len(linear.a)))
    decoding[odd] = np.vstack([modes.right.T, static_response.T])
    decoding[k + 1] = modes.speed_right
    c = np.zeros((len(features.terms), k + 1 + PLANAR))
    c[odd[: k + 1], :k] = np.vstack([modes.rates.T, modes.input_matrix])
    for column, row in ((k + 1, 0), (k + 3, 2)):
        c[odd, column] = decoding[odd] @ linear.velocity_a[row]
        c[odd[k:], column] += linear.velocity_b[row]
    c[even, k + 2] = shape.speed, 1.0
    lateral_scale = error_scale(shape, modes, static_response)
    return ReducedVehicle(
        model,
        shape,
        features,
        parameters=np.zeros(0),
        coefficients=c,
        decoding=decoding,
        encoding=modes.encoding,
        feedthrough=modes.input_shift,
        error_scale=np.concatenate([lateral_scale, [SPEED, HEADING, POSITION, POSITION]]),
        offline=linearisation_cost(shape, began),
        solver=settings.solver,
        tolerance=settings.tolerance,
    )


def error_scale(shape: VehicleShape, modes: SlowModes, static_response: np.ndarray) -> np.ndarray:
    """Magnitudes (k,) of lateral coordinates: a multiple of those in steady cornering."""
    steady = -np.linalg.solve(modes.rates, modes.input_matrix)
    turn = shape.linearised.velocity_a[0] @ (modes.right @ steady + static_response[:, 0])
    # At least a thousandth of the largest one, for coordinates that steady cornering leaves alone.
    sizes = np.maximum(np.abs(steady), 1e-3 * np.abs(steady).max())
    return MARGIN * CORNERING / shape.speed / abs(turn) * sizes


def linearisation_cost(shape: VehicleShape, began: float) -> OfflineCost:
    """Seconds since `began` (`time.process_time()`); two evaluations for every state and input."""
    return offline_cost(began, shape.model, further=2 * sum(shape.linearised.b.shape))


def single_track(
    model: DynamicModel, training: Training, settings: FallbackSettings
) -> ReducedVehicle:
    """The single-track car by static condensation."""
    began = time.process_time()
    shape = VehicleShape(model)
    linear, modes, inputs = shape.linearised, slow_modes(shape, np.inf), len(model.inputs)
    # States of the shape that are nearest to V and r; the others follow them and the steering.
    planar = np.argmax(np.abs(linear.velocity_a[[2, 0]]), axis=1)
    others = np.setdiff1d(np.arange(len(linear.a)), planar)
    drive = np.column_stack([linear.a[np.ix_(others, planar)], linear.b[others, 0]])
    response = np.zeros((len(linear.a), 3))
    # The speed's zero eigenvalue makes the matrix singular: the least-squares solution cuts it.
    response[others] = -np.linalg.lstsq(linear.a[np.ix_(others, others)], drive, rcond=1e-10)[0]
    response[planar, [0, 1]] = 1.0
    condensed = linear.a[planar] @ response
    condensed[:, 2] += linear.b[planar, 0]
    # What comes from the tires goes as one over the speed.
    tire = condensed[:, :2] - np.array([[0.0, -shape.speed], [0.0, 0.0]])
    # States V, r and the deviation of the speed.
    listing = FeatureListing(3, inputs)
    (v, r, slower), u, p = listing.z, listing.u[0], listing.p(0)
    part, speed = listing.let(p / (p + slower)), p + slower
    terms = ((v,), (r,), (u,), (part, v), (part, r), (speed, r), (speed,), (slower,))
    groups = (((0, 1, 2, 3, 4, 5), (0, 1, 3, 5)), ((6, 7), (4,)))
    c = np.zeros((len(terms), 3 + PLANAR))
    c[[3, 4], :2], c[2, :2], c[5, 0] = tire.T, condensed[:, 2], -1.0
    c[1, 3], c[6, 4], c[0, 5] = 1.0, 1.0, 1.0
    decoding = np.zeros((len(terms), len(shape.reference)))
    decoding[:3], decoding[7] = response.T, modes.speed_right
    turn = CORNERING / shape.speed
    scales = [MARGIN * SIDEWARD, MARGIN * turn, SPEED, HEADING, POSITION, POSITION]
    return ReducedVehicle(
        model,
        shape,
        listing.features(terms, groups),
        parameters=np.array([shape.speed]),
        coefficients=c,
        decoding=decoding,
        encoding=np.vstack([np.eye(len(linear.a))[planar], modes.speed_left]),
        feedthrough=np.zeros((3, inputs)),
        error_scale=np.array(scales),
        offline=linearisation_cost(shape, began),
        solver=settings.solver,
        tolerance=settings.tolerance,
    )


def modal(model: Any, training: Training, settings: Any) -> ReducedVehicle | ReducedStructure:
    """Linearise and truncate."""
    if model.kind != "structural":
        return linear_vehicle(model, settings, truncated)
    began = time.process_time()
    structure: Any = model.system.structure
    # On its springs and tires at the static state; dampers are left out.
    held = structure.with_port_springs(port_rates(model)[0])
    # Shifted, so that motion that hardly anything holds does no harm.
    shift = 1.0
    solve = factored(held + shift * structure.mass, "MMD_AT_PLUS_A").solve
    modes = modes_below(held, structure.mass, solve, -shift, settings.highest)
    return reduced(model, modes, settings, began)


def balanced(model: Any, training: Training, settings: Any) -> ReducedVehicle | ReducedStructure:
    """Balance and truncate; `InputError` if pyMOR is missing."""
    if model.kind != "structural":
        return linear_vehicle(model, settings, balanced_modes)
    with installed("pyMOR"):
        from pymor.core.logger import log_levels
        from pymor.models.iosys import SecondOrderModel
        from pymor.reductors.sobt import SOBTfvReductor
    began = time.process_time()
    structure, fading = model.system.structure, 1.0 / FADING
    mass, elastic = structure.mass.toarray(), structure.stiffness.toarray()
    ports, dampers = structure.ports.toarray(), structure.dampers.toarray()
    stiffness, rates = port_rates(model)
    damping = structure.damping_time * elastic + dampers @ dampers.T + (ports * rates) @ ports.T
    faded_stiffness = (
        structure.with_port_springs(stiffness).toarray() + fading * damping + fading**2 * mass
    )
    faded_damping = damping + 2.0 * fading * mass
    full = SecondOrderModel.from_matrices(mass, faded_damping, faded_stiffness, ports, ports.T)
    with log_levels({"pymor": "ERROR"}):
        reductor: Any = SOBTfvReductor(full)
        reductor.reduce(settings.rank)
    return reduced(model, reductor.V.to_numpy(), settings, began)


def check_balancing(model: Any, settings: Any) -> None:
    """Raise `InputError` if a structure is too large or too small, or its mass is singular."""
    if model.kind != "structural":
        return
    name, n = model.name, model.size
    if n > LARGEST:
        raise InputError(
            f"{name} has n = {n}; balanced_truncation solves dense Lyapunov equations for n up to "
            f"{LARGEST}: take a coarser mesh, or krylov"
        )
    if settings.rank >= n:
        raise InputError(f"rank is {settings.rank}; {name} allows at most {n - 1}")
    masses = np.linalg.eigvalsh(model.system.structure.mass.toarray())
    if masses[0] <= MASSLESS * masses[-1]:
        raise InputError(f"{name} has motions without mass; take krylov or craig_bampton for it")


def no_linear_model(model: Any) -> str:
    """Why a model is no vehicle whose lateral modes steering moves; every structure is linear."""
    return "" if model.kind == "structural" else no_steered_vehicle(model)


LINEAR_SINGLE_TRACK = Method(
    name="linear_single_track",
    summary="linear single-track car with the model's own effective stiffnesses",
    reference="10.1007/BF02086921",
    settings=dict.fromkeys(("ode", "dae"), FallbackSettings),
    refusal=no_steered_vehicle,
    fit=single_track,
    learns_from="nothing",
)

MODAL_TRUNCATION = Method(
    name="modal_truncation",
    summary="slow modes of the linearised model: lateral ones of a car, all of a structure",
    reference="10.1109/TAC.1966.1098264",
    settings={
        **dict.fromkeys(("ode", "dae"), ModalVehicleSettings),
        "structural": StructuralModesSettings,
    },
    refusal=no_linear_model,
    fit=modal,
    learns_from="nothing",
    band="highest",
)

BALANCED_TRUNCATION = Method(
    name="balanced_truncation",
    summary="what the inputs move and the outputs see most, of a linearised model, by pyMOR",
    reference="10.1109/9.544000",
    settings={
        **dict.fromkeys(("ode", "dae"), RankedVehicleSettings),
        "structural": BalancedStructureSettings,
    },
    refusal=no_linear_model,
    fit=balanced,
    check=check_balancing,
    learns_from="nothing",
    packages=("pymor",),
)
