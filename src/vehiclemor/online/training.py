"""What a model is trained on where nobody tests it: names, and what a user hands in."""

from collections.abc import Sequence
from functools import cache

from vehiclemor.arguments import quoted
from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.registry import component, unknown
from vehiclemor.resources import data_names
from vehiclemor.simulation.model import Model
from vehiclemor.study.plans.protocol import CONTENDER, Protocol, load_protocol
from vehiclemor.study.scenario import Scenario, check

NAMED = ("nominal", "protocol")


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
