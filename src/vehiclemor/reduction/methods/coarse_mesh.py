"""The same structure on a coarse mesh, at full order: the null model of structures.

A cheaper model of a structure is had by larger elements, too.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from pydantic import Field

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.interface import Method, OfflineCost
from vehiclemor.reduction.projection.structural import StructuralRuns, StructuralSettings
from vehiclemor.reduction.settings import inline_table
from vehiclemor.reduction.training import Training
from vehiclemor.simulation.build import reparametrised
from vehiclemor.simulation.structures.model import StructuralModel


class CoarseMeshSettings(StructuralSettings):
    """Settings for a structure."""

    mesh: str = Field(
        "elements_per_bay = 1, shell_size = 0", description="parameters of the mesh, as in TOML"
    )


@dataclass(frozen=True, eq=False)
class CoarseMesh(StructuralRuns):
    """The full model on another mesh in the place of a reduced one."""

    model: StructuralModel
    mesh: str
    tolerance: float
    step_size: float
    offline: OfflineCost

    def check_sizes(self) -> None:
        """There are none."""

    @property
    def order(self) -> int:
        """Number of coordinates of the mesh."""
        return self.meshed.size

    @cached_property
    def meshed(self) -> Any:
        """The model on the mesh."""
        return reparametrised(self.model, mesh_parameters(self.mesh))

    @property
    def solved(self) -> tuple[StructuralModel, None]:
        """The model on the mesh, in its own coordinates."""
        return self.meshed, None

    def best_approximation(self, states: np.ndarray) -> np.ndarray | None:
        """The states themselves where no other mesh is given; else there are none."""
        return None if self.mesh else states


def mesh_parameters(mesh: str) -> dict[str, float]:
    """Parameters of a mesh by name; `InputError` if the text is none."""
    return inline_table(mesh, "coarse_mesh: mesh")


def check(model: StructuralModel, settings: CoarseMeshSettings) -> None:
    """Raise `InputError` if the mesh is none."""
    given = mesh_parameters(settings.mesh)
    for name in given:
        if name in model.definition.online:
            raise InputError(f"coarse_mesh: {name} is no parameter of a mesh")
    reparametrised(model, given)


def fit(model: StructuralModel, training: Training, settings: CoarseMeshSettings) -> CoarseMesh:
    """Nothing is fitted, and no training run is looked at."""
    return CoarseMesh(model, settings.mesh, settings.tolerance, settings.step_size, OfflineCost())


METHOD = Method(
    name="coarse_mesh",
    summary="no reduction: larger elements, the null model of structures",
    settings={"structural": CoarseMeshSettings},
    fit=fit,
    check=check,
    learns_from="nothing",
    own_limits=True,
)
