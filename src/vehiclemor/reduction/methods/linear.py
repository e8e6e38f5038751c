"""Reductions of a linearised model without training: modes, balancing, IRKA, single-track car.

A vehicle is linearised at straight running:

    z' = a z + b s,  shape = straight running + V z + K (s, s', ...) + speed mode

Where the inputs contain derivatives of the steering s (a rack that is prescribed), the deviation d
with d' = A d + B0 s + B1 s' + B2 s'' has none left in the rate of d - K0 s - K1 s', where K1 = B2
and K0 = B1 + A B2.  What is left drives no stabilised constraint: the eigenvalues at which those
cluster are no motion.  Speed, heading and place are kept as in every reduced vehicle: the speed
stays that of the start, and the dynamics are those of the model's own speed.

A structure is linearised at its static state.

Modes: after E. Davison, IEEE Trans. Autom. Control 11 (1966), 93-101, of the modes that steering
moves those with |lambda| up to `fastest` are kept.  The others are dropped, or follow the steering
without delay (static correction: residualisation), so that steady cornering is that of the
linearisation.  Of a structure all modes up to a frequency are kept.

Balanced truncation, by pyMOR, of a vehicle: B. C. Moore, IEEE Trans. Autom. Control 26 (1981),
17-32.  A structure is balanced with free velocities: D. G. Meyer, S. Srinivasan, Balancing and
model reduction for second-order form linear systems, IEEE Trans. Autom. Control 41 (1996),
1632-1644.  Inputs are the forces of the ports, outputs their deflections; strains, many among a
model's outputs, would crowd out the motion.  The projection is Galerkin's, in pyMOR's right basis
alone: matrices stay symmetric.  Gramians need damping, and what soft springs hold has hardly any.
So they are those of q exp(-t / FADING), which weighs late motion less; nothing of this is in the
reduced structure.

Interpolation (IRKA), by pyMOR, of a vehicle: S. Gugercin, A. C. Antoulas, C. Beattie, H2 model
reduction for large-scale linear dynamical systems, SIAM J. Matrix Anal. Appl. 30 (2008), 609-638.
Of structures pyMOR has the same iteration in second-order form (SOR-IRKA), which did not converge
on the truck.

The linear single-track car (bicycle model): P. Riekert, T. E. Schunck, Ing.-Arch. 11 (1940),
210-224; M. Mitschke, H. Wallentowitz, Dynamik der Kraftfahrzeuge (Springer).
"""

import time
from typing import Any, Literal

import numpy as np
from pydantic import Field

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.interface import Method, OfflineCost, installed, offline_cost
from vehiclemor.reduction.projection import structural
from vehiclemor.reduction.projection.structural import (
    ReducedStructure,
    StructuralSettings,
    free_modes,
    port_rates,
)
from vehiclemor.reduction.settings import OnlineSettings
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

# Lateral acceleration (m/s^2) of steady cornering that gives states their typical size (ISO 7401).
CORNERING = 4.0
# Error scales: a multiple of steady cornering; of the speed (m/s), heading (rad), place (m).
MARGIN = 3.0
SPEED, HEADING, PLACE = 10.0, 1.0, 10.0
# Time in s in which motion counts less by a factor e.
FADING = 2.0
# Most coordinates n: from 2 n = 1000 on pyMOR iterates, which did not converge on the truck.
LARGEST = 499
# Lateral speed (m/s) of a typical maneuver.
SIDEWARD = 0.5


def linearisation_cost(shape: VehicleShape, began: float) -> OfflineCost:
    """Seconds since `began`; two evaluations for every state and input."""
    return offline_cost(began, shape.model, further=2 * sum(shape.linearised.b.shape))


def error_scale(shape: VehicleShape, modes: SlowModes, follow: np.ndarray) -> np.ndarray:
    """Magnitudes (k,) of lateral coordinates: a multiple of those in steady cornering."""
    steady = -np.linalg.solve(modes.rates, modes.input_matrix)
    turn = shape.linearised.motion_a[0] @ (modes.right @ steady + follow[:, 0])
    # At least a thousandth of the largest one, for coordinates that steady cornering leaves alone.
    sizes = np.maximum(np.abs(steady), 1e-3 * np.abs(steady).max())
    return MARGIN * CORNERING / shape.speed / abs(turn) * sizes


