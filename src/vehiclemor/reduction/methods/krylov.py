"""Krylov vectors of structures: moments of the ports' response at one frequency are matched.

R. R. Craig, A. L. Hale, Block-Krylov component synthesis method for structural model reduction,
J. Guid. Control Dyn. 11 (1988), 562-570.  With X = (K + s^2 M)^-1 and a real s in rad/s the basis
spans X F, X M X F, (X M)^2 X F, ..., where F holds the ports and the linear dampers.  As what
springs, dampers and tires do is within F, the basis is the same whatever they do.  The damping d K
is left out.  X exists for any mesh, also where motions have no mass.  More frequencies with fewer
moments each gave larger errors.  Nothing is trained.
"""

import time

import numpy as np
from pydantic import Field

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.projection.structural import (
    ReducedStructure,
    StructuralSettings,
    reduced,
)
from vehiclemor.reduction.training import Training
from vehiclemor.simulation.structures.model import StructuralModel
from vehiclemor.simulation.structures.system import factored

# A vector of which no more than this part is new is left out.
NEW = 1e-8


class KrylovSettings(StructuralSettings):
    """Settings for a structure."""

    moments: int = Field(5, ge=1, le=100, description="blocks of vectors, one for each moment")
    frequency: float = Field(2.0, gt=0.0, le=1e5, description="s / (2 pi) in Hz")


def orthogonal(block: np.ndarray, basis: list[np.ndarray]) -> None:
    """Add to a basis what is new in a block (n, k), by the modified Gram-Schmidt method."""
    for column in block.T:
        size, vector = np.linalg.norm(column), column
        # Twice is enough.
        for _ in range(2):
            for other in basis:
                vector = vector - (other @ vector) * other
        if (left := np.linalg.norm(vector)) > NEW * size:
            basis.append(vector / left)


def krylov_vectors(model: StructuralModel, frequency: float, moments: int) -> np.ndarray:
    """Orthogonal vectors (n, k), fewer than the moments ask for where they depend on others."""
    from scipy.sparse import hstack

    structure = model.system.structure
    square = (2.0 * np.pi * frequency) ** 2
    solve = factored(structure.stiffness + square * structure.mass, "MMD_AT_PLUS_A").solve
    basis, block = list[np.ndarray](), hstack([structure.ports, structure.dampers]).toarray()
    for _ in range(moments):
        first = len(basis)
        orthogonal(solve(block), basis)
        if len(basis) == first:
            break
        block = structure.mass @ np.column_stack(basis[first:])
    return np.column_stack(basis)


def check(model: StructuralModel, settings: KrylovSettings) -> None:
    """Raise `InputError` if there are as many moments as coordinates."""
    if settings.moments >= model.size:
        most = model.size - 1
        raise InputError(f"moments is {settings.moments}; {model.name} allows at most {most}")


def fit(model: StructuralModel, training: Training, settings: KrylovSettings) -> ReducedStructure:
    """Krylov vectors; no training run is looked at."""
    began = time.process_time()
    basis = krylov_vectors(model, settings.frequency, settings.moments)
    return reduced(model, basis, settings, began)


METHOD = Method(
    name="krylov",
    summary="Krylov vectors: moments of the ports' response at a frequency",
    reference="10.2514/3.20353",
    settings={"structural": KrylovSettings},
    fit=fit,
    check=check,
    learns_from="nothing",
)
