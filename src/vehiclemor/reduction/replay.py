"""Replay: returns its training trajectory and computes nothing.

The null hypothesis of every comparison: a reduced model that is no better than replay on inputs
that it was not trained on has learned nothing about the model.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vehiclemor.maneuvers import Maneuver
from vehiclemor.reduction.interface import Offline
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.trajectory import COUNTS, Trajectory

SUMMARY = "returns the training trajectory, whatever the input: the null hypothesis"
REFERENCE = ""
SETTINGS: dict[str, Setting] = {}
PRESETS: dict[str, dict[str, Value]] = {"recommended": {}}


@dataclass(frozen=True)
class ReplayModel:
    """Stored training trajectories."""

    model: AlgebraicModel
    recorded: tuple[Trajectory, ...]
    offline: Offline

    @property
    def effective_rank(self) -> int:
        """No coordinates are solved for."""
        return 0

    def simulate(self, maneuver: Maneuver, start: str) -> Trajectory:
        """The training trajectory whose input is nearest (root mean square) to the maneuver's."""
        self.model.start(start)
        inputs = maneuver.at(maneuver.times)
        nearest = min(self.recorded, key=lambda run: float(np.sum((run.inputs - inputs) ** 2)))
        counts = np.zeros(len(COUNTS), dtype=np.int64)
        return self.model.trajectory(maneuver.times, inputs, nearest.coordinates, counts, 0.0)

    def best_approximation(self, coordinates: np.ndarray) -> None:
        """There is no subspace to project onto."""
        del coordinates


def presets(model: str) -> dict[str, dict[str, Value]]:
    """Presets; the same for every model."""
    del model
    return PRESETS


def accepts(model: AlgebraicModel) -> tuple[bool, str]:
    """Every model is accepted."""
    del model
    return True, ""


def check(model: AlgebraicModel, settings: Mapping[str, Value]) -> None:
    """There are no settings."""
    del model, settings


def fit(
    model: AlgebraicModel, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> ReplayModel:
    """Record the training runs at the output times."""
    del settings
    began = time.perf_counter()
    recorded = tuple(run.at(run.maneuver.times) for run in training)
    evaluations = sum(run.counts["residual_evaluations"] for run in recorded)
    return ReplayModel(model, recorded, Offline(time.perf_counter() - began, evaluations))
