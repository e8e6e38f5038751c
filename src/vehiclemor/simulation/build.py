"""How a registered model of any kind is made ready to run: derived, compiled, parametrised."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.codegen.cache import kernel_hash, load_module
from vehiclemor.codegen.derivation import Derivation, derivation
from vehiclemor.errors import GeometryError
from vehiclemor.models.definition import ModelDefinition, Values
from vehiclemor.parameters import ParameterSet, load_parameters
from vehiclemor.registry import component
from vehiclemor.simulation.compiled_loops import loops_digest

if TYPE_CHECKING:
    from vehiclemor.models.equations import AlgebraicEquations
    from vehiclemor.simulation.algebraic import AlgebraicModel
    from vehiclemor.simulation.dynamic import DynamicModel
    from vehiclemor.simulation.model import Model

# Largest gap (m or rad) between the joints of a mechanism that counts as assembled.
CLOSED = 1e-9
# Smallest singular value of the Jacobian at design below which a mechanism counts as locked.
SMALLEST_SINGULAR_VALUE = 1e-8


def build(
    name: str,
    parameter_file: Path | None = None,
    overrides: Mapping[str, object] | None = None,
) -> Model:
    """Derive (or fetch), compile and parametrise a registered model.

    Parameters
    ----------
    parameter_file
        The model's own by default.
    overrides
        Parameter name -> value in SI units that replaces the file's.

    Returns
    -------
    AlgebraicModel or DynamicModel
        As the model's kind is `ae`, or `ode` and `dae`; both are a `Model`.

    Raises
    ------
    InputError
        If the name or an override is wrong.
    VehiclemorError
        If the parameters can't be read, or the model can't be assembled from them or can't stand.
    """
    definition: ModelDefinition = component("model", name)
    path = parameter_file or definition.parameter_file
    parameters = load_parameters(name, definition.parameters, path, overrides)
    make = _algebraic if definition.kind == "ae" else _dynamic
    return make(definition, parameters)


def _algebraic(definition: ModelDefinition, parameters: ParameterSet) -> AlgebraicModel:
    """A kinematic model; `GeometryError` where it can't be assembled or is locked at design."""
    # Imported here: a model of one kind needs nothing of the other.
    from vehiclemor.simulation.algebraic import AlgebraicModel

    design = definition.design_coordinates(parameters.values())
    equations, kernels, digest = _compiled_algebraic(definition)
    constants = np.empty(len(equations.program.constant_symbols))
    kernels.constants(parameters.flat(), np.empty(kernels.WORK), constants)
    model = AlgebraicModel(
        name=definition.name,
        summary=definition.summary,
        kind=definition.kind,
        equations=equations,
        parameters=parameters,
        kernels=kernels,
        kernel_hash=digest,
        constants=constants,
        design=design,
        travel_limit=definition.travel_limit,
    )
    nothing = np.zeros(len(model.inputs))
    gap = float(np.abs(model.residual(design, nothing)).max())
    if not gap < CLOSED:
        raise GeometryError(f"the geometry can't be assembled: the joints are {gap:.3g} m apart")
    smallest = float(np.linalg.svd(model.jacobian(design, nothing), compute_uv=False)[-1])
    if smallest < SMALLEST_SINGULAR_VALUE:
        raise GeometryError(
            f"the geometry can't be assembled: the mechanism is locked at design "
            f"(smallest singular value of the Jacobian {smallest:.1e})"
        )
    return model


@lru_cache(maxsize=8)
def _compiled_algebraic(
    definition: ModelDefinition,
) -> tuple[AlgebraicEquations, ModuleType, str]:
    """Equations and compiled kernels of a kinematic model, and their hash."""
    from vehiclemor.codegen.emit import kernel_source, tangent_source, work_size
    from vehiclemor.codegen.link import linked_source
    from vehiclemor.models.equations import AlgebraicEquations
    from vehiclemor.simulation import newton_loops, projected_loops

    equations = definition.derive()
    assert isinstance(equations, AlgebraicEquations)
    sizes = {
        "N": len(equations.coordinates),
        "INPUTS": len(equations.inputs),
        "OUTPUTS": len(equations.outputs),
        "WORK": work_size(equations.program),
    }
    kernels = kernel_source(equations.program) + "\n\n" + tangent_source(equations.program)
    loops = [newton_loops, projected_loops]
    source = linked_source(kernels, loops, sizes, f"model {definition.name}")
    return equations, load_module(definition.name, source), kernel_hash(source)


def _dynamic(definition: ModelDefinition, parameters: ParameterSet) -> DynamicModel:
    """A model of equations of motion."""
    from vehiclemor.simulation.dynamic import DynamicModel

    values = {
        key: parameters[key] if declared.size > 1 else float(parameters[key])
        for key, declared in definition.parameters.items()
    }
    definition.check(values)
    equations, kernels, digest = compiled(definition.name, definition)
    values |= solved_parameters(definition, values, parameters, kernels)
    solved = [float(values[key]) for key in definition.solved]
    states = definition.states
    # The heading comes after the place; it matters where states turn with it.
    rotating = [definition.planar[2]] if definition.heading_pairs else []
    rotating += [state for pair in definition.heading_pairs for state in pair]
    return DynamicModel(
        name=definition.name,
        summary=definition.summary,
        kind=definition.kind,
        equations=equations,
        parameters=parameters,
        kernels=kernels,
        kernel_hash=digest,
        constants=hoisted_constants(kernels, parameters, solved),
        initial=definition.starts(values),
        active=_numbers(states, [state for state in states if state not in definition.cyclic]),
        typical=np.array([definition.error_scale.get(state, 1.0) for state in states]),
        validity=definition.validity,
        loads=definition.loads,
        turning=_numbers(states, rotating),
        planar=_numbers(states, definition.planar),
    )


def _numbers(states: tuple[str, ...], chosen: list[str] | tuple[str, ...]) -> np.ndarray:
    """Places of some states among all."""
    return np.array([states.index(state) for state in chosen], dtype=np.int64)


def compiled(name: str, definition: Any) -> tuple[Derivation, ModuleType, str]:
    """Derivation and compiled kernels, and their hash; parameters play no part here.

    Parameters
    ----------
    definition
        What has `derive`: a model's definition, or a module of equations.
    """
    made = derivation(name, definition)
    digest = kernel_hash(f"{made.source}\n{loops_digest()}")
    return made, load_module(name, made.source), digest


def hoisted_constants(
    kernels: ModuleType, parameters: ParameterSet, solved: list[float]
) -> np.ndarray:
    """Hoisted constants of a parameter set and of the values that were solved for."""
    constants = np.empty(kernels.CONSTANTS)
    flat = np.concatenate([parameters.flat(), solved])
    kernels.constants(flat, np.empty(kernels.WORK), constants)
    return constants


def solved_parameters(
    definition: ModelDefinition, values: Values, parameters: ParameterSet, kernels: ModuleType
) -> dict[str, float]:
    """What a model solves for before it can start, by name."""
    if not definition.solved:
        return {}
    work = np.zeros(kernels.WORK)

    def derivative(solved: list[float], x: np.ndarray, u: np.ndarray) -> np.ndarray:
        result = np.empty(len(x))
        kernels.derivative(x, u, hoisted_constants(kernels, parameters, solved), work, result)
        return result

    return definition.solve_equilibrium(values, derivative)
