"""What a model's derivation returns: named quantities and the program of its equations."""

from dataclasses import dataclass

from vehiclemor.models.quantities import Quantity
from vehiclemor.symbolic.program import Program


@dataclass(frozen=True)
class AlgebraicEquations:
    """Residual equations Phi(q; u) = 0 of a kinematic model (kind `ae`).

    Attributes
    ----------
    coordinates, inputs, outputs
        Quantities in the order of the model's specification.
    equations
        Names of the residual equations with their units.
    joints
        Names of the moving points and directions that the function `joints` returns.
    program
        Functions over the arguments `q` (n) and `u`: `residual` (n), `residual_jacobian`
        (n x (n + 1): Jacobian, then residual), `newton_step` (n), `outputs`, and `joints`
        (points x 3).
    """

    coordinates: tuple[Quantity, ...]
    inputs: tuple[Quantity, ...]
    outputs: tuple[Quantity, ...]
    equations: tuple[Quantity, ...]
    joints: tuple[str, ...]
    program: Program


@dataclass(frozen=True)
class DynamicEquations:
    """First-order equations dx/dt = f(x, u) of a vehicle, x = (coordinates, speeds).

    Constrained models (kind `dae`) have this form once their constraints are stabilised.

    Attributes
    ----------
    coordinates, speeds, inputs, outputs
        Quantities in the order of the model's specification.
    program
        Functions over the arguments `x` (2 n) and `u`: `derivative` (2 n) and `outputs`; for
        mechanical models also `second_order` (n x (n + 1): mass matrix M and forces F of
        M q'' = F in the coordinates, forces of constraints included), and `speeds` (n: the speeds
        where x holds the rates of the coordinates in their place).  Constrained models have
        `descriptor` ((n + c) x (n + 1): mass matrix and applied forces, less inertial ones, below
        them Jacobian and right side of the c stabilised constraints on q'') and `violations`
        (c x 2: constraints and their rates).
    constraints
        The c constraints of a model of kind `dae`.
    """

    coordinates: tuple[Quantity, ...]
    speeds: tuple[Quantity, ...]
    inputs: tuple[Quantity, ...]
    outputs: tuple[Quantity, ...]
    program: Program
    constraints: tuple[Quantity, ...] = ()
