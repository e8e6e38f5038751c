"""What a model is trained on: names, and what a user hands in; of tested runs and of none."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, lru_cache

from vehiclemor.arguments import quoted
from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.reduction.training import trained_maneuvers
from vehiclemor.registry import component
from vehiclemor.resources import data_names
from vehiclemor.simulation.maneuver_checks import checked_maneuver
from vehiclemor.simulation.model import Model
from vehiclemor.study.plans.protocol import CONTENDER, Protocol, load_protocol
from vehiclemor.study.scenario import Overrides, Scenario, check

# One of `POLICIES`, `protocol`, the name of a maneuver, or what is run.
Entry = str | Scenario | Maneuver
Given = Entry | Sequence[Entry]
# What follows from the run that is tested.
OF_TESTED = ("matched", "set")


def training_set(
    model: Model,
    method: str,
    given: Given | None,
    test: Scenario | None = None,
    factors: Sequence[tuple[float, float]] = (),
    cars: Sequence[Overrides] | None = None,
) -> tuple[Scenario, ...]:
    """Training scenarios of a method for a model, see `simulate` and `reduce`.

    Parameters
    ----------
    given
        None is the training of the model's protocol if the method competes there, else `nominal`.
    test
        What is tested: maneuvers are run from its start, at its speed, by its car.
    factors
        Of `set`.
    cars
        Parameters of the cars that are trained on, each with every run; as they are where None.

    Raises
    ------
    InputError
        If an entry is none of these, or can't be run.
    """
    if given is None:
        given = "protocol" if _of_protocol(model.name, method) else "nominal"
    entries = [given] if isinstance(given, Entry) else given
    if not isinstance(entries, Sequence) or not entries:
        raise InputError(f"training is {quoted(given)}: give names, maneuvers or scenarios")
    if factors and "set" not in [entry for entry in entries if isinstance(entry, str)]:
        raise InputError("training_set is for training 'set' alone")
    found = [s for entry in entries for s in _scenarios(model, method, entry, test, factors)]
    if cars is not None:
        found = [replace(scenario, parameters=car) for car in cars for scenario in found]
    return tuple(found)


def _scenarios(
    model: Model,
    method: str,
    entry: Entry,
    test: Scenario | None,
    factors: Sequence[tuple[float, float]],
) -> list[Scenario]:
    """What one entry trains on, checked but for what follows from the tested run."""
    base = test or Scenario(component("maneuver", model.definition.maneuver), model.starts[0])
    if not isinstance(entry, str):
        run = entry if isinstance(entry, Scenario) else replace(base, maneuver=entry)
        run = replace(run, maneuver=checked_maneuver(run.maneuver, model.definition))
        check(model, run)
        return [run]
    if entry == "protocol":
        runs = _of_protocol(model.name, method) or _protocol_of(model.name).sets["training"]
        return [replace(run, parameters=base.parameters) for run in runs]
    derived = entry in OF_TESTED
    if derived and test is None:
        raise InputError(f"training {entry!r} needs a run that is tested, as simulate has it")
    maneuvers = trained_maneuvers(model, base.maneuver, entry, factors)
    found = [replace(base, maneuver=maneuver) for maneuver in maneuvers]
    return found if derived else [_checked(model, run) for run in found]


# All runs of a grid may be trained on the same.
@lru_cache(maxsize=64)
def _checked(model: Model, scenario: Scenario) -> Scenario:
    check(model, scenario)
    return scenario


def _of_protocol(model: str, method: str) -> tuple[Scenario, ...]:
    """What a method learns from in a model's own protocol; nothing if it does not compete."""
    if model not in data_names("protocols"):
        return ()
    contestants = _protocol_of(model).contestants
    of_method = (c.training for c in contestants if c.method == method and c.role == CONTENDER)
    return next(of_method, ())


@cache
def _protocol_of(model: str) -> Protocol:
    if model not in data_names("protocols"):
        raise InputError(f"{model} has no protocol: give a list of maneuvers as training")
    return load_protocol(model)
