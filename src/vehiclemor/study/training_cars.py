"""Cars that are trained on beside a model's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from vehiclemor.arguments import quoted, real_array
from vehiclemor.errors import InputError
from vehiclemor.reduction.cars import OF_STARTS
from vehiclemor.reduction.vehicle.trajectory_fit import spread
from vehiclemor.simulation.model import Model
from vehiclemor.study.scenario import Scenario, overrides, with_parameters

# Name of a parameter -> both ends of its range.
Box = Mapping[str, Sequence[float]]
# Cars inside of a box, beside its centre and those at either end of one parameter: so many for
# each parameter, and the seed of their Latin hypercube.
INSIDE, SEED = 12, 2008
# Runs of each car beside the model's own, not the same of all.
RUNS = 10


def of_cars(
    model: Model, scenarios: Sequence[Scenario], cars: Box | Sequence[Mapping[str, Any]]
) -> tuple[Scenario, ...]:
    """Training scenarios of the model's own car, then some of them of each other one.

    Parameters
    ----------
    cars
        Ranges of parameters, in which some cars are chosen, or the parameters of each car.

    Raises
    ------
    VehiclemorError
        If a parameter is wrong, or a car can't stand.
    """
    given = cars_in(cars) if isinstance(cars, Mapping) else cars
    wrong = f"cars is {quoted(cars)}, neither ranges of parameters nor a list of cars"
    if isinstance(given, str) or not isinstance(given, Sequence):
        raise InputError(wrong)
    if not all(isinstance(car, Mapping) for car in given):
        raise InputError(wrong)
    found = list(scenarios)
    for number, car in enumerate(given):
        parameters = overrides(car)
        with_parameters(model, parameters)
        some = spread(scenarios, RUNS / len(scenarios), number / len(given))
        found += [replace(s, parameters=parameters) for s in some or scenarios[:1]]
    return tuple(dict.fromkeys(found))


def by_cars(model: Model, scenarios: Sequence[Scenario], box: Box) -> list[Scenario]:
    """Each scenario by another car of a box, a Latin hypercube."""
    from scipy.stats import qmc

    low, high = np.transpose([real_array(ends) for ends in box.values()])
    shares = qmc.LatinHypercube(len(box), rng=SEED + 1).random(len(scenarios))
    found = []
    for scenario, car in zip(scenarios, (low + shares * (high - low)).tolist(), strict=True):
        found.append(replace(scenario, parameters=overrides(dict(zip(box, car, strict=True)))))
        with_parameters(model, found[-1].parameters or ())
    return found


def cars_in(box: Box) -> list[dict[str, float]]:
    """Cars that stand for a box: its centre, the ends of each parameter, and some inside."""
    from scipy.stats import qmc

    names, ranges = list(box), [_ends(*entry) for entry in box.items()]
    if started := next((name for name in names if name in OF_STARTS), ""):
        raise InputError(f"cars: {started} says how a run starts, not which car it is")
    if not names:
        return []
    star = np.vstack([np.zeros(len(names)), *(sign * np.eye(len(names)) for sign in (-1.0, 1.0))])
    inside = qmc.LatinHypercube(len(names), rng=SEED).random(INSIDE * len(names))
    low, high = np.transpose(ranges)
    shares = np.vstack([0.5 * (1.0 + star), inside])
    return [dict(zip(names, car, strict=True)) for car in (low + shares * (high - low)).tolist()]


def _ends(name: str, given: object) -> np.ndarray:
    """Both ends (2,) of the range of a parameter."""
    with suppress(TypeError):
        ends = real_array(given)
        if ends.shape == (2,) and ends[0] < ends[1]:
            return ends
    raise InputError(f"cars: {name} is {quoted(given)}, not the two ends of a range")
