"""Replay: returns its training trajectory and computes nothing.

The null hypothesis of every comparison: a reduced model that is no better than replay on inputs
that it was not trained on has learned nothing about the model.
"""

import time
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vehiclemor.arguments import require
from vehiclemor.inputs.checks import completed
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.multibody.definition import KINDS, STATE_KINDS
from vehiclemor.reduction.interface import Method, OfflineCost, offline_cost
from vehiclemor.reduction.settings import Settings
from vehiclemor.reduction.training import Training
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start, Trajectory


@dataclass(frozen=True)
class ReplayModel(ShortRepr):
    """Stored training trajectories, each with the conditions (runs, k) that it began with."""

    model: Model
    recorded: tuple[Trajectory, ...]
    conditions: np.ndarray
    offline: OfflineCost

    def check_sizes(self) -> None:
        """Raise `ValueError` if a run is none of this model."""
        for name in ("inputs", *STATE_KINDS, "outputs"):
            columns = len(getattr(self.model, name))
            require(all(getattr(r, name).shape[1] == columns for r in self.recorded), name)
        conditions = len(_conditions(self.model, self.model.starts[0]))
        require(self.conditions.shape == (len(self.recorded), conditions), "conditions")

    @property
    def order(self) -> int:
        """No coordinates are solved for."""
        return 0

    @cached_property
    def _ranges(self) -> np.ndarray:
        """Range of each input and condition over all training runs; infinite where it is zero."""
        inputs = np.vstack([run.inputs for run in self.recorded])
        ranges = np.append(np.ptp(inputs, axis=0), np.ptp(self.conditions, axis=0))
        return np.where(ranges > 0.0, ranges, np.inf)

    def for_model(self, model: Model) -> "ReplayModel":
        """The same runs, asked for with the online parameters of another model."""
        return replace(self, model=model)

    def simulate(self, maneuver: Excitation, start: Start) -> Trajectory:
        """The nearest training run: each of them is given back exactly.

        The distance adds squares: of the RMS difference of each input, and of the difference of
        each condition.  Each is divided by the range of its quantity over the training runs, so
        units do not matter, and what is the same in all of them does not count.

        Runs with the maneuver's output times come first.  If there are none, inputs are compared
        over the time that a run and the maneuver share, and the run is read at the maneuver's
        times: between samples linearly, after its end its last value.
        """
        times, conditions = maneuver.times, _conditions(self.model, start)
        inputs = completed(maneuver, self.model.definition).at(times)
        numbers = range(len(self.recorded))
        alike = [k for k in numbers if np.array_equal(self.recorded[k].times, times)]

        def distance(number: int) -> float:
            run = self.recorded[number]
            shared = times <= run.times[-1]
            difference = _resampled(run.times, run.inputs, times[shared]) - inputs[shared]
            of_inputs = np.sqrt(np.mean(difference**2, axis=0))
            differences = np.append(of_inputs, self.conditions[number] - conditions)
            return float(np.linalg.norm(differences / self._ranges))

        nearest = self.recorded[min(alike or numbers, key=distance)]
        paths = {
            name: _resampled(nearest.times, getattr(nearest, name), times)
            for name in (*STATE_KINDS, "outputs")
        }
        # Of a structure there are no coordinates to make outputs of.
        if self.model.kind != "structural":
            states = np.hstack([paths[kind] for kind in STATE_KINDS])
            paths["outputs"] = self.model.outputs_at(states, inputs)
        return replace(
            nearest,
            times=times,
            inputs=inputs,
            model=self.model,
            **paths,
            counts=dict.fromkeys(self.model.counts, 0),
            seconds=0.0,
        )

    def best_approximation(self, states: np.ndarray) -> None:
        """There is no subspace to project onto."""


def _conditions(model: Model, start: Start) -> np.ndarray:
    """State at the start, speeds among it, and online parameters (k,)."""
    values = model.parameters.values()
    online = [np.ravel(values[name]) for name in model.definition.online]
    return np.concatenate([model.start(start), *online])


def _resampled(before: np.ndarray, values: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Columns of `values` (samples, k) at other times, the last value after the end."""
    columns = [np.interp(times, before, column) for column in values.T]
    return np.array(columns).reshape(len(columns), len(times)).T


def fit(model: Model, training: Training, settings: Settings) -> ReplayModel:
    """Record the training runs at the output times."""
    began = time.process_time()
    recorded = tuple(replace(run.recorded(), model=model) for run in training)
    conditions = np.array([_conditions(run.model, run.start) for run in training])
    return ReplayModel(model, recorded, conditions, offline_cost(began, model, recorded))


METHOD = Method(
    name="replay",
    summary="returns the training trajectory, whatever the input: the null hypothesis",
    settings=dict.fromkeys(KINDS, Settings),
    fit=fit,
    own_limits=True,
)
