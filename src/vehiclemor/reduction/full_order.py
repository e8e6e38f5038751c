"""The full-order model itself: the baseline of every comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from vehiclemor.maneuvers import Maneuver
from vehiclemor.reduction.interface import Offline
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.simulation.algebraic import SOLVERS, AlgebraicModel
from vehiclemor.simulation.trajectory import Trajectory

SUMMARY = "no reduction: the full-order model, the baseline"
REFERENCE = ""
SETTINGS = {
    "solver": Setting(
        "text",
        "newton",
        "newton: fresh Jacobians; newton_dense: without the generated elimination; chord: constant "
        "inverse and predictor",
        choices=SOLVERS,
    ),
    "tolerance": Setting(
        "number", 1e-12, "largest step of the last iteration", minimum=0.0, above=True
    ),
}
# The paper's kind of baseline is Newton's method; the strongest solver found stands beside it.
PRESETS: dict[str, dict[str, Value]] = {
    "recommended": {},
    "strongest": {"solver": "chord", "tolerance": 1e-6},
}


@dataclass(frozen=True)
class FullOrderModel:
    """The full-order model behind the interface of a reduced model."""

    model: AlgebraicModel
    solver: str
    tolerance: float
    offline: Offline = field(default_factory=Offline)

    @property
    def effective_rank(self) -> int:
        """Number of coordinates."""
        return len(self.model.coordinates)

    def simulate(self, maneuver: Maneuver, start: str) -> Trajectory:
        """Full-order trajectory at the maneuver's output times."""
        self.model.start(start)
        return self.model.simulate(maneuver, solver=self.solver, tolerance=self.tolerance)

    def best_approximation(self, coordinates: np.ndarray) -> np.ndarray:
        """The coordinates themselves: the full space holds them."""
        return coordinates


def presets(model: str) -> dict[str, dict[str, Value]]:
    """Presets; the same for every model."""
    del model
    return PRESETS


def accepts(model: AlgebraicModel) -> tuple[bool, str]:
    """Every model is accepted."""
    del model
    return True, ""


def check(model: AlgebraicModel, settings: Mapping[str, Value]) -> None:
    """All validated settings fit every model."""
    del model, settings


def fit(
    model: AlgebraicModel, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> FullOrderModel:
    """Nothing is fitted, and no training run is looked at."""
    del training
    return FullOrderModel(model, str(settings["solver"]), float(settings["tolerance"]))
