"""What a model is trained on where nobody tests it: names, and what a user hands in."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from vehiclemor.arguments import quoted, real_array
from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.registry import component, unknown
from vehiclemor.resources import data_names
from vehiclemor.simulation.build import reparametrised
from vehiclemor.simulation.model import Model
from vehiclemor.study.plans.protocol import CONTENDER, Protocol, load_protocol
from vehiclemor.study.scenario import Scenario, check, overrides

NAMED = ("nominal", "protocol")
# Name of a parameter -> both ends of its range.
Box = Mapping[str, Sequence[float]]
# Cars inside of a box, beside its centre and those at either end of one parameter: so many for
# each parameter, and the seed of their Latin hypercube.
INSIDE, SEED = 4, 2008


def training_set(
    model: Model, method: str, given: str | Sequence[Scenario | Maneuver] | None
) -> tuple[Scenario, ...]:
    """Training scenarios of a method for a model, see `reduce`."""
    if given is None:
        found = _of_protocol(model.name, method)
        return found or (_nominal(model),)
    if isinstance(given, str):
        if given not in NAMED:
            raise unknown("training", given, NAMED)
        if given == "nominal":
            return (_nominal(model),)
        protocol = _protocol(model.name)
        if protocol is None:
            raise InputError(f"{model.name} has no protocol: give a list of maneuvers as training")
        return _of_protocol(model.name, method) or protocol.sets["training"]
    wrong = f"training is {quoted(given)}, neither a name nor a list of maneuvers or scenarios"
    if not isinstance(given, Sequence) or not given:
        raise InputError(wrong)
    scenarios = [
        entry if isinstance(entry, Scenario) else Scenario(entry, model.starts[0])
        for entry in given
    ]
    for scenario in scenarios:
        check(model, scenario)
    return tuple(scenarios)


def of_cars(
    model: Model, scenarios: Sequence[Scenario], cars: Box | Sequence[Mapping[str, Any]]
) -> tuple[Scenario, ...]:
    """Training scenarios of the model's own car, then of others, see `reduce`."""
    given = cars_in(cars) if isinstance(cars, Mapping) else cars
    wrong = f"cars is {quoted(cars)}, neither ranges of parameters nor a list of cars"
    if isinstance(given, str) or not isinstance(given, Sequence):
        raise InputError(wrong)
    if not all(isinstance(car, Mapping) for car in given):
        raise InputError(wrong)
    for car in given:
        reparametrised(model, car)
    known = [(), *(overrides(car) for car in given)]
    return tuple(replace(s, parameters=car) for car in dict.fromkeys(known) for s in scenarios)


def cars_in(box: Box) -> list[dict[str, float]]:
    """Cars that stand for a box: its centre, the ends of each parameter, and some inside."""
    from scipy.stats import qmc

    names, ranges = list(box), [real_array(ends) for ends in box.values()]
    for name, ends in zip(names, ranges, strict=True):
        if ends.shape != (2,) or not ends[0] < ends[1]:
            raise InputError(f"cars: {name} is {quoted(box[name])}, not the two ends of a range")
    star = np.vstack([np.zeros(len(names)), *(sign * np.eye(len(names)) for sign in (-1.0, 1.0))])
    inside = qmc.LatinHypercube(len(names), rng=SEED).random(INSIDE * len(names))
    low, high = np.transpose(ranges)
    shares = np.vstack([0.5 * (1.0 + star), inside])
    return [dict(zip(names, car, strict=True)) for car in (low + shares * (high - low)).tolist()]


def _nominal(model: Model) -> Scenario:
    return Scenario(component("maneuver", model.definition.maneuver), model.starts[0])


def _of_protocol(model: str, method: str) -> tuple[Scenario, ...]:
    """What a method learns from in a model's own protocol; nothing if it does not compete."""
    protocol = _protocol(model)
    contestants = () if protocol is None else protocol.contestants
    of_method = (c.training for c in contestants if c.method == method and c.role == CONTENDER)
    return next(of_method, ())


@cache
def _protocol(model: str) -> Protocol | None:
    return load_protocol(model) if model in data_names("protocols") else None
