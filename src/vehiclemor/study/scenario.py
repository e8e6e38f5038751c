"""Scenarios: what a reduced model is trained, chosen or tested on."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from vehiclemor.exceptions import InputError
from vehiclemor.inputs.checks import check_resolved, checked_maneuver, completed
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.inputs.signal import Signal
from vehiclemor.reduction.training import SPEED, TrainingRun, own_speed
from vehiclemor.registry import component
from vehiclemor.simulation.build import reparametrised
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start

# Parameter name (of a component of a point such as `tie_rod_inner.z`) and value in SI units.
Overrides = tuple[tuple[str, float | tuple[float, ...]], ...]
# Difference of inputs, as part of the largest, that rounding explains: of a table with its samples.
ROUNDING = 1e-9
# Times at which inputs are first looked at.
FEW = 16


def overrides(table: Mapping[str, float | Sequence[float]]) -> Overrides:
    """Parameters of a model from a table of them, whose order does not matter."""
    return tuple((name, _plain(value)) for name, value in sorted(table.items()))


def _plain(value: Any) -> Any:
    """Numbers as floats and lists as tuples; what is neither is refused where it is used."""
    if isinstance(value, list | tuple):
        return tuple(map(_plain, value))
    return float(value) if isinstance(value, int) else value


@dataclass(frozen=True)
class Scenario:
    """One run of a model: an input with its factors, an initial condition, a speed, parameters.

    The initial condition is a name or a state as numbers; without a speed (m/s) it is that of the
    model's parameters, if it has any; `parameters` are what differs from the model's.
    """

    maneuver: Excitation
    start: str | tuple[float, ...]
    speed: float | None = None
    parameters: Overrides = ()

    @property
    def label(self) -> str:
        """One readable line, unique within a protocol."""
        run = self.maneuver
        factors = [f"f {run.frequency_factor:g}", f"a {run.amplitude_factor:g}"]
        parts = [run.name, *factors, self.start if isinstance(self.start, str) else "own state"]
        if self.speed is not None:
            parts.append(f"{self.speed:g} m/s")
        for name, value in self.parameters:
            numbers = value if isinstance(value, tuple) else (value,)
            parts.append(" ".join([name, *(f"{number:g}" for number in numbers)]))
        return ", ".join(parts)

    @property
    def content(self) -> dict[str, Any]:
        """Everything that determines the run of a given model, for a hash."""
        changed = {} if self.parameters == () else {"parameters": self.parameters}
        return changed | {
            "maneuver": self.maneuver.name,
            "frequency": self.maneuver.frequency_factor,
            "amplitude": self.maneuver.amplitude_factor,
            "start": self.start,
            "speed": self.speed,
            "inputs": input_hash(self.maneuver),
            "corners": [float(time) for time in self.maneuver.break_points],
        }

    @property
    def run_key(self) -> tuple[Any, ...]:
        """Equal for scenarios that are one run of the model, whatever their names."""
        return input_hash(self.maneuver), self.start, self.speed, self.parameters

    @classmethod
    def of(
        cls,
        maneuver: str,
        factors: Sequence[float],
        start: str,
        speed: float | None = None,
        parameters: Overrides = (),
    ) -> "Scenario":
        """The run of a registered maneuver with two factors: of frequency, of amplitude."""
        chosen: Excitation = component("maneuver", maneuver)
        return cls(chosen.perturbed(*factors), start, speed, parameters)

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"maneuver": _sent(self.maneuver)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state | {"maneuver": _received(state["maneuver"])})


# As many as the references that a process keeps.
@lru_cache(maxsize=1024)
def _sent(maneuver: Excitation) -> Excitation | tuple[str, float, float]:
    """What goes to another process: the name of a registered maneuver, and its factors.

    Its functions would be new ones each time: fits and references with it would not be reused.
    """
    sent = maneuver.name, maneuver.frequency_factor, maneuver.amplitude_factor
    with suppress(InputError):
        if _received(sent) == maneuver:
            return sent
    return maneuver


@lru_cache(maxsize=1024)
def _received(sent: Excitation | tuple[str, float, float]) -> Excitation:
    if isinstance(sent, Excitation):
        return sent
    name, *factors = sent
    return component("maneuver", name).perturbed(*factors)


# Of as many as are looked at by turns; settings vary over each of them.
@lru_cache(maxsize=4096)
def scenario_text(scenario: Scenario) -> str:
    """Canonical JSON text of a scenario's content."""
    return json.dumps(scenario.content, sort_keys=True)


