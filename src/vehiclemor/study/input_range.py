"""The range of the inputs that a method has been trained on, as its least claim to knowledge."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.reduction.trust import (
    EDGE,
    NOTHING,
    inputs_beyond,
    largest_inputs,
    trust_in,
    trust_of,
)
from vehiclemor.simulation.input_polynomials import extent_of
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Trust
from vehiclemor.sizes import shaped
from vehiclemor.study.scenario import Scenario, model_of_run, own_speed

# Least part of the speed by which a run may start faster or slower.
SPEED_SLACK = 0.01
# Part of the largest input by which one may differ from that of a training run at the same time,
# where the model follows the times of its training.
CLOSE = 0.01


@dataclass(frozen=True)
class InputRange:
    """Inputs and speeds of the training runs.

    `largest` are magnitudes of the inputs (1, inputs) of a kinematic model, at output times; of a
    dynamic one sizes of whole signals (3, inputs), see `Extent`.  `speed` is the middle of the
    initial speeds in m/s, `reach` how far they lie from it, `longest` the duration of the longest
    run in s (a kinematic model has no memory).  Where a model follows the times of its training,
    `histories` are its inputs (runs, samples, inputs) at equidistant times of the first.
    """

    largest: np.ndarray
    speed: float
    reach: float
    longest: float
    histories: np.ndarray | None = None

    def check_sizes(self) -> None:
        """Raise `ValueError` if the magnitudes are no table of floats."""
        shaped("largest", (self.largest, len(self.largest), *self.largest.shape[1:2]))

    @property
    def _sizes(self) -> np.ndarray:
        # In a file that was written by hand they may be zero.
        return np.maximum(self.largest, NOTHING)

    def trust(self, model: Model, scenario: Scenario) -> Trust:
        """How far a scenario goes in the range."""
        maneuver = scenario.maneuver.for_inputs(model.inputs)
        if model.kind == "ae":
            return self.trust_of_inputs(model.inputs, maneuver.at(maneuver.times), maneuver.times)
        used = extent_of(maneuver).largest / self._sizes
        since = np.full(len(model.inputs), np.inf)
        if (used > 1.0).any():
            since = inputs_beyond(maneuver, self.largest)
        ranges = {}
        for name, (further, *quicker), time in zip(model.inputs, used.T, since, strict=True):
            what = f"input {name}" + " above 2 Hz" * bool(further <= 1.0 < max(quicker))
            ranges[what] = float(max(further, *quicker)), float(time)
        off = abs(_speed(model, scenario) - self.speed) / self.reach
        ranges["initial speed"] = off, 0.0 if off > 1.0 else np.inf
        lasts = maneuver.duration / self.longest
        ranges["duration"] = lasts, self.longest if lasts > 1.0 else np.inf
        if self.histories is not None:
            ranges["difference from the inputs of training runs"] = self._unlike(maneuver)
        return trust_in(ranges)

    def _unlike(self, maneuver: Maneuver) -> tuple[float, float]:
        """How far inputs are from those of the nearest training run, and since when (s)."""
        assert self.histories is not None
        times = maneuver.times[maneuver.times <= self.longest]
        known = np.linspace(0.0, self.longest / EDGE, self.histories.shape[1])
        inputs, off = maneuver.at(times), []
        for history in self.histories:
            then = [np.interp(times, known, column) for column in history.T]
            off.append(np.abs((inputs - np.transpose(then)) / self._sizes[0]).max(axis=1) / CLOSE)
        nearest = min(off, key=np.max)
        beyond = np.flatnonzero(nearest > 1.0)
        return float(nearest.max()), float(times[beyond[0]]) if len(beyond) else np.inf

    def trust_of_inputs(
        self, names: Sequence[str], inputs: np.ndarray, times: np.ndarray | None = None
    ) -> Trust:
        """How far inputs (samples, inputs) go in the range, each for itself."""
        times = np.zeros(len(inputs)) if times is None else times
        return trust_of(times, inputs / self._sizes[0], [f"input {name}" for name in names])


@lru_cache(maxsize=64)
def input_range(
    model: Model, training: tuple[Scenario, ...], follows_time: bool = False
) -> InputRange:
    """Range of some training scenarios, for a method that follows their times or doesn't."""
    maneuvers = [scenario.maneuver.for_inputs(model.inputs) for scenario in training]
    speeds = [_speed(model, scenario) for scenario in training]
    low, high = min(speeds), max(speeds)
    middle = 0.5 * (low + high)
    reach = max(0.5 * (high - low), SPEED_SLACK * middle) or 1.0
    if model.kind == "ae":
        values = [np.abs(m.at(m.times)).max(axis=0) for m in maneuvers]
        largest = EDGE * np.maximum(np.max(values, axis=0), NOTHING)[None]
        return InputRange(largest, middle, reach * EDGE, np.inf)
    longest = max(maneuver.duration for maneuver in maneuvers)
    histories = None
    if follows_time:
        times = np.linspace(0.0, longest, maneuvers[0].samples)
        histories = np.array([maneuver.at(times) for maneuver in maneuvers])
    largest = largest_inputs(maneuvers)
    return InputRange(largest, middle, reach * EDGE, longest * EDGE, histories)


def _speed(model: Model, scenario: Scenario) -> float:
    """Initial speed in m/s; zero of a model that has none."""
    return scenario.speed or own_speed(model_of_run(model, scenario)) or 0.0
