"""Reductions of a linearised model without training: slow modes, balanced truncation, IRKA.

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
"""

import time
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from pydantic import Field

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.interface import Method, installed
from vehiclemor.reduction.projection import structural
from vehiclemor.reduction.projection.structural import (
    ReducedStructure,
    StructuralSettings,
    free_modes,
    port_rates,
)
from vehiclemor.reduction.settings import OnlineSettings
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.features import FeatureListing
from vehiclemor.reduction.vehicle.linear_modes import (
    APART,
    SlowModes,
    apart,
    real_modes,
    slow_modes,
    without_derivatives,
)
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.shape import (
    CORNERING,
    HEADING,
    MARGIN,
    PLACE,
    SPEED,
    VehicleShape,
    linearisation_cost,
    no_steered_vehicle,
)
from vehiclemor.simulation.dynamic import DynamicModel

# Modes that steering moves by less than this part of the most moved one are symmetric.
MOVED = 1e-8
# Time in s in which motion counts less by a factor e.
FADING = 2.0
# Most coordinates n: from 2 n = 1000 on pyMOR iterates, which did not converge on the truck.
LARGEST = 499


def lateral_modes(shape: VehicleShape) -> tuple[SlowModes, np.ndarray]:
    """All modes that steering moves, and what of the shape (n, inputs) follows inputs at once."""
    linear = shape.linearised
    follow, drive = without_derivatives(linear.a, linear.b)
    values, vectors = np.linalg.eig(linear.a.T)
    w = vectors.T
    v = np.linalg.inv(w)
    motion = apart(values) & (np.abs(values) > APART)
    moved = np.abs(w @ drive) * np.linalg.norm(v, axis=0) / np.maximum(np.abs(values), APART)
    moved[~motion] = 0.0
    left, right = real_modes(values, w, v, moved > MOVED * moved.max())
    modes = replace(
        slow_modes(shape, np.inf),
        lateral=len(left),
        rates=left @ linear.a @ right,
        left=left,
        right=right,
        input_matrix=left @ drive,
        input_shift=np.vstack([left @ follow, np.zeros(follow.shape[1])]),
    )
    return modes, follow


def within(modes: SlowModes, test: np.ndarray, trial: np.ndarray) -> SlowModes:
    """The modes in fewer coordinates: test (r, k) times the old ones, which are trial times new."""
    return replace(
        modes,
        lateral=len(test),
        rates=test @ modes.rates @ trial,
        left=test @ modes.left,
        right=modes.right @ trial,
        input_matrix=test @ modes.input_matrix,
        input_shift=np.vstack([test @ modes.input_shift[:-1], modes.input_shift[-1:]]),
    )


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