def linear_vehicle(
    shape: VehicleShape,
    modes: SlowModes,
    follow: np.ndarray,
    settings: OnlineSettings,
    began: float,
) -> ReducedVehicle:
    """The reduced vehicle of linear dynamics; cost from `began` (`time.process_time()`) on."""
    linear = shape.linearised
    k, inputs = len(modes.rates), linear.b.shape[1]
    listing = FeatureListing(k + 1, inputs)
    terms = [(value,) for value in (listing.number(1.0), *listing.z, *listing.u)]
    odd, even = [*range(1, k + 1), *range(k + 2, k + 2 + inputs)], [0, k + 1]
    # The vehicle is its own mirror image: the speed moves nothing sideways, steering changes no U.
    groups = ((tuple(odd), (*range(k), k + 1, k + 3)), (tuple(even), (k, k + 2)))
    features = listing.features(terms, groups)
    decoding = np.zeros((len(features.terms), len(linear.a)))
    decoding[odd] = np.vstack([modes.right.T, follow.T])
    decoding[k + 1] = modes.speed_right
    c = np.zeros((len(features.terms), k + 4))
    c[odd[: k + 1], :k] = np.vstack([modes.rates.T, modes.input_matrix])
    for column, row in ((k + 1, 0), (k + 3, 2)):
        c[odd, column] = decoding[odd] @ linear.motion_a[row]
        c[odd[k:], column] += linear.motion_b[row]
    c[even, k + 2] = shape.speed, 1.0
    return ReducedVehicle(
        shape.model,
        shape,
        features,
        np.zeros(0),
        c,
        decoding,
        modes.encoding,
        modes.input_shift,
        np.concatenate([error_scale(shape, modes, follow), [SPEED, HEADING, PLACE, PLACE]]),
        linearisation_cost(shape, began),
        settings.solver,
        settings.tolerance,
        modes.symmetric,
    )


def no_linear_model(model: Any) -> str:
    """Why a model is no vehicle whose lateral modes steering moves; every structure is linear."""
    return "" if model.kind == "structural" else no_steered_vehicle(model)


class ModalTruncationSettings(OnlineSettings):
    """Settings for a vehicle."""

    fastest: float = Field(45.0, gt=0.0, description="modes of up to this |lambda| in 1/s are kept")
    static_correction: Literal["yes", "no"] = Field(
        "yes", description="dropped modes follow the steering without delay"
    )


class StructuralModesSettings(StructuralSettings):
    """Settings for a structure."""

    highest: float = Field(100.0, gt=0.0, le=1e5, description="modes of up to so many Hz are kept")


def truncated(
    modes: SlowModes, follow: np.ndarray, fastest: float, static: bool
) -> tuple[SlowModes, np.ndarray]:
    """The modes with |lambda| up to `fastest` (1/s), the others static or dropped."""
    # In real form, rows of a block have the length |lambda|.
    kept = np.linalg.norm(modes.rates, axis=1) <= fastest
    if not kept.any():
        raise InputError(f"fastest is {fastest:g} 1/s: no mode that steering moves is that slow")
    if static and not kept.all():
        rest = np.linalg.solve(modes.rates[~kept][:, ~kept], modes.input_matrix[~kept])
        follow = follow.copy()
        follow[:, 0] -= modes.right[:, ~kept] @ rest
    chosen = np.eye(len(kept))[kept]
    return within(modes, chosen, chosen.T), follow


def by_modes(model: Any, training: Training, settings: Any) -> ReducedVehicle | ReducedStructure:
    """Linearise and truncate; no training run is looked at.  `InputError` if no mode is kept."""
    began = time.process_time()
    if model.kind == "structural":
        return structural.reduced(model, [free_modes(model, settings.highest)], settings, began)
    shape = VehicleShape(model)
    static = settings.static_correction == "yes"
    modes, follow = truncated(*lateral_modes(shape), settings.fastest, static)
    return linear_vehicle(shape, modes, follow, settings, began)


class LinearVehicleSettings(OnlineSettings):
    """Settings of what pyMOR reduces."""

    rank: int = Field(4, ge=1, description="coordinates of the lateral dynamics")


