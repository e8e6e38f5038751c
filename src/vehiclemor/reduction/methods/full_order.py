"""The full-order model itself: the baseline of every comparison."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from pydantic import Field

from vehiclemor.exceptions import ConvergenceError
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.reduction.interface import Method, OfflineCost
from vehiclemor.reduction.projection.structural import StructuralSettings
from vehiclemor.reduction.reduced_system import ReducedMechanism, ReducedSystem
from vehiclemor.reduction.settings import (
    AnyIntegrator,
    OnlineSettings,
    Settings,
    StepTolerance,
    Tolerance,
)
from vehiclemor.reduction.training import Training
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.algebraic import NEWTON_TOLERANCE, AlgebraicModel
from vehiclemor.simulation.control_periods import ControlPeriods, whole_space
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.evaluation import By
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.structures.model import SOLVER, USUAL, StructuralModel
from vehiclemor.simulation.system import System
from vehiclemor.simulation.trajectory import Start, Trajectory


class AlgebraicSettings(Settings):
    """How algebraic equations are solved."""

    integration = ("solver", "tolerance")
    solver: Literal["newton", "newton_lanes"] = Field(
        "newton",
        description="newton: fresh Jacobians; newton_lanes: with predictor, eight samples at once",
    )
    tolerance: StepTolerance = NEWTON_TOLERANCE


class DynamicSettings(OnlineSettings):
    """How equations of motion are integrated."""

    solver: AnyIntegrator = "dopri5"
    tolerance: Tolerance = 1e-8


class FullStructureSettings(StructuralSettings):
    """How structures are integrated."""

    integration = ("solver", "tolerance")
    solver: Literal["generalised_alpha"] = Field(
        SOLVER, description="of order 2, one step size a run, damped at infinity"
    )


# The paper's kind of baseline, a general-purpose integrator of variable step; and for wheels that
# lock or spin, where a frozen Jacobian errs.
OF_MOTION = {
    "paper": {"solver": "dopri5", "tolerance": 1e-6},
    "locking": {"solver": "rodas4", "tolerance": 1e-3},
}


@dataclass(frozen=True, eq=False)
class FullOrder(ShortRepr):
    """The full-order model as if it were a reduced one."""

    model: Model
    solver: str
    tolerance: float
    offline: OfflineCost = field(default_factory=OfflineCost)

    def check_sizes(self) -> None:
        """There are none."""

    @property
    def order(self) -> int:
        """Number of coordinates."""
        return len(self.model.coordinates)

    def simulate(
        self, maneuver: Excitation, start: Start, outputs: tuple[str, ...] | None = None
    ) -> Trajectory:
        """Full-order trajectory at the output times; it may have diverged."""
        how = {"solver": self.solver, "tolerance": self.tolerance, "outputs": outputs}
        try:
            return self.model.simulate(maneuver, start, **how)
        except ConvergenceError as error:
            if error.trajectory is None:
                raise
            return error.trajectory

    def best_approximation(self, states: np.ndarray) -> np.ndarray | None:
        """The states themselves: the full space holds them."""
        return states


@dataclass(frozen=True, eq=False)
class FullOrderSystem(FullOrder, ReducedSystem):
    """A dynamic model."""

    model: DynamicModel

    @property
    def system(self) -> System:
        """The equations of the model."""
        return self.model.system

    @cached_property
    def spaces(self) -> ControlPeriods:
        """All of the state space."""
        return whole_space(len(self.model.definition.states))


@dataclass(frozen=True, eq=False)
class FullOrderMechanism(FullOrder, ReducedMechanism):
    """A kinematic model."""

    model: AlgebraicModel

    def solved(self, time: float, inputs: np.ndarray, state: np.ndarray) -> Trajectory:
        """Solution at one time, on the branch of the design position."""
        del state
        return self.model.solve_path(np.array([time]), inputs, self.solver, self.tolerance)

    def slopes(self, state: np.ndarray, inputs: np.ndarray, by: By, of: str) -> np.ndarray:
        """Those of the model."""
        return self.model.jacobian(state, inputs, by, of)


@dataclass(frozen=True, eq=False)
class FullOrderStructure(FullOrder):
    """A structural model; it can't be stepped."""

    model: StructuralModel
    step_size: float = 0.0  # In s, instead of the tolerance; 0: by that.

    @property
    def order(self) -> int:
        """Number of coordinates."""
        return self.model.size

    def for_model(self, model: StructuralModel) -> "FullOrderStructure":
        """The same for a model whose online parameters are others."""
        return replace(self, model=model)

    def simulate(
        self, maneuver: Excitation, start: Start, outputs: tuple[str, ...] | None = None
    ) -> Trajectory:
        """A run at the maneuver's output times; it may have diverged."""
        self.model.start(start)
        return self.model.run(maneuver, None, self.tolerance, outputs, step=self.step_size)


def fit(model: Any, training: Training, settings: Any) -> FullOrder:
    """Nothing is fitted, and no training run is looked at."""
    solver = settings.solver, settings.tolerance
    if model.kind == "structural":
        return FullOrderStructure(model, *solver, step_size=settings.step_size)
    kind = FullOrderMechanism if model.kind == "ae" else FullOrderSystem
    return kind(model, *solver)


METHOD = Method(
    name="full_order",
    summary="no reduction: the full-order model, the baseline",
    settings={"ae": AlgebraicSettings, "ode": DynamicSettings, "dae": DynamicSettings}
    | {"structural": FullStructureSettings},
    # Strongest: the fastest candidate of the model's protocol that keeps all of its bounds on all
    # validation runs; of `ode` on those of the 14-DOF, of `dae` on those of the high-fidelity car.
    presets={
        "ae": {"strongest": {"solver": "newton_lanes", "tolerance": 1e-4}},
        "ode": {"strongest": {"solver": "etdrk4", "tolerance": 1e-2}, **OF_MOTION},
        "dae": {"strongest": {"solver": "etdrk4", "tolerance": 2e-3}, **OF_MOTION},
        "structural": {
            "strongest": {"solver": SOLVER, "tolerance": 1e-2},
            "paper": {"tolerance": USUAL},
        },
    },
    fit=fit,
    learns_from="nothing",
    own_limits=True,
)
