"""Scenarios: what a reduced model is trained, chosen or tested on."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.maneuvers import Maneuver
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start

# Parameter with the speed (m/s) at which a vehicle starts.
SPEED = "initial_speed"


@dataclass(frozen=True)
class Scenario:
    """One run of a model: an input, a start, a speed.

    Attributes
    ----------
    frequency, amplitude
        Factors on the maneuver.
    start
        Name of an initial condition.
    speed
        Initial speed in m/s; none for a model that has no speeds.
    """

    maneuver: str
    frequency: float
    amplitude: float
    start: str
    speed: float | None = None

    @property
    def label(self) -> str:
        """One readable line, unique within a protocol."""
        words = [self.maneuver, f"f {self.frequency:g}", f"a {self.amplitude:g}", self.start]
        if self.speed is not None:
            words.append(f"{self.speed:g} m/s")
        return ", ".join(words)


def own_speed(model: Model) -> float | None:
    """Initial speed (m/s) of a model's parameter set, if it has one."""
    entry = model.parameters.entries.get(SPEED)
    return None if entry is None else float(np.asarray(entry.value))


def maneuver_of(scenario: Scenario) -> Maneuver:
    """The perturbed maneuver."""
    base: Maneuver = component("maneuver", scenario.maneuver)
    return base.perturbed(scenario.frequency, scenario.amplitude)


def start_of(model: Model, scenario: Scenario) -> Start:
    """What the model starts from: a name, or at another speed than its own the state (n,)."""
    if scenario.speed is None or scenario.speed == own_speed(model):
        return scenario.start
    return _state_at(model.name, scenario.speed, scenario.start)


@lru_cache(maxsize=256)
def _state_at(model: str, speed: float, start: str) -> np.ndarray:
    return build(model, overrides={SPEED: speed}).start(start)


def training_run(model: Model, scenario: Scenario) -> TrainingRun:
    """The scenario as a run that a method may learn from."""
    return TrainingRun(model, maneuver_of(scenario), start_of(model, scenario))


def check(model: Model, scenario: Scenario) -> None:
    """Raise `InputError` if the model can't be run in the scenario."""
    maneuver = maneuver_of(scenario)
    if maneuver.inputs != model.inputs:
        raise InputError(
            f"maneuver {maneuver.name} gives inputs {', '.join(maneuver.inputs)}; "
            f"{model.name} needs {', '.join(model.inputs)}"
        )
    if scenario.speed is not None and own_speed(model) is None:
        raise InputError(f"{model.name} has no {SPEED}: a scenario of it has no speed")
    model.start(start_of(model, scenario))


def input_hash(maneuver: Maneuver) -> str:
    """Hash of the output times and the inputs at these times."""
    times = maneuver.times
    # Adding zero makes -0 and 0 one input.
    inputs = np.ascontiguousarray(maneuver.at(times)) + 0.0
    return hashlib.sha256(times.tobytes() + inputs.tobytes()).hexdigest()[:16]


def identity(scenario: Scenario) -> dict[str, Any]:
    """Everything that determines a scenario of a given model, for a hash."""
    maneuver = maneuver_of(scenario)
    corners = [float(time) for time in maneuver.break_points]
    return {**vars(scenario), "inputs": input_hash(maneuver), "corners": corners}


def same_run(scenario: Scenario) -> tuple[str, str, float | None]:
    """Equal for scenarios that are one run of the model, whatever their names."""
    return input_hash(maneuver_of(scenario)), scenario.start, scenario.speed
