"""Balanced truncation of structures at their ports, by pyMOR.

Balanced with free velocities: D. G. Meyer, S. Srinivasan, Balancing and model reduction for
second-order form linear systems, IEEE Trans. Autom. Control 41 (1996), 1632-1644.

A structure is linearised at its static state.  Inputs are the forces of the ports, outputs their
deflections; strains, many among a model's outputs, would crowd out the motion.  The projection is
Galerkin's, in pyMOR's right basis alone: matrices stay symmetric.  Gramians need damping, and
motion in soft springs has hardly any.  So they are those of q exp(-t / FADING), which weighs late
motion less; nothing of this is in the reduced structure.
"""

import time
from typing import Any

import numpy as np
from pydantic import Field

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.interface import installed
from vehiclemor.reduction.projection.structural import (
    MASSLESS,
    ReducedStructure,
    StructuralSettings,
    port_rates,
    reduced,
)
from vehiclemor.simulation.structures.model import StructuralModel

# Time in s in which motion counts less by a factor e.
FADING = 2.0
# Most coordinates n: from 2 n = 1000 on pyMOR iterates, which did not converge on the truck.
LARGEST = 499


class BalancedStructureSettings(StructuralSettings):
    """Settings for a structure."""

    rank: int = Field(45, ge=1, description="basis vectors")


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


def balanced_structure(
    model: StructuralModel, settings: BalancedStructureSettings
) -> ReducedStructure:
    """The structure in its balanced basis; `InputError` if pyMOR is missing."""
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