@lru_cache(maxsize=1024)
def input_hash(maneuver: Excitation) -> str:
    """Hash of the output times and the inputs at these times; of a signal all there is of it."""
    times = maneuver.times
    if isinstance(maneuver, Signal):
        parts = [part.tobytes() for part in (times, *maneuver.pieces)]
        names = json.dumps(maneuver.inputs).encode()
        return hashlib.sha256(b"".join([names, *parts])).hexdigest()[:16]
    # Adding zero makes -0 and 0 one input.
    inputs = np.ascontiguousarray(maneuver.at(times)) + 0.0
    return hashlib.sha256(times.tobytes() + inputs.tobytes()).hexdigest()[:16]


class Values(dict[str, Any]):
    """Values by name that many experiments share: their canonical JSON text is written once."""

    @cached_property
    def text(self) -> str:
        """Canonical JSON text."""
        return json.dumps(self, sort_keys=True)


@lru_cache(maxsize=16)
def parameters_of(model: Model) -> Values:
    """Name -> value of a model's parameters, SI units."""
    return Values((name, entry.value) for name, entry in model.parameters.entries.items())


def model_of_run(model: Model, scenario: Scenario) -> Model:
    """The model with the parameters of a scenario, whose maneuver drives it."""
    driven = model.driven_by(scenario.maneuver)
    # What a run drives is no parameter of it.
    return with_parameters(driven, scenario.parameters).driven_as(driven)


def driven_by_all(model: Model, scenarios: Sequence[Scenario]) -> Model:
    """The model with all optional inputs that some scenarios drive."""
    for scenario in scenarios:
        model = model.driven_by(scenario.maneuver)
    return model


# More than the runs of a protocol, over which all rows go.
@lru_cache(maxsize=1024)
def with_parameters(model: Model, parameters: Overrides) -> Model:
    """The model with some of its parameters changed; cached, since many runs are of one sample."""
    return reparametrised(model, dict(parameters)) if parameters else model


def start_of(model: Model, scenario: Scenario) -> Start:
    """What a run starts from: a name, or at another speed than that of the model the state (n,)."""
    if scenario.speed is None or scenario.speed == own_speed(model_of_run(model, scenario)):
        return scenario.start
    return _state_at(model, (*scenario.parameters, (SPEED, scenario.speed)), scenario.start)


@lru_cache(maxsize=4096)
def _state_at(model: Model, parameters: Overrides, start: Start) -> np.ndarray:
    return reparametrised(model, dict(parameters)).start(start)


def speed_of(model: Model, scenario: Scenario) -> float:
    """Initial speed in m/s; zero of a model that has none."""
    return scenario.speed or own_speed(model_of_run(model, scenario)) or 0.0


def training_run(model: Model, scenario: Scenario) -> TrainingRun:
    """The scenario as a run that a method may learn from."""
    return TrainingRun(model_of_run(model, scenario), scenario.maneuver, start_of(model, scenario))


def in_training(model: Model, training: Sequence[Scenario], test: Scenario) -> bool:
    """Whether a run is among those of a training, or the beginning of one, whatever its name."""
    return any(run == test or _alike(model, run, test) for run in training)


def _alike(model: Model, run: Scenario, test: Scenario) -> bool:
    """Whether a run has the same model, start and inputs as another as long as that lasts."""
    last = test.maneuver.duration
    if run.maneuver.duration < last:
        return False
    known, tested = run.maneuver.times, test.maneuver.times
    # Most differ at a few times already.
    for times in (tested[:: max(len(tested) // FEW, 1)], tested, known[known <= last]):
        learnt, used = (completed(s.maneuver, model.definition).at(times) for s in (run, test))
        if np.abs(learnt - used).max() > ROUNDING * np.abs(used).max():
            return False
    one, other = model_of_run(model, run), model_of_run(model, test)
    begun, wanted = one.start(start_of(model, run)), other.start(start_of(model, test))
    return np.array_equal(one.constants, other.constants) and np.array_equal(begun, wanted)


def check(model: Model, scenario: Scenario) -> None:
    """Raise `InputError` if the model can't be run in the scenario."""
    checked_maneuver(scenario.maneuver, model.driven_by(scenario.maneuver).definition)
    check_resolved(scenario.maneuver)
    if scenario.speed is not None and own_speed(model) is None:
        raise InputError(f"{model.name} has no {SPEED}: a scenario of it has no speed")
    model_of_run(model, scenario).start(start_of(model, scenario))
