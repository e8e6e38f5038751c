"""Hoisted constants of a parameter set, and how they change with single parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.codegen.derivatives import jacobian_product
from vehiclemor.registry import choice

if TYPE_CHECKING:
    from vehiclemor.codegen.kernels import Derivation
    from vehiclemor.multibody.definition import ModelDefinition

# Step of a parameter in differences, as a part of it or of the second number (SI units).
STEP, SMALLEST = 1e-4, 1e-2


def values_of(definition: ModelDefinition, flat: np.ndarray) -> dict[str, Any]:
    """Values by name of all components in declared order: floats, and arrays of several."""
    values, numbers, first = {}, flat.tolist(), 0
    for name, declared in definition.parameters.items():
        end = first + declared.size
        values[name] = flat[first:end].copy() if declared.size > 1 else numbers[first]
        first = end
    return values


def hoisted_constants(
    equations: Derivation, flat: np.ndarray, solved: Sequence[float]
) -> np.ndarray:
    """Hoisted constants of all components of the parameters and of what was solved for."""
    constants = np.empty(equations.constants)
    equations.kernels.call("constants", np.concatenate([flat, solved]), constants)
    return constants


def solved_parameters(
    definition: ModelDefinition, flat: np.ndarray, equations: Derivation
) -> dict[str, float]:
    """What a model solves for before it can start, by name; with optional inputs at defaults."""
    if not definition.solved:
        return {}
    defaults = {q.name: q.default or 0.0 for q in definition.optional_inputs}
    driven, constant = (
        [defaults[name] for name in names]
        for names in (definition.choice.driven, definition.choice.constant)
    )
    # Parameters that are inputs come last.
    parameters = np.concatenate([flat[: len(flat) - len(constant)], constant])

    def derivative(solved: list[float], x: np.ndarray, u: np.ndarray) -> np.ndarray:
        result, inputs = np.empty(len(x)), np.concatenate([u, driven])
        constants = hoisted_constants(equations, parameters, solved)
        equations.kernels.call("derivative", x, inputs, constants, result)
        return result

    return definition.solve_equilibrium(values_of(definition, flat), derivative)


def components(definition: ModelDefinition, name: str) -> range:
    """Numbers of the components of a parameter among those of all, or `InputError`."""
    declared = definition.parameters
    position = [*declared].index(choice("parameter", name, declared))
    first = sum(before.size for before in [*declared.values()][:position])
    return range(first, first + declared[name].size)


def constant_derivatives(
    definition: ModelDefinition, flat: np.ndarray, equations: Derivation, numbers: Sequence[int]
) -> np.ndarray:
    """Derivatives (numbers, constants) of the hoisted constants by components of the parameters.

    The model is built anew with each: what its equilibrium solves for follows.  That part is by
    differences of order 4, the rest is exact.
    """

    def solved(moved: np.ndarray) -> np.ndarray:
        solved = solved_parameters(definition, moved, equations)
        return np.array([solved[name] for name in definition.solved])

    directions = np.zeros((len(numbers), len(flat) + len(definition.solved)))
    directions[np.arange(len(numbers)), numbers] = 1.0
    if definition.solved:
        directions[:, len(flat) :] = differences(solved, flat, numbers)
    given = np.concatenate([flat, solved(flat)]) if definition.solved else flat
    source = equations.sources["constants"]
    found = jacobian_product(source, source.arguments[0], equations.constants, len(given))
    return found.columns((given,), directions)


def differences(
    function: Callable[[np.ndarray], np.ndarray], flat: np.ndarray, numbers: Sequence[int]
) -> np.ndarray:
    """Derivatives (numbers, size) of a smooth function of the parameters, by order 4."""
    rows = []
    for number in numbers:
        step = np.zeros_like(flat)
        step[number] = STEP * max(abs(flat[number]), SMALLEST)
        near, far = (function(flat + k * step) - function(flat - k * step) for k in (1, 2))
        rows.append((8.0 * near - far) / (12.0 * step[number]))
    return np.array(rows)
