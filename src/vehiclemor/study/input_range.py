"""The range of the inputs that a method has been trained on, as its least claim to knowledge."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from vehiclemor.maneuver import Maneuver
from vehiclemor.reduction.car_checks import doubted
from vehiclemor.reduction.cars import Cars, cars_of
from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.trust import trust_of
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Trust
from vehiclemor.study.scenario import Scenario, car_of, own_speed

# Least part of the speed by which a run may start faster or slower.
SPEED_SLACK = 0.01


@dataclass(frozen=True)
class InputRange:
    """Inputs and speeds of the training runs.

    Attributes
    ----------
    largest
        Absolute values of the inputs (inputs,), and of a dynamic model of their rates beside them.
    speed, reach
        Middle of the initial speeds in m/s, and how far they lie from it.
    longest
        Duration of the longest run in s; a kinematic model has no memory, and any is known.
    cars
        Those of the training runs; nothing is told of them where None.
    """

    largest: np.ndarray
    speed: float
    reach: float
    longest: float
    cars: Cars | None = None

    def outside(self, method: Method, car: Model, reduced: Any) -> Trust | None:
        """What is told of a car beyond those of the training, or that its reduced model doubts.

        A method that is exact for every car has none that lie beyond.
        """
        told = self.cars.trust(car) if self.cars and method.learns_from != "inputs" else None
        return told if told and told.reason else doubted(reduced)

    def trust(self, model: Model, scenario: Scenario) -> Trust:
        """How far a scenario goes in the range."""
        values = _values(model, scenario.maneuver)
        # An input that was zero in training may be nothing else.
        used = values / np.maximum(self.largest, 1e-12)
        times = scenario.maneuver.times
        off = np.full(len(values), (_speed(model, scenario) - self.speed) / self.reach)
        names = [f"input {name}" for name in model.inputs]
        if model.kind != "ae":
            names += [f"rate of {name}" for name in names]
        used = np.column_stack([used, off, times / self.longest])
        return trust_of(times, used, [*names, "initial speed", "duration"])

    def trust_of_inputs(self, names: Sequence[str], inputs: np.ndarray) -> Trust:
        """How far inputs (samples, inputs) go in the range; their rates are not looked at."""
        used = inputs / np.maximum(self.largest[: inputs.shape[1]], 1e-12)
        return trust_of(np.zeros(len(inputs)), used, [f"input {name}" for name in names])


@lru_cache(maxsize=64)
def input_range(model: Model, training: tuple[Scenario, ...]) -> InputRange:
    """Range of some training scenarios."""
    largest = [np.abs(_values(model, scenario.maneuver)).max(axis=0) for scenario in training]
    speeds = [_speed(model, scenario) for scenario in training]
    low, high = min(speeds), max(speeds)
    middle = 0.5 * (low + high)
    # One part in a million is rounding.
    reach = max(0.5 * (high - low), SPEED_SLACK * middle) or 1.0
    lasting = model.kind != "ae"
    longest = max(scenario.maneuver.duration for scenario in training) if lasting else np.inf
    edge = 1.0 + 1e-6
    cars = cars_of(car_of(model, scenario) for scenario in training)
    return InputRange(np.max(largest, axis=0) * edge, middle, reach * edge, longest * edge, cars)


def _values(model: Model, maneuver: Maneuver) -> np.ndarray:
    """Inputs, and of a dynamic model their rates, at the output times."""
    times = maneuver.times
    values = maneuver.for_inputs(model.inputs).at(times)
    if model.kind == "ae":
        return values
    rates = np.gradient(values, times, axis=0) if len(times) > 1 else np.zeros_like(values)
    return np.hstack([values, rates])


def _speed(model: Model, scenario: Scenario) -> float:
    """Initial speed in m/s; zero of a model that has none."""
    return scenario.speed or own_speed(car_of(model, scenario)) or 0.0
