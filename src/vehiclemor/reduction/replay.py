"""Replay: returns its training trajectory and computes nothing.

The null hypothesis of every comparison: a reduced model that is no better than replay on inputs
that it was not trained on has learned nothing about the model.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vehiclemor.maneuvers import Maneuver
from vehiclemor.reduction.interface import Offline
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start, Trajectory

SUMMARY = "returns the training trajectory, whatever the input: the null hypothesis"
REFERENCE = ""
PRESETS: dict[str, dict[str, Value]] = {"recommended": {}}


@dataclass(frozen=True)
class ReplayModel:
    """Stored training trajectories."""

    model: Model
    recorded: tuple[Trajectory, ...]
    offline: Offline

    @property
    def effective_rank(self) -> int:
        """No coordinates are solved for."""
        return 0

    def simulate(self, maneuver: Maneuver, start: Start) -> Trajectory:
        """The training trajectory whose input is nearest (root mean square) to the maneuver's."""
        self.model.start(start)
        inputs = maneuver.at(maneuver.times)
        nearest = min(self.recorded, key=lambda run: float(np.sum((run.inputs - inputs) ** 2)))
        return replace(
            nearest,
            time=maneuver.times,
            inputs=inputs,
            outputs=self.model.outputs_at(nearest.states, inputs),
            counts=dict.fromkeys(self.model.counts, 0),
            seconds=0.0,
        )

    def best_approximation(self, states: np.ndarray) -> None:
        """There is no subspace to project onto."""
        del states


def settings(kind: str) -> dict[str, Setting]:
    """There are no settings."""
    del kind
    return {}


def presets(model: Model) -> dict[str, dict[str, Value]]:
    """Presets; the same for every model."""
    del model
    return PRESETS


def accepts(model: Model) -> tuple[bool, str]:
    """Every model is accepted."""
    del model
    return True, ""


def check(model: Model, settings: Mapping[str, Value]) -> None:
    """There are no settings."""
    del model, settings


def fit(
    model: Model, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> ReplayModel:
    """Record the training runs at the output times."""
    del settings
    began = time.perf_counter()
    recorded = tuple(run.at(run.maneuver.times) for run in training)
    evaluations = sum(run.counts[model.evaluations] for run in recorded)
    return ReplayModel(model, recorded, Offline(time.perf_counter() - began, evaluations))