def linear_reduction(
    reductor: Any, model: DynamicModel, settings: LinearVehicleSettings, began: float
) -> ReducedVehicle:
    """A vehicle whose lateral dynamics stand in the bases that a reductor of pyMOR finds.

    Its outputs are the yaw rate and the lateral speed; `InputError` if the rank is too high.  The
    cost is counted from `began` (`time.process_time()`) on.
    """
    from pymor.core.logger import log_levels
    from pymor.models.iosys import LTIModel

    shape = VehicleShape(model)
    modes, follow = lateral_modes(shape)
    if settings.rank >= (most := len(modes.rates)):
        raise InputError(f"rank is {settings.rank}; {model.name} allows at most {most - 1}")
    c = shape.linearised.motion_a[[0, 2]] @ modes.right
    with log_levels({"pymor": "ERROR"}):
        made = reductor(LTIModel.from_matrices(modes.rates, modes.input_matrix[:, None], c))
        made.reduce(settings.rank)
    trial, test = (part.to_numpy() for part in (made.V, made.W))
    found = within(modes, np.linalg.solve(test.T @ trial, test.T), trial)
    return linear_vehicle(shape, found, follow, settings, began)


class BalancedTruncationSettings(StructuralSettings):
    """Settings for a structure."""

    rank: int = Field(45, ge=1, description="basis vectors")


def check_balanced(model: Any, settings: Any) -> None:
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
    if masses[0] <= structural.MASSLESS * masses[-1]:
        raise InputError(f"{name} has motions without mass; take krylov or craig_bampton for it")


def balanced(model: Any, training: Training, settings: Any) -> ReducedVehicle | ReducedStructure:
    """Balance and truncate; no training run is looked at.  `InputError` if pyMOR is missing."""
    with installed("pyMOR"):
        from pymor.core.logger import log_levels
        from pymor.models.iosys import SecondOrderModel
        from pymor.reductors.bt import BTReductor
        from pymor.reductors.sobt import SOBTfvReductor
    began = time.process_time()
    if model.kind != "structural":
        return linear_reduction(BTReductor, model, settings, began)
    s, fading = model.system.structure, 1.0 / FADING
    mass, elastic, ports, beside = (m.toarray() for m in (s.mass, s.stiffness, s.ports, s.dampers))
    stiffness, rates = port_rates(model)
    damping = s.damping_time * elastic + beside @ beside.T + (ports * rates) @ ports.T
    held = s.held(stiffness).toarray() + fading * damping + fading**2 * mass
    faded = damping + 2.0 * fading * mass
    with log_levels({"pymor": "ERROR"}):
        full = SecondOrderModel.from_matrices(mass, faded, held, ports, ports.T)
        reductor: Any = SOBTfvReductor(full)
        reductor.reduce(settings.rank)
    return structural.reduced(model, [reductor.V.to_numpy()], settings, began)


def interpolated(
    model: DynamicModel, training: Training, settings: LinearVehicleSettings
) -> ReducedVehicle:
    """Interpolate; no training run is looked at.  `InputError` if pyMOR is missing."""
    with installed("pyMOR"):
        from pymor.reductors.h2 import IRKAReductor
    return linear_reduction(IRKAReductor, model, settings, time.process_time())


