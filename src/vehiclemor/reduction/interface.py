"""The interface that every reduction method implements.

A method is a module (or any object) with the attributes of `Method`; its entry point in the group
`vehiclemor.methods` gives it a name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vehiclemor.maneuvers import Maneuver
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start, Trajectory


@dataclass(frozen=True)
class Offline:
    """Cost of making a reduced model, compilation not included.

    Attributes
    ----------
    seconds
        Training simulations and fit.
    evaluations
        Evaluations of the full model's equations in training simulations.
    """

    seconds: float = 0.0
    evaluations: int = 0


class ReducedModel(Protocol):
    """What `fit` returns."""

    @property
    def offline(self) -> Offline:
        """Cost of making it."""
        ...

    @property
    def effective_rank(self) -> int:
        """Largest number of reduced coordinates in any window; n for a full-order model."""
        ...

    def simulate(self, maneuver: Maneuver, start: Start) -> Trajectory:
        """Trajectory at the maneuver's output times."""
        ...

    def best_approximation(self, states: np.ndarray) -> np.ndarray | None:
        """Projection of full-order states (samples, n) onto the same subspaces, if any."""
        ...


class Method(Protocol):
    """A reduction method."""

    SUMMARY: str
    REFERENCE: str

    def settings(self, kind: str) -> Mapping[str, Setting]:
        """Settings for models of that kind; none for a kind that it doesn't accept."""
        ...

    def accepts(self, model: Model) -> tuple[bool, str]:
        """Whether the method can reduce the model, and why not."""
        ...

    def presets(self, model: Model) -> Mapping[str, Mapping[str, Value]]:
        """Preset name -> settings that differ from the declared defaults."""
        ...

    def check(self, model: Model, settings: Mapping[str, Value]) -> None:
        """Raise `InputError` if the settings don't fit the model."""
        ...

    def fit(
        self,
        model: Model,
        training: Sequence[TrainingRun],
        settings: Mapping[str, Value],
    ) -> ReducedModel:
        """Make a reduced model from training runs."""
        ...
