"""Craig-Bampton: static shapes of unit deflections of the ports, and modes with the ports held.

R. R. Craig, M. C. C. Bampton, Coupling of substructures for dynamic analyses, AIAA J. 6 (1968),
1313-1319.  The boundary is the deflections of springs, dampers and tires: what these do is in the
basis, whatever the force.  Nothing is trained.
"""

import time

import numpy as np
from pydantic import Field

from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.projection.modes import fixed_modes
from vehiclemor.reduction.projection.structural import (
    ReducedStructure,
    StructuralSettings,
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
    """Static shapes and modes; no training run is looked at.  `InputError` if no mode is kept."""
    began = time.process_time()
    basis = np.hstack(fixed_modes(model, settings.highest))
    return reduced(model, [basis], settings, began)


METHOD = Method(
    name="craig_bampton",
    summary="static shapes of the ports and modes with the ports held",
    reference="10.2514/3.4741",
    settings={"structural": CraigBamptonSettings},
    fit=fit,
    learns_from="inputs",
)
