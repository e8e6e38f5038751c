"""Replay: returns its training trajectory and computes nothing.

The null hypothesis of every comparison: a reduced model that is no better than replay on inputs
that it was not trained on has learned nothing about the model.
"""

import time
from dataclasses import dataclass, replace

import numpy as np

from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.multibody.definition import KINDS
from vehiclemor.reduction.interface import Method, OfflineCost, offline_cost
from vehiclemor.reduction.settings import Settings
from vehiclemor.reduction.training import Training
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start, Trajectory
from vehiclemor.sizes import require


@dataclass(frozen=True)
class ReplayModel(ShortRepr):
    """Stored training trajectories."""

    model: Model
    recorded: tuple[Trajectory, ...]
    offline: OfflineCost

    def check_sizes(self) -> None:
        """Raise `ValueError` if a run is none of this model."""
        for name in ("inputs", "coordinates", "speeds", "outputs"):
            columns = len(getattr(self.model, name))
            require(all(getattr(r, name).shape[1] == columns for r in self.recorded), name)

    @property
    def order(self) -> int:
        """No coordinates are solved for."""
        return 0

    def simulate(self, maneuver: Maneuver, start: Start) -> Trajectory:
        """The training trajectory whose input is nearest (root mean square) to the maneuver's.

        Runs of the maneuver's own output times come first.  If there are none, inputs are compared
        over the time that a run and the maneuver share, and the run is read at the maneuver's
        times: between samples linearly, after its end its last value.
        """
        self.model.start(start)
        times = maneuver.times
        inputs = maneuver.at(times)
        alike = [run for run in self.recorded if np.array_equal(run.times, times)]
        nearest = min(alike or self.recorded, key=lambda run: _distance(run, times, inputs))
        paths = nearest.coordinates, nearest.speeds, nearest.outputs
        q, v, outputs = (_resampled(nearest.times, path, times) for path in paths)
        # Of a structure there are no coordinates to make outputs of.
        if self.model.kind != "structural":
            outputs = self.model.outputs_at(np.hstack((q, v)), inputs)
        return replace(
            nearest,
            times=times,
            inputs=inputs,
            coordinates=q,
            speeds=v,
            outputs=outputs,
            counts=dict.fromkeys(self.model.counts, 0),
            seconds=0.0,
        )

    def best_approximation(self, states: np.ndarray) -> None:
        """There is no subspace to project onto."""
        del states


def _distance(run: Trajectory, times: np.ndarray, inputs: np.ndarray) -> float:
    """Mean square of the difference of the inputs over the time that both cover."""
    shared = times <= run.times[-1]
    difference = _resampled(run.times, run.inputs, times[shared]) - inputs[shared]
    return float(np.mean(difference**2))


def _resampled(before: np.ndarray, values: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Columns of `values` (samples, k) at other times, the last value after the end."""
    columns = [np.interp(times, before, column) for column in values.T]
    return np.array(columns).reshape(len(columns), len(times)).T


def fit(model: Model, training: Training, settings: Settings) -> ReplayModel:
    """Record the training runs at the output times."""
    began, recorded = time.process_time(), tuple(run.recorded() for run in training)
    return ReplayModel(model, recorded, offline_cost(began, model, recorded))


METHOD = Method(
    name="replay",
    summary="returns the training trajectory, whatever the input: the null hypothesis",
    settings=dict.fromkeys(KINDS, Settings),
    fit=fit,
    own_limits=True,
)
