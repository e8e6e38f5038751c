"""The full-order model itself: the baseline of every comparison."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from pydantic import Field

from vehiclemor.errors import ConvergenceError
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.reduction.interface import Method, Offline, Presets
from vehiclemor.reduction.reduced_system import KinematicStates, ReducedSystem, StateSpace
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
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.projection_windows import whole_space
from vehiclemor.simulation.trajectory import Start, Trajectory


class AlgebraicSettings(Settings):
    """How algebraic equations are solved."""

    solver: Literal["newton", "newton_lanes"] = Field(
        "newton",
        description="newton: fresh Jacobians; newton_lanes: with predictor, eight samples at once",
    )
    tolerance: StepTolerance = NEWTON_TOLERANCE


class DynamicSettings(OnlineSettings):
    """How equations of motion are integrated."""

    solver: AnyIntegrator = Field(
        "dopri5",
        description="dopri5: Dormand-Prince 5(4); rodas4: Rosenbrock of order 4, fresh "
        "Jacobians; ros34pw2: W-method of order 3, one Jacobian for all runs; with the same "
        "etdrk4: exponential method of order 4; exponential_adams: of order 6, for high accuracy",
    )
    tolerance: Tolerance = 1e-6


def _strongest(solver: str, tolerance: float) -> Presets:
    return {"strongest": {"solver": solver, "tolerance": tolerance}}


@dataclass(frozen=True)
class FullOrderModel(ShortRepr):
    """The full-order model behind the interface of a reduced model."""

    model: Model
    solver: str
    tolerance: float
    offline: Offline = field(default_factory=Offline)

    def check_sizes(self) -> None:
        """There are none."""

    @property
    def effective_rank(self) -> int:
        """Number of coordinates."""
        return len(self.model.coordinates)

    def simulate(
        self, maneuver: Maneuver, start: Start, outputs: tuple[str, ...] | None = None
    ) -> Trajectory:
        """Full-order trajectory at the output times; it may have diverged."""
        how = {"solver": self.solver, "tolerance": self.tolerance, "outputs": outputs}
        try:
            return self.model.simulate(maneuver, start, **how)
        except ConvergenceError as error:
            if error.trajectory is None:
                raise
            return error.trajectory

    @cached_property
    def state_space(self) -> StateSpace:
        """The model's own states."""
        model = self.model
        if isinstance(model, AlgebraicModel):
            how = self.solver, self.tolerance
            return KinematicStates(
                model,
                lambda time, u, _: model.solve_path(np.array([time]), u, *how),
                model.jacobian,
            )
        assert isinstance(model, DynamicModel)
        n, whole = len(model.coordinates), whole_space(2 * len(model.coordinates))
        how = self.solver, self.tolerance
        return ReducedSystem(model, model.system, whole, n, self.offline, *how)

    def best_approximation(self, states: np.ndarray) -> np.ndarray:
        """The states themselves: the full space holds them."""
        return states


def fit(
    model: Model, training: Training, settings: AlgebraicSettings | DynamicSettings
) -> FullOrderModel:
    """Nothing is fitted, and no training run is looked at."""
    return FullOrderModel(model, settings.solver, settings.tolerance)


METHOD = Method(
    name="full_order",
    summary="no reduction: the full-order model, the baseline",
    settings={"ae": AlgebraicSettings, "ode": DynamicSettings, "dae": DynamicSettings},
    # The defaults are the paper's kind of baseline; the strongest solver found stands beside them.
    presets={
        "ae": _strongest("newton_lanes", 1e-4),
        "ode": _strongest("ros34pw2", 2e-3),
        "dae": _strongest("ros34pw2", 7e-4),
    },
    fit=fit,
    learns_from="inputs",
    own_limits=True,
)
