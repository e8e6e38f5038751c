"""Craig-Bampton: static shapes of unit deflections of the ports, and modes with the ports held.

R. R. Craig, M. C. C. Bampton, Coupling of substructures for dynamic analyses, AIAA J. 6 (1968),
1313-1319.  The boundary is the deflections of springs, dampers and tires: what these do is in the
basis, whatever the force.  Nothing is trained.
"""

import time
from typing import Any

import numpy as np
from pydantic import Field

from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.projection.structural import (
    ReducedStructure,
    StructuralSettings,
    modes_below,
    reduced,
)
from vehiclemor.reduction.training import Training
from vehiclemor.simulation.structures.model import StructuralModel


class CraigBamptonSettings(StructuralSettings):
    """Settings for a structure."""

    highest: float = Field(
        200.0, gt=0.0, le=1e5, description="modes of up to so many Hz are kept, ports held"
    )


def fit(
    model: StructuralModel, training: Training, settings: CraigBamptonSettings
) -> ReducedStructure:
    """Static shapes (n, p) and modes (n, k); no training run is looked at.

    `InputError` if no mode is slow.
    """
    from scipy.sparse import block_array
    from scipy.sparse.linalg import splu

    began = time.process_time()
    structure: Any = model.system.structure
    n, p = structure.ports.shape
    # In a matrix of like sizes pivots stay where the factors are sparse.
    size = float(np.abs(structure.stiffness.diagonal()).mean())
    held = block_array(
        [[structure.stiffness, size * structure.ports], [size * structure.ports.T, None]]
    )
    factor = splu(held.tocsc())
    units = np.vstack([np.zeros((n, p)), size * np.eye(p)])
    shapes = factor.solve(units)[:n]

    def solve(b: np.ndarray) -> np.ndarray:
        return factor.solve(np.concatenate([b, np.zeros(p)]))[:n]

    modes = modes_below(structure.stiffness, structure.mass, solve, 0.0, settings.highest)
    return reduced(model, np.hstack([shapes, modes]), settings, began)


METHOD = Method(
    name="craig_bampton",
    summary="static shapes of the ports and modes with the ports held",
    reference="10.2514/3.4741",
    settings={"structural": CraigBamptonSettings},
    fit=fit,
    learns_from="nothing",
    band="highest",
)
