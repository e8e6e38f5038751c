"""Experiments: a method with its settings, what it is trained on, and what it is tested on."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.settings import Value, validated
from vehiclemor.registry import component, unknown
from vehiclemor.simulation.model import Model
from vehiclemor.study.provenance import code_digest
from vehiclemor.study.scenario import Scenario, parameters_of

Settings = dict[str, Value]
Keep = Literal["trajectories", "metrics", "errors"]


@dataclass(frozen=True)
class Experiment:
    """What one result file holds, and all that determines it.

    Attributes
    ----------
    kernel, code
        Hash of the compiled kernels, and of the source of everything that computes results.
    parameters
        Name -> value of the model's parameters, SI units.
    settings
        All settings of the method; empty if it does not accept the model.
    keep
        `trajectories`: histories and all metrics of the one test scenario; `metrics`: the metrics
        alone; `errors`: errors of the outputs in every test scenario.
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

    @cached_property
    def configuration(self) -> str:
        """Canonical JSON text of the experiment."""
        names = self.__dataclass_fields__
        content = {name: getattr(self, name) for name in names} | {
            "training": [scenario.content for scenario in self.training],
            "test": [scenario.content for scenario in self.test],
        }
        return json.dumps(content, sort_keys=True)

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
    """An experiment with the present kernels, parameters and source.

    Parameters
    ----------
    settings
        From `complete_settings`.
    """
    if keep != "errors" and len(test) != 1:
        raise ValueError(f"{keep} are kept of one test scenario, not of {len(test)}")
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
    """All settings of a method for a model, validated.

    That a method refuses a model is a result: what was set for a model of another kind can't be
    judged here, and nothing is set.

    Raises
    ------
    InputError
        If the preset, a name or a value is wrong.
    """
    method: Method = component("method", method_name)
    if not method.accepts(model)[0]:
        return {}
    presets = method.presets(model)
    if preset not in presets:
        raise unknown(f"preset of {method_name}", preset, presets)
    return validated(method_name, method.settings(model.kind), given or {}, presets[preset])
