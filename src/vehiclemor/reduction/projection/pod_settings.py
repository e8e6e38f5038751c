"""Settings that all methods on POD subspaces share, by kind of model."""

from typing import Annotated, Literal

from pydantic import Field

from vehiclemor.reduction.settings import (
    AT_MOST_COORDINATES,
    ProjectedSettings,
    Settings,
    StepTolerance,
    Tolerance,
)

Rank = Annotated[
    int,
    Field(
        ge=1,
        description="number of basis vectors in each window; by default no more than coordinates",
    ),
    AT_MOST_COORDINATES,
]
Snapshots = Annotated[int, Field(ge=2, description="snapshots in each window and training run")]
RankTolerance = Annotated[
    float,
    Field(
        ge=0.0,
        lt=1.0,
        description="modes with a singular value below it times the first are dropped; 0 keeps all",
    ),
]
Formulation = Literal["coordinates", "state", "paired"]
InnerProduct = Literal["euclidean", "energy", "range"]


class AlgebraicPodSettings(Settings):
    """POD subspaces of algebraic equations.

    Least squares, the default, does not depend on the order and signs in which the equations are
    written (Galerkin does, by orders of magnitude), and the rank cut keeps directions out that
    rounding chooses.
    """

    rank: Rank = 3
    snapshots: Snapshots = 10
    rank_tolerance: RankTolerance = 1e-10
    test_space: Literal["least_squares", "galerkin"] = Field(
        "least_squares",
        description="least_squares: Gauss-Newton on the residual; galerkin: U^T Phi = 0 "
        "(paper, step 6)",
    )
    equation_seed: int = Field(
        0,
        ge=0,
        description="galerkin: seed of a random order and signs of the equations; 0: natural",
    )
    reversed_coordinates: str = Field(
        "", description="galerkin: coordinates counted the other way round, separated by commas"
    )
    tolerance: StepTolerance = 1e-12
    rounding_seed: int = Field(
        0, ge=0, description="seed of a relative noise of 2^-52 on the snapshots; 0: none"
    )


class DynamicPodSettings(ProjectedSettings):
    """POD subspaces of equations of motion.

    The defaults are chosen by measurement, on the nominal runs that are then compared with the
    paper: they keep the published errors from both starts, as states weighed by energy do too, and
    the projected equations keep the model's energy.
    """

    rank: Rank = 3
    snapshots: Snapshots = 10
    rank_tolerance: RankTolerance = 1e-6
    formulation: Formulation = Field(
        "coordinates",
        description="coordinates: V^T M V qh'' = V^T F; state: all states in one basis (the "
        "paper's words); paired: first order, the coordinates' basis for speeds too",
    )
    inner_product: InnerProduct = Field(
        "energy",
        description="of the snapshots: euclidean, energy (mass matrix), range (each state by its "
        "range)",
    )
    tolerance: Tolerance = 1e-6


class ConstrainedPodSettings(DynamicPodSettings):
    """POD subspaces of equations of motion with constraints: the paper's rank and snapshots.

    One mode of the states holds position and speed together, so that one coordinate can follow a
    maneuver; weighed by energy it keeps the published errors from both starts, and no rank makes
    the reduced equations unstable.
    """

    rank: Rank = 1
    snapshots: Snapshots = 5
    formulation: Formulation = Field("state", description="as for a model without constraints")


DYNAMIC_LITERAL = {"formulation": "state", "inner_product": "euclidean", "rank_tolerance": 0.0}
# `literal` takes the paper's words literally.
PRESETS = {
    "ae": {"literal": {"test_space": "galerkin", "rank_tolerance": 0.0}},
    "ode": {"literal": DYNAMIC_LITERAL},
    "dae": {"literal": DYNAMIC_LITERAL},
}
