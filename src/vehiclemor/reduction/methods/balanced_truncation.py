"""Balanced truncation of structures, by pyMOR: what the ports can move and feel most.

Free-velocity balanced truncation: D. G. Meyer, S. Srinivasan, Balancing and model reduction for
second-order form linear systems, IEEE Trans. Autom. Control 41 (1996), 1632-1644.

The structure is linearised at its static state.  Inputs are the forces of the ports, outputs their
deflections; strains, many among a model's outputs, would crowd out the motion.  The projection is
Galerkin's, in pyMOR's right basis alone: matrices stay symmetric.  Gramians need damping, and what
soft springs hold has hardly any.  So they are those of q exp(-t / FADING), which weighs late
motion less; nothing of this is in the reduced structure.  Nothing is trained.
"""

import time
from typing import Any

import numpy as np
from pydantic import Field

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.projection import structural
from vehiclemor.reduction.projection.modes import port_rates
from vehiclemor.reduction.projection.structural import ReducedStructure, StructuralSettings
from vehiclemor.reduction.training import Training
from vehiclemor.simulation.structures.model import StructuralModel

# Time in s in which motion counts less by a factor e.
FADING = 2.0
# Most coordinates n: from 2 n = 1000 on pyMOR iterates, which did not converge on the truck.
LARGEST = 499


class BalancedTruncationSettings(StructuralSettings):
    """Settings for a structure."""

    rank: int = Field(45, ge=1, description="basis vectors")


def check(model: StructuralModel, settings: BalancedTruncationSettings) -> None:
    """Raise `InputError` if a structure is too large or too small, or its mass is singular."""
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


def fit(model: StructuralModel, training: Training, settings: Any) -> ReducedStructure:
    """Balance and truncate; no training run is looked at.  `InputError` if pyMOR is missing."""
    try:
        from pymor.core.logger import log_levels
        from pymor.models.iosys import SecondOrderModel
        from pymor.reductors.sobt import SOBTfvReductor
    except ImportError as error:
        raise InputError(
            'balanced_truncation needs pyMOR; install it by: pip install "vehiclemor[contenders]"'
        ) from error
    began = time.process_time()
    s, n, fading = model.system.structure, model.size, 1.0 / FADING
    mass, elastic, ports, beside = (m.toarray() for m in (s.mass, s.stiffness, s.ports, s.dampers))
    stiffness, rates = port_rates(model)
    damping = s.damping_time * elastic + beside @ beside.T + (ports * rates) @ ports.T
    held = s.held(stiffness).toarray() + fading * damping + fading**2 * mass
    faded = damping + 2.0 * fading * mass
    with log_levels({"pymor": "ERROR"}):
        full = SecondOrderModel.from_matrices(mass, faded, held, ports, ports.T)
        reductor: Any = SOBTfvReductor(full)
        reductor.reduce(settings.rank)
    vectors = reductor.V.to_numpy()
    # They are rows in pyMOR 2024.
    basis = vectors if len(vectors) == n else vectors.T
    return structural.reduced(model, [basis], settings, began)


METHOD = Method(
    name="balanced_truncation",
    summary="motions that the ports move and feel most, by pyMOR",
    reference="10.1109/9.544000",
    settings={"structural": BalancedTruncationSettings},
    fit=fit,
    check=check,
    learns_from="inputs",
    packages=("pymor",),
)
