"""Training runs: full-order simulations that a method may learn from."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vehiclemor.exceptions import InputError
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.multibody.definition import STATE_KINDS
from vehiclemor.multibody.quantities import DROP, Quantity
from vehiclemor.registry import component
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start, Trajectory

HISTORIES = ("times", "inputs", "states", "outputs", "counts", *STATE_KINDS)
# Parameter with the speed (m/s) at which a vehicle starts.
SPEED = "initial_speed"
# An input that is no larger was zero in training.
NOTHING = 1e-11
# What is shown of training runs -> key of their contents.
COVERED = {
    "maneuvers": "maneuver",
    "starts": "start",
    "initial speed, m/s": "speed",
    "frequency factor": "frequency",
    "amplitude factor": "amplitude",
}
# Parameters that say how a run starts, not which model it is of.
OF_STARTS = (SPEED, *DROP)


@dataclass(frozen=True)
class TrainingRun(ShortRepr):
    """One maneuver of the full-order model, solved wherever a method asks.

    It has the `HISTORIES` of a trajectory at the maneuver's output times.
    """

    model: Model
    maneuver: Excitation
    start: Start

    def __getattr__(self, name: str) -> Any:
        if name not in HISTORIES:
            raise AttributeError(f"a training run has no {name}")
        return getattr(self._recorded, name)

    @cached_property
    def _recorded(self) -> Trajectory:
        return self.recorded()

    def at(self, times: np.ndarray) -> Trajectory:
        """Full-order trajectory, solved exactly at the given increasing times (samples,) in s."""
        run = self.model.simulate(self.maneuver, self.start, times)
        if run.status == "stopped":
            raise InputError(
                f"training on {self.maneuver}: {run.message}; methods learn from runs that go on "
                "until their end"
            )
        return run

    def recorded(self) -> Trajectory:
        """Full-order trajectory at the maneuver's output times."""
        return self.at(self.maneuver.times)


Training = Sequence[TrainingRun]


def training_summary(
    method: str,
    runs: Sequence[Mapping[str, Any]],
    largest: np.ndarray,
    inputs: Sequence[Quantity],
) -> dict[str, str]:
    """What the contents of training runs cover, and sizes of their inputs, see `InputRange`."""
    if not runs or component("method", method).learns_from == "nothing":
        return {"training runs": "none"}
    values: dict[str, list[Any]] = {}
    for run in runs:
        for name, key in COVERED.items():
            values.setdefault(name, []).append(run[key])
        for name, value in run.get("parameters", ()):
            values.setdefault(name, []).append(value)
    covered = {name: _span(seen) for name, seen in values.items() if seen[0] is not None}
    for quantity, size in zip(inputs, largest[0].tolist(), strict=True):
        text = f"up to {size if size > NOTHING else 0.0:.3g} {quantity.unit}"
        if quantity.unit == "rad":
            text += f" ({math.degrees(size):.3g} deg)"
        covered[f"input {quantity.name}"] = text
    return {"training runs": str(len(runs))} | covered


def _span(values: list[Any]) -> str:
    """Both ends of numbers; all of texts and tables, but of a family, `NAME:NUMBER`, how many."""
    if not all(isinstance(value, float) for value in values):
        texts = {str(value): isinstance(value, str) and ":" in value for value in values}
        families = Counter(text.rpartition(":")[0] for text, member in texts.items() if member)
        parts = [text for text, member in texts.items() if not member]
        return ", ".join(sorted(parts) + [f"{n} of {name}" for name, n in families.items()])
    low, high = min(values), max(values)
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def own_speed(model: Model) -> float | None:
    """Initial speed (m/s) of a model's parameter set, if it has one."""
    entry = model.parameters.entries.get(SPEED)
    return None if entry is None else float(np.asarray(entry.value))


def difference(model: Model, other: Model) -> str:
    """The first parameter in which two models differ; empty if they are one.

    What says how a run starts, and what a reduced model may change from run to run, makes none.
    """
    if model.parameters is other.parameters:
        return ""
    others = other.parameters.values()
    differing = (
        name
        for name, value in model.parameters.values().items()
        if name not in (*OF_STARTS, *model.definition.online)
        and not np.array_equal(value, others[name])
    )
    return next(differing, "")
