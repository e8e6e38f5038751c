"""Runs of a grid: what the values of a point say about input, start, car and training."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

from vehiclemor.errors import InputError, VehiclemorError
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.registry import component
from vehiclemor.simulation.model import Model
from vehiclemor.study.plans.study_file import FACTORS, PARAMETER, StudyFile
from vehiclemor.study.plans.training import training_set
from vehiclemor.study.scenario import (
    Overrides,
    Scenario,
    check,
    overrides,
    with_parameters,
)


class Run(NamedTuple):
    """All of a point that determines training and test scenarios.

    Attributes
    ----------
    learner
        The method, where the training depends on it.
    """

    maneuver: str
    factors: tuple[float, float]
    start: str
    car: Overrides
    training: tuple[str, ...]
    learner: str
    pairs: tuple[tuple[float, float], ...]

    @property
    def test(self) -> Scenario:
        """What is tested."""
        maneuver: Maneuver = component("maneuver", self.maneuver)
        return Scenario(maneuver.perturbed(*self.factors), self.start, None, self.car)


# As many as stand side by side in a grid, whose settings vary in between.
@lru_cache(maxsize=1024)
def scenarios(model: Model, run: Run) -> tuple[tuple[Scenario, ...], Scenario]:
    """Training and test scenarios of a run."""
    test = run.test
    training = training_set(model, run.learner, run.training, test, run.pairs)
    return training, test


def run_at(study: StudyFile, point: Mapping[str, Any]) -> Run:
    """The run at a point: name of a dimension, and `maneuver` -> value."""
    entry = study.labelled[point["label"]]
    car = {
        name.removeprefix(PARAMETER): value
        for name, value in point.items()
        if name.startswith(PARAMETER)
    }
    training = entry.training or point.get("training", study.training)
    training = tuple(training) if isinstance(training, list) else (training,)
    return Run(
        point["maneuver"],
        (point[FACTORS[0]], point[FACTORS[1]]),
        point["start"],
        overrides(car),
        training,
        entry.method if "protocol" in training else "",
        tuple((pair[0], pair[1]) for pair in study.training_set),
    )


def check_run(model: Model, run: Run) -> None:
    """Raise `InputError` if the model can't be run so, with the parameters if it can't be made."""
    try:
        with_parameters(model, run.car)
    except VehiclemorError as error:
        told = ", ".join(f"{name} = {value}" for name, value in run.car)
        raise InputError(f"{told}: {error}") from None
    check(model, run.test)
