"""What a model is trained on: names, and what a user hands in; of tested runs and of none."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, lru_cache

from vehiclemor.arguments import MOST_NAMES, quoted
from vehiclemor.exceptions import InputError
from vehiclemor.inputs.checks import checked_maneuver
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.registry import component, names, unknown
from vehiclemor.simulation.model import Model
from vehiclemor.study.plans.protocol import CONTENDER, Protocol, load_protocol, protocol_names
from vehiclemor.study.scenario import Scenario, check

# One of `NAMED`, the name of a maneuver, or what is run.
Entry = str | Scenario | Excitation
Given = Entry | Sequence[Entry]
Pairs = Sequence[tuple[float, float]]
# The tested run itself and that with listed factors; what any model has, and some.
NAMED = ("matched", "set", "nominal", "protocol")
OF_TESTED = NAMED[:2]


def training_set(
    model: Model,
    method: str,
    given: Given | None,
    test: Scenario | None = None,
    factors: Pairs = (),
) -> tuple[Scenario, ...]:
    """Training scenarios of a method for a model, see `simulate` and `reduce`.

    None is the training of the model's protocol if the method competes there, else `nominal`.
    Maneuvers are run as the `test` is: from its start, at its speed, with its parameters.
    """
    if given is None:
        given = "protocol" if _of_protocol(model.name, method) else "nominal"
    entries = [given] if isinstance(given, Entry) else given
    if not isinstance(entries, Sequence) or not entries or entries[MOST_NAMES:]:
        raise InputError(f"training is {quoted(given)}: give names, maneuvers or scenarios")
    if bool(factors) != any(isinstance(entry, str) and entry == "set" for entry in entries):
        raise InputError("training 'set' needs training_set, pairs of factors; nothing else does")
    if test is None:
        if wrong := [entry for entry in entries if isinstance(entry, str) and entry in OF_TESTED]:
            raise InputError(f"training {wrong[0]!r} needs a run that is tested: see simulate")
        test = Scenario(component("maneuver", model.definition.maneuver), model.starts[0])
    return tuple(s for entry in entries for s in _scenarios(model, method, entry, test, factors))


def _scenarios(
    model: Model, method: str, entry: Entry, test: Scenario, factors: Pairs
) -> list[Scenario]:
    """What one entry trains on, checked but for what follows from the tested run."""
    if not isinstance(entry, str):
        run = entry if isinstance(entry, Scenario) else replace(test, maneuver=entry)
        driven = model.driven_by(run.maneuver)
        run = replace(run, maneuver=checked_maneuver(run.maneuver, driven.definition))
        check(model, run)
        return [run]
    if entry == "protocol":
        runs = _of_protocol(model.name, method) or _protocol_of(model.name).sets["training"]
        return [replace(run, parameters=test.parameters) for run in runs]
    if entry == "matched":
        return [test]
    if entry == "set":
        return [replace(test, maneuver=test.maneuver.perturbed(*pair)) for pair in factors]
    name = model.definition.maneuver if entry == "nominal" else entry
    if name.partition(":")[0] not in names("maneuver"):
        raise unknown("training", entry, [*NAMED, *names("maneuver")])
    return [_checked(model, replace(test, maneuver=component("maneuver", name)))]


# All runs of a grid may be trained on the same.
@lru_cache(maxsize=64)
def _checked(model: Model, scenario: Scenario) -> Scenario:
    check(model, scenario)
    return scenario


def _of_protocol(model: str, method: str) -> tuple[Scenario, ...]:
    """What a method learns from in the protocol of a model; nothing if it does not compete."""
    if model not in protocol_names():
        return ()
    entries = _protocol_of(model).entries
    of_method = (c.training for c in entries if c.method == method and c.role == CONTENDER)
    return next(of_method, ())


@cache
def _protocol_of(model: str) -> Protocol:
    if model not in protocol_names():
        raise InputError(f"{model} has no protocol: give a list of maneuvers as training")
    return load_protocol(protocol_names()[model])
