"""Balanced truncation by pyMOR, without training: of a vehicle, of a structure at its ports.

A vehicle is linearised at straight running: B. C. Moore, IEEE Trans. Autom. Control 26 (1981),
17-32.  A structure is balanced with free velocities: D. G. Meyer, S. Srinivasan, Balancing and
model reduction for second-order form linear systems, IEEE Trans. Autom. Control 41 (1996),
1632-1644.

A structure is linearised at its static state.  Inputs are the forces of the ports, outputs their
deflections; strains, many among a model's outputs, would crowd out the motion.  The projection is
Galerkin's, in pyMOR's right basis alone: matrices stay symmetric.  Gramians need damping, and what
soft springs hold has hardly any.  So they are those of q exp(-t / FADING), which weighs late
motion less; nothing of this is in the reduced structure.
"""

import time
from typing import Any

import numpy as np
from pydantic import Field

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.interface import Method, installed
from vehiclemor.reduction.projection.structural import (
    MASSLESS,
    ReducedStructure,
    StructuralSettings,
    port_rates,
    reduced,
)
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.linear_vehicle import (
    LinearVehicleSettings,
    linear_reduction,
    no_linear_model,
)
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle

# Time in s in which motion counts less by a factor e.
FADING = 2.0
# Most coordinates n: from 2 n = 1000 on pyMOR iterates, which did not converge on the truck.
LARGEST = 499


class BalancedTruncationSettings(StructuralSettings):
    """Settings for a structure."""

    rank: int = Field(45, ge=1, description="basis vectors")


def check(model: Any, settings: Any) -> None:
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


def fit(model: Any, training: Training, settings: Any) -> ReducedVehicle | ReducedStructure:
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
    return reduced(model, [reductor.V.to_numpy()], settings, began)


METHOD = Method(
    name="balanced_truncation",
    summary="what the inputs move and the outputs see most, of a linearised model, by pyMOR",
    reference="10.1109/9.544000",
    settings={
        **dict.fromkeys(("ode", "dae"), LinearVehicleSettings),
        "structural": BalancedTruncationSettings,
    },
    refusal=no_linear_model,
    fit=fit,
    check=check,
    learns_from="nothing",
    packages=("pymor",),
)
