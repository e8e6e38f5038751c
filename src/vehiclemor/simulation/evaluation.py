"""Kernels of models: along paths, their analytic derivatives at a state, and their constants.

Constants are hoisted from the equations: they follow from the parameters alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from vehiclemor.arguments import quoted
from vehiclemor.codegen.derivatives import jacobian_product
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.loops import Loop, loops
from vehiclemor.codegen.operations import LANES
from vehiclemor.exceptions import InputError
from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.registry import choice
from vehiclemor.simulation.checks import checked_path

PATH_LOOPS = ("simulation.loop_arguments", "simulation.path_loops")
# Places of the arguments of a kernel.
STATE, INPUTS, CONSTANTS = range(3)
PLACES = {"state": STATE, "inputs": INPUTS}
# State, inputs and constants, as kernels want them.
Arrays = tuple[np.ndarray, np.ndarray, np.ndarray]
# What derivatives are taken by: `state`, `inputs`, or names of parameters.
By = str | Sequence[str]
# Step of a parameter in differences, as a part of it or of the second number (SI units).
STEP, SMALLEST = 1e-4, 1e-2


def at_samples(
    kernels: Kernels,
    name: str,
    constants: np.ndarray,
    paths: tuple[np.ndarray, np.ndarray],
    sizes: tuple[int, int, int],
    finite: bool = False,
) -> np.ndarray:
    """Results (samples, size) of a kernel at every sample of paths of states and inputs.

    `sizes` are numbers of states, inputs and results: `InputError` if a path has another shape, as
    the kernel reads as many numbers as it knows, or if it must be finite and isn't.
    """
    states = checked_path(paths[0], sizes[0], "states", finite=finite)
    inputs = checked_path(paths[1], sizes[1], "inputs", len(states), finite)
    lanes = LANES if len(states) >= LANES else 1
    address = np.array([address_of(kernels, name, lanes)], dtype=np.int64)
    kernels.sources[name].check(sizes[0], sizes[1], len(constants), sizes[2])
    result = np.empty((len(states), sizes[2]))
    path_loops()["kernel_path"](states, inputs, address, constants, result)
    return result


def address_of(kernels: Kernels, name: str, lanes: int = 1, results: tuple[int, ...] = ()) -> int:
    """Address of a kernel for loops, which don't look before they call it; else `InputError`.

    See `Kernels.address`.
    """
    address = kernels.address(name, lanes, results)
    if not address:
        raise InputError(f"the equations have no {name}")
    return address


def path_loops() -> Mapping[str, Loop]:
    """Loops over the samples of a path, the same for all systems."""
    return loops(PATH_LOOPS, ("kernel_path", "watched", "chosen", "sampled"))


def partial(kernels: Kernels, name: str, arrays: Arrays, size: int, argument: int) -> np.ndarray:
    """Derivatives (size, n) of a kernel's result by the entries of the argument at a argument."""
    source = kernels.sources[name]
    product = jacobian_product(source, source.arguments[argument], size, len(arrays[argument]))
    return product.jacobian(arrays)


def directional(
    kernels: Kernels, name: str, arrays: Arrays, size: int, argument: int, directions: np.ndarray
) -> np.ndarray:
    """Derivatives (k, size) of a kernel's result along directions (k, n) of one argument."""
    source = kernels.sources[name]
    product = jacobian_product(source, source.arguments[argument], size, len(arrays[argument]))
    return product.columns(arrays, directions)


def parameter_names(by: Any) -> tuple[str, ...]:
    """Names of parameters that derivatives are by; none for state and inputs.

    `InputError` if it is neither a name nor a sequence of names.
    """
    if isinstance(by, str):
        return () if by in PLACES else (by,)
    names = tuple(by) if isinstance(by, Sequence) else ()
    if not names or not all(isinstance(name, str) for name in names):
        raise InputError(
            f"with_respect_to is {quoted(by)}, neither state nor inputs nor names of parameters"
        )
    return names


# --- constants ------------------------------------------------------------------------------------


def values_of(definition: ModelDefinition, flat: np.ndarray) -> dict[str, Any]:
    """Values by name of all components in declared order: floats, and arrays of several."""
    values, numbers, first = {}, flat.tolist(), 0
    for name, declared in definition.parameters.items():
        end = first + declared.size
        values[name] = flat[first:end].copy() if declared.size > 1 else numbers[first]
        first = end
    return values


def hoisted_constants(equations: Kernels, flat: np.ndarray, solved: Sequence[float]) -> np.ndarray:
    """Hoisted constants of all components of the parameters and of what was solved for."""
    constants = np.empty(equations.constants)
    equations.call("constants", np.concatenate([flat, solved]), constants)
    return constants


def solved_parameters(
    definition: ModelDefinition, flat: np.ndarray, equations: Kernels
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
        equations.call("derivative", x, inputs, constants, result)
        return result

    return definition.solve_equilibrium(values_of(definition, flat), derivative)


def components(definition: ModelDefinition, name: str) -> range:
    """Numbers of the components of a parameter among those of all, or `InputError`."""
    declared = definition.parameters
    position = [*declared].index(choice("parameter", name, declared))
    first = sum(before.size for before in [*declared.values()][:position])
    return range(first, first + declared[name].size)


def constant_derivatives(
    definition: ModelDefinition, equations: Kernels, values: np.ndarray, numbers: Sequence[int]
) -> np.ndarray:
    """Derivatives (numbers, constants) of the hoisted constants by components of the parameters.

    Values are `Model.parameter_values`.  The model is built anew with each: what its equilibrium
    solves for follows.  That part is by differences of order 4, the rest is exact.
    """
    flat = values[: len(values) - len(definition.solved)]

    def solved(moved: np.ndarray) -> np.ndarray:
        solved = solved_parameters(definition, moved, equations)
        return np.array([solved[name] for name in definition.solved])

    directions = np.zeros((len(numbers), len(values)))
    directions[np.arange(len(numbers)), numbers] = 1.0
    directions[:, len(flat) :] = differences(solved, flat, numbers)
    source = equations.sources["constants"]
    product = jacobian_product(source, source.arguments[0], equations.constants, len(values))
    return product.columns((values,), directions)


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
