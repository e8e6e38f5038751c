"""The full-order model itself: the baseline of every comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from vehiclemor.maneuvers import Maneuver
from vehiclemor.reduction.interface import Offline
from vehiclemor.reduction.online_settings import online_settings
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.simulation import algebraic
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start, Trajectory

SUMMARY = "no reduction: the full-order model, the baseline"
REFERENCE = ""
_DYNAMIC = online_settings(
    "explicit",
    1e-6,
    "explicit: Dormand-Prince 5(4); rodas4: Rosenbrock of order 4, fresh Jacobians; "
    "ros34pw2: W-method of order 3, one Jacobian for all runs; etdrk4: exponential method of "
    "order 4, with the same",
)
# Kind of model -> settings; a model of another kind is solved as it comes.
SETTINGS_BY_KIND: dict[str, dict[str, Setting]] = {
    "ae": {
        "solver": Setting(
            "text",
            "newton",
            "newton: fresh Jacobians; newton_dense: without the generated elimination; "
            "chord: constant inverse and predictor",
            choices=algebraic.SOLVERS,
        ),
        "tolerance": Setting(
            "number",
            algebraic.NEWTON_TOLERANCE,
            "largest step of the last iteration",
            minimum=0.0,
            above=True,
        ),
    },
    "ode": _DYNAMIC,
    "dae": _DYNAMIC,
}


def _strongest(tolerance: float) -> dict[str, dict[str, Value]]:
    return {"recommended": {}, "strongest": {"solver": "ros34pw2", "tolerance": tolerance}}


# Kind of model -> presets.  The paper's kind of baseline is Newton's method; the strongest solver
# found stands beside it.
PRESETS_BY_KIND: dict[str, dict[str, dict[str, Value]]] = {
    "ae": {"recommended": {}, "strongest": {"solver": "chord", "tolerance": 1e-6}},
    "ode": _strongest(2e-3),
    "dae": _strongest(7e-4),
}


@dataclass(frozen=True)
class FullOrderModel:
    """The full-order model behind the interface of a reduced model."""

    model: Model
    solver: str | None
    tolerance: float | None
    offline: Offline = field(default_factory=Offline)

    @property
    def effective_rank(self) -> int:
        """Number of coordinates."""
        return len(self.model.coordinates)

    def simulate(self, maneuver: Maneuver, start: Start) -> Trajectory:
        """Full-order trajectory at the maneuver's output times."""
        return self.model.simulate(maneuver, start, solver=self.solver, tolerance=self.tolerance)

    def best_approximation(self, states: np.ndarray) -> np.ndarray:
        """The states themselves: the full space holds them."""
        return states


def settings(kind: str) -> Mapping[str, Setting]:
    """Settings of the solver of models of that kind."""
    return SETTINGS_BY_KIND.get(kind, {})


def presets(model: Model) -> Mapping[str, Mapping[str, Value]]:
    """Presets of the solver of the model's kind."""
    return PRESETS_BY_KIND.get(model.kind, {"recommended": {}})


def accepts(model: Model) -> tuple[bool, str]:
    """Every model is accepted."""
    del model
    return True, ""


def check(model: Model, settings: Mapping[str, Value]) -> None:
    """All validated settings fit every model."""
    del model, settings


def fit(
    model: Model, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> FullOrderModel:
    """Nothing is fitted, and no training run is looked at."""
    del training
    solver, tolerance = settings.get("solver"), settings.get("tolerance")
    return FullOrderModel(
        model,
        None if solver is None else str(solver),
        None if tolerance is None else float(tolerance),
    )
