"""Runs of a grid: what the values of a point say about input, start, car and training."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

from vehiclemor.errors import InputError, VehiclemorError
from vehiclemor.maneuver import Maneuver
from vehiclemor.registry import component, unknown
from vehiclemor.simulation.model import Model
from vehiclemor.study.plans.sampling import sampled
from vehiclemor.study.plans.study_file import FACTORS, PARAMETER, Sampling, StudyFile
from vehiclemor.study.plans.training import training_set
from vehiclemor.study.scenario import (
    Overrides,
    Scenario,
    check,
    overrides,
    with_parameters,
)

# Cars that are trained on; None for the tested one.
Cars = tuple[Overrides, ...] | None


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
    cars: Cars

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
    training = training_set(model, run.learner, run.training, test, run.pairs, run.cars)
    return training, test


def run_at(study: StudyFile, point: Mapping[str, Any], trained: Mapping[str, Cars]) -> Run:
    """The run at a point: name of a dimension, and `maneuver` -> value."""
    entry = study.labelled[point["method"]]
    car = {
        name.removeprefix(PARAMETER): value
        for name, value in point.items()
        if name.startswith(PARAMETER)
    }
    cars = entry.cars or point.get("cars", study.cars)
    # What the study lists has no name, and a grid can't ask for it.
    named = isinstance(cars, str) or "cars" in point
    trained_on = _known(cars if named else "", trained)
    # To what learns from no car all are the same.
    learns = component("method", entry.method).learns_from != "inputs"
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
        trained_on if learns else None,
    )


def _known(cars: object, trained: Mapping[str, Cars]) -> Cars:
    if not isinstance(cars, str) or cars not in trained:
        raise unknown("cars", cars, [name for name in trained if name])
    return trained[cars]


def trained_cars(study: StudyFile) -> dict[str, Cars]:
    """Name -> cars that are trained on; what the study lists without a name has none."""
    found: dict[str, Cars] = {"own": None, "nominal": ((),)}
    listed = study.car_sets | ({} if isinstance(study.cars, str) else {"": study.cars})
    for name, entry in listed.items():
        if name in ("own", "nominal"):
            raise InputError(f"car_sets: {name} is no name for a set")
        cars = _sampled_cars(name, entry) if isinstance(entry, Sampling) else entry
        if not cars:
            raise InputError(f"car_sets: {name or 'cars'} is empty")
        found[name] = tuple(overrides(car) for car in cars)
    return found


def _sampled_cars(name: str, plan: Sampling) -> list[dict[str, float]]:
    if not all(column.startswith(PARAMETER) for column in plan.ranges):
        raise InputError(f"car_sets: {name} samples what is no parameter of a car")
    names = [column.removeprefix(PARAMETER) for column in plan.ranges]
    return [dict(zip(names, row, strict=True)) for row in zip(*sampled(plan).values(), strict=True)]


def check_car(model: Model, car: Overrides, where: str = "") -> None:
    """Raise `InputError` with the parameters if a car can't be made, or can't stand."""
    try:
        with_parameters(model, car)
    except VehiclemorError as error:
        told = ", ".join(f"{name} = {value}" for name, value in car)
        raise InputError(f"{where}{told}: {error}") from None


def check_run(model: Model, run: Run) -> None:
    """Raise `InputError` if the model can't be run so."""
    check_car(model, run.car)
    check(model, run.test)
