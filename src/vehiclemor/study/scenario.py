"""Scenarios: what a reduced model is trained, chosen or tested on."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.reduction.training import TrainingRun, policy_factors
from vehiclemor.signals import Signal
from vehiclemor.simulation.build import build
from vehiclemor.simulation.maneuver_checks import check_resolved, checked_maneuver
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start

# Parameter with the speed (m/s) at which a vehicle starts.
SPEED = "initial_speed"


@dataclass(frozen=True)
class Scenario:
    """One run of a model: an input, a start, a speed.

    Attributes
    ----------
    maneuver
        The input, with its factors.
    start
        Name of an initial condition, or a state as numbers.
    speed
        Initial speed in m/s; None is that of the model's parameters, if it has any.
    """

    maneuver: Maneuver
    start: str | tuple[float, ...]
    speed: float | None = None

    @property
    def label(self) -> str:
        """One readable line, unique within a protocol."""
        run = self.maneuver
        factors = [f"f {run.frequency_factor:g}", f"a {run.amplitude_factor:g}"]
        words = [run.name, *factors, self.start if isinstance(self.start, str) else "own state"]
        if self.speed is not None:
            words.append(f"{self.speed:g} m/s")
        return ", ".join(words)

    @property
    def content(self) -> dict[str, Any]:
        """Everything that determines the run of a given model, for a hash."""
        return {
            "maneuver": self.maneuver.name,
            "frequency": self.maneuver.frequency_factor,
            "amplitude": self.maneuver.amplitude_factor,
            "start": self.start,
            "speed": self.speed,
            "inputs": input_hash(self.maneuver),
            "corners": [float(time) for time in self.maneuver.break_points],
        }

    @property
    def run_key(self) -> tuple[str, str | tuple[float, ...], float | None]:
        """Equal for scenarios that are one run of the model, whatever their names."""
        return input_hash(self.maneuver), self.start, self.speed


@lru_cache(maxsize=1024)
def input_hash(maneuver: Maneuver) -> str:
    """Hash of the output times and the inputs at these times; of a signal all there is of it."""
    times = maneuver.times
    if isinstance(maneuver, Signal):
        parts = [part.tobytes() for part in (times, *maneuver.polynomials)]
        names = json.dumps(maneuver.inputs).encode()
        return hashlib.sha256(b"".join([names, *parts])).hexdigest()[:16]
    # Adding zero makes -0 and 0 one input.
    inputs = np.ascontiguousarray(maneuver.at(times)) + 0.0
    return hashlib.sha256(times.tobytes() + inputs.tobytes()).hexdigest()[:16]


def own_speed(model: Model) -> float | None:
    """Initial speed (m/s) of a model's parameter set, if it has one."""
    entry = model.parameters.entries.get(SPEED)
    return None if entry is None else float(np.asarray(entry.value))


@lru_cache(maxsize=16)
def parameters_of(model: Model) -> dict[str, Any]:
    """Name -> value of a model's parameters, SI units."""
    return {name: entry.value for name, entry in model.parameters.entries.items()}


def start_of(model: Model, scenario: Scenario) -> Start:
    """What the model starts from: a name, or at another speed than its own the state (n,)."""
    if scenario.speed is None or scenario.speed == own_speed(model):
        return scenario.start
    parameters = json.dumps(parameters_of(model) | {SPEED: scenario.speed}, sort_keys=True)
    return _state_at(model.name, parameters, scenario.start)


# More than the runs of a protocol, over which all rows go.
@lru_cache(maxsize=4096)
def _state_at(model: str, parameters: str, start: str) -> np.ndarray:
    return build(model, overrides=json.loads(parameters)).start(start)


def training_run(model: Model, scenario: Scenario) -> TrainingRun:
    """The scenario as a run that a method may learn from."""
    return TrainingRun(model, scenario.maneuver, start_of(model, scenario))


def training_scenarios(
    test: Scenario, policy: str, factors: Sequence[tuple[float, float]] = ()
) -> tuple[Scenario, ...]:
    """What a training policy trains on before a test scenario, see `policy_factors`.

    Raises
    ------
    InputError
        If the policy is unknown or the factors don't fit it.
    """
    pairs = policy_factors(test.maneuver, policy, factors)
    if factors and policy != "set":
        raise InputError("training_set is for the training policy 'set' alone")
    return tuple(replace(test, maneuver=test.maneuver.perturbed(*pair)) for pair in pairs)


def check(model: Model, scenario: Scenario) -> None:
    """Raise `InputError` if the model can't be run in the scenario."""
    checked_maneuver(scenario.maneuver, model.definition)
    check_resolved(scenario.maneuver)
    if scenario.speed is not None and own_speed(model) is None:
        raise InputError(f"{model.name} has no {SPEED}: a scenario of it has no speed")
    model.start(start_of(model, scenario))
