"""Experiments: a method with its settings, what it is trained on, and what it is tested on."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

from vehiclemor.exceptions import InputError
from vehiclemor.provenance import code_digest
from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.settings import Value
from vehiclemor.reduction.validation import validated
from vehiclemor.registry import component
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.model import Model
from vehiclemor.study.scenario import Overrides, Scenario, parameters_of

Settings = dict[str, Value]
Keep = Literal["trajectories", "metrics", "errors"]


@dataclass(frozen=True)
class Experiment(ShortRepr):
    """What one result file holds, and all that determines it.

    `kernel` and `code` are hashes of the source of the kernels, and of that of everything that
    computes results; `settings` are all of the method's, empty if it does not accept the model.
    Kept are `trajectories`: histories and all metrics of the one test scenario; `metrics`: the
    metrics alone; `errors`: those that any run has, of every test scenario.
    """

    model: str
    kernel: str
    code: str
    parameters: dict[str, Any]
    method: str
    settings: Settings
    training: tuple[Scenario, ...]
    test: tuple[Scenario, ...]
    keep: Keep = "trajectories"

    @property
    def configuration(self) -> str:
        """Canonical JSON text of the experiment."""
        fields = {name: getattr(self, name) for name in self.__dataclass_fields__}
        for name in ("training", "test"):
            fields[name] = [scenario.content for scenario in fields[name]]
        return json.dumps(fields, sort_keys=True)

    @cached_property
    def key(self) -> str:
        """Hash of the configuration: the name of the result's file."""
        return hashlib.sha256(self.configuration.encode()).hexdigest()[:20]


def make_experiment(
    model: Model,
    method: str,
    settings: Settings,
    training: tuple[Scenario, ...],
    test: tuple[Scenario, ...],
    keep: Keep = "trajectories",
) -> Experiment:
    """An experiment with present kernels, parameters and source; settings are complete ones.

    Unless `errors` are kept there is one test scenario.
    """
    online = model.definition.online
    models: set[Overrides] = set()
    for scenario in test:
        models.add(tuple(pair for pair in scenario.parameters if pair[0] not in online))
    if len(models) > 1:
        raise InputError(
            "the scenarios of a test set have several parameters; a test is of one model"
        )
    return Experiment(
        model.name,
        model.kernel_hash,
        code_digest(model.name, method),
        parameters_of(model),
        method,
        settings,
        training,
        test,
        keep,
    )


def complete_settings(
    model: Model,
    method_name: str,
    given: Mapping[str, object] | None = None,
    preset: str = "recommended",
) -> Settings:
    """All settings of a method for a model, validated; none if it refuses the model.

    (That is a result: what was set for a model of another kind can't be judged here.)
    """
    method: Method = component("method", method_name)
    if not method.accepts(model)[0]:
        return {}
    coordinates = len(model.coordinates)
    return validated(method, model.kind, given or {}, preset, coordinates).model_dump()


def default_settings(model: Model, method_name: str) -> Settings:
    """Declared names and defaults; none for a kind of model that the method doesn't know."""
    schema = component("method", method_name).settings.get(model.kind)
    return {name: field.default for name, field in schema.model_fields.items()} if schema else {}
