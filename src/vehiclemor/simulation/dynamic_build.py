"""Builds dynamic models (kinds `ode` and `dae`): derived, compiled, checked, with parameters."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vehiclemor.codegen.derivation import Derivation, derivation
from vehiclemor.codegen.loops import loops_digest
from vehiclemor.codegen.object_cache import kernel_hash
from vehiclemor.parameters import ParameterSet, load_parameters
from vehiclemor.registry import component
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.integrators.catalogue import LOOP_SOURCES


def build(
    name: str,
    parameter_file: Path | None = None,
    overrides: Mapping[str, object] | None = None,
) -> DynamicModel:
    """Derive (or fetch), compile and parametrise a registered dynamic model.

    Raises
    ------
    VehiclemorError
        If a parameter is wrong or the vehicle can't stand.
    """
    definition = component("model", name)
    path = parameter_file or getattr(definition, "PARAMETER_FILE", None)
    parameters = load_parameters(name, definition.PARAMETERS, path, overrides)
    values = {
        key: parameters[key] if declared.size > 1 else float(parameters[key])
        for key, declared in definition.PARAMETERS.items()
    }
    definition.check(values)
    equations, digest = compiled(name, definition)
    kernels = equations.kernels
    values |= solved_parameters(definition, values, parameters, equations)
    solved = [float(values[key]) for key in _to_solve(definition)]
    constants = hoisted_constants(equations, parameters, solved)
    states = [q.name for q in (*equations.coordinates, *equations.speeds)]
    typical = dict.fromkeys(states, 1.0) | dict(getattr(definition, "TYPICAL", {}))
    return DynamicModel(
        name,
        definition.SUMMARY,
        definition.KIND,
        equations,
        parameters,
        kernels,
        digest,
        constants,
        definition.starts(values),
        np.array([i for i, state in enumerate(states) if state not in definition.CYCLIC]),
        np.array([typical[state] for state in states]),
        getattr(definition, "VALIDITY", {}),
        tuple(getattr(definition, "LOADS", ())),
        _turning(definition, states),
        np.array([states.index(q) for q in getattr(definition, "PLANAR", ())], dtype=np.int64),
    )


def compiled(name: str, definition: Any) -> tuple[Derivation, str]:
    """Derivation of a model and the hash of its kernels; parameters play no part here."""
    made = derivation(name, definition)
    return made, kernel_hash(f"{made.source}\n{loops_digest(LOOP_SOURCES)}")


def _to_solve(definition: Any) -> tuple[str, ...]:
    """Parameters of the kernels that a model solves for: they follow the declared ones."""
    return tuple(getattr(definition, "SOLVED", ()))


def hoisted_constants(
    equations: Derivation, parameters: ParameterSet, solved: list[float]
) -> np.ndarray:
    """Hoisted constants of a parameter set."""
    constants = np.empty(equations.constants)
    flat = np.concatenate([parameters.flat(), solved])
    equations.kernels.call("constants", flat, constants)
    return constants


def solved_parameters(
    definition: Any, values: Mapping[str, Any], parameters: ParameterSet, equations: Derivation
) -> dict[str, float]:
    """What a model solves for before it can start, by name."""
    if not _to_solve(definition):
        return {}

    def derivative(solved: list[float], x: np.ndarray, u: np.ndarray) -> np.ndarray:
        result = np.empty(len(x))
        constants = hoisted_constants(equations, parameters, solved)
        equations.kernels.call("derivative", x, u, constants, result)
        return result

    return definition.settle(values, derivative)


def _turning(definition: Any, states: list[str]) -> np.ndarray:
    """Numbers of the heading and of the pairs of states that turn with it; empty if none do."""
    heading, pairs = getattr(definition, "HEADING", (None, ()))
    if heading is None:
        return np.zeros(0, dtype=np.int64)
    numbers = [states.index(name) for name in (heading, *(n for pair in pairs for n in pair))]
    return np.array(numbers, dtype=np.int64)