def single_track(
    model: DynamicModel, training: Training, settings: OnlineSettings
) -> ReducedVehicle:
    """Linearise and condense; no training run is looked at.

    Lateral speed V and yaw rate r at constant speed U, with C_i, l_i effective cornering stiffness
    and place of the axles:

        m V' = -m U r + sum_i F_i,   J r' = sum_i l_i F_i,   F_i = C_i (steer_i - (V + l_i r) / U)

    The numbers come from the model itself: it is linearised at straight running (speed U0), and all
    other lateral states are eliminated as if they were at rest (A_kk - A_kf A_ff^-1 A_fk, static
    condensation).  So the stiffnesses are effective ones: pneumatic trail, roll steer, camber and,
    for a prescribed rack, the wheels' angle per rack are in them; steady cornering is that of the
    linearised model.  Masses and stiffnesses need not be told apart: the 2x2 matrix of the car is

        A(U) = U [[0, -1], [0, 0]] + U0 / U A1

    so A1 follows from the matrix at U0, and the car holds at the speed of its start, which stays
    constant.  Velocity and acceleration of the rack are left out.  Heave and pitch have no place in
    a single-track car.
    """
    began = time.process_time()
    shape = VehicleShape(model)
    linear, modes, inputs = shape.linearised, slow_modes(shape, np.inf), len(model.inputs)
    # States of the shape that are nearest to V and r; the others follow them and the steering.
    kept = np.argmax(np.abs(linear.motion_a[[2, 0]]), axis=1)
    rest = np.setdiff1d(np.arange(len(linear.a)), kept)
    drive = np.column_stack([linear.a[np.ix_(rest, kept)], linear.b[rest, 0]])
    follow = np.zeros((len(linear.a), 3))
    # The speed's zero eigenvalue makes the matrix singular: the least-squares solution cuts it.
    follow[rest] = -np.linalg.lstsq(linear.a[np.ix_(rest, rest)], drive, rcond=1e-10)[0]
    follow[kept, [0, 1]] = 1.0
    condensed = linear.a[kept] @ follow
    condensed[:, 2] += linear.b[kept, 0]
    # What comes from the tires goes as one over the speed.
    tire = condensed[:, :2] - np.array([[0.0, -shape.speed], [0.0, 0.0]])
    # States V, r and the deviation of the speed.
    listing = FeatureListing(3, inputs)
    (v, r, slower), u, p = listing.z, listing.u[0], listing.p(0)
    part, speed = listing.let(p / (p + slower)), p + slower
    terms = ((v,), (r,), (u,), (part, v), (part, r), (speed, r), (speed,), (slower,))
    groups = (((0, 1, 2, 3, 4, 5), (0, 1, 3, 5)), ((6, 7), (4,)))
    features = listing.features(terms, groups)
    c = np.zeros((len(terms), 3 + PLANAR))
    c[[3, 4], :2], c[2, :2], c[5, 0] = tire.T, condensed[:, 2], -1.0
    c[1, 3], c[6, 4], c[0, 5] = 1.0, 1.0, 1.0
    decoding = np.zeros((len(terms), len(shape.reference)))
    decoding[:3], decoding[7] = follow.T, modes.speed_right
    turn = CORNERING / shape.speed
    return ReducedVehicle(
        model,
        shape,
        features,
        np.array([shape.speed]),
        c,
        decoding,
        np.vstack([np.eye(len(linear.a))[kept], modes.speed_left]),
        np.zeros((3, inputs)),
        np.array([MARGIN * SIDEWARD, MARGIN * turn, SPEED, HEADING, PLACE, PLACE]),
        linearisation_cost(shape, began),
        settings.solver,
        settings.tolerance,
    )


MODAL_TRUNCATION = Method(
    name="modal_truncation",
    summary="slow modes of the linearised model: lateral ones of a car, all of a structure",
    reference="10.1109/TAC.1966.1098264",
    settings={
        **dict.fromkeys(("ode", "dae"), ModalTruncationSettings),
        "structural": StructuralModesSettings,
    },
    refusal=no_linear_model,
    fit=by_modes,
    learns_from="inputs",
)
BALANCED_TRUNCATION = Method(
    name="balanced_truncation",
    summary="what the inputs move and the outputs see most, of a linearised model, by pyMOR",
    reference="10.1109/9.544000",
    settings={
        **dict.fromkeys(("ode", "dae"), LinearVehicleSettings),
        "structural": BalancedTruncationSettings,
    },
    refusal=no_linear_model,
    fit=balanced,
    check=check_balanced,
    learns_from="inputs",
    packages=("pymor",),
)
IRKA = Method(
    name="irka",
    summary="lateral dynamics that interpolate the linearised ones best (IRKA), by pyMOR",
    reference="10.1137/060666123",
    settings=dict.fromkeys(("ode", "dae"), LinearVehicleSettings),
    refusal=no_steered_vehicle,
    fit=interpolated,
    learns_from="inputs",
    packages=("pymor",),
)
LINEAR_SINGLE_TRACK = Method(
    name="linear_single_track",
    summary="linear single-track car with the model's own effective stiffnesses",
    reference="10.1007/BF02086921",
    settings=dict.fromkeys(("ode", "dae"), OnlineSettings),
    refusal=no_steered_vehicle,
    fit=single_track,
    learns_from="inputs",
)
