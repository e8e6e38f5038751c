"""How a registered model of any kind becomes ready to run: derived, compiled, parametrised."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.arguments import quoted, real_array
from vehiclemor.codegen.kernels import Kernels, derivation, is_derived
from vehiclemor.codegen.loops import loops_digest
from vehiclemor.exceptions import InputError, VehiclemorError, blamed
from vehiclemor.multibody.definition import (
    DESIGN_START,
    ModelDefinition,
    driving,
    with_constants,
    with_overrides,
)
from vehiclemor.multibody.quantities import DEFAULTS
from vehiclemor.parameters import ParameterSet, load_parameters, overridden, parameter_path
from vehiclemor.progress import first_use
from vehiclemor.registry import component
from vehiclemor.simulation.checks import checked_array
from vehiclemor.simulation.evaluation import hoisted_constants, solved_parameters, values_of

if TYPE_CHECKING:
    from vehiclemor.simulation.dynamic import DynamicModel
    from vehiclemor.simulation.model import Model
    from vehiclemor.symbolic.program import Program

# Integrators freeze the Jacobian of the model of rounded parameters, which many cars share.  They
# are rounded to the default ones and steps of this part of them; points to steps of so many m.
ROUNDED, ROUNDED_POINT, SMALLEST = 0.25, 0.02, 1e-9


def build(
    name: str,
    parameter_file: Path | None = None,
    overrides: Mapping[str, object] | None = None,
    *,
    constant_inputs: Mapping[str, object] | None = None,
    driven: Iterable[str] = (),
) -> Model:
    """Derive (or fetch), compile and parametrise a registered model.

    The parameter file is the registered one by default, overrides are values in SI units by name,
    of parameters and of optional inputs that are constant.  Constant inputs are such values too;
    runs drive the optional inputs `driven`.  `InputError` if a name or an override is wrong;
    another `VehiclemorError` if the parameters can't be read, or the model can't be assembled from
    them or can't stand.
    """
    definition: ModelDefinition = driving(component("model", name), driven)
    inputs = {} if constant_inputs is None else constant_inputs
    if not isinstance(inputs, Mapping):
        raise InputError(f"inputs must be a mapping of values by name, not {quoted(inputs)}")
    definition = with_constants(definition, inputs)
    overrides = {} if overrides is None else overrides
    definition = with_overrides(definition, overrides)
    path = parameter_file or definition.parameter_file
    parameters = load_parameters(name, definition.parameters, path, {**overrides, **inputs})
    with first_use(name):
        return _made(definition, parameters)


def reparametrised(model: Model, overrides: Mapping[str, object]) -> Model:
    """The model with some of its parameters changed: name -> value in SI units; see `build`."""
    return _changed(model, with_overrides(model.definition, overrides), overrides)


@lru_cache(maxsize=64)
def _rebuilt(model: Model, definition: ModelDefinition) -> Model:
    """The model with the inputs of another declaration of it."""
    return _changed(model, definition, {})


def _changed(model: Model, definition: ModelDefinition, overrides: Mapping[str, object]) -> Model:
    """A model with other values, and what another choice of inputs adds or drops."""
    parameters = overridden(model.parameters, definition.parameters, overrides)
    same = definition is model.definition
    with first_use(model.name):
        return _made(definition, parameters, (model.equations, model.kernel_hash) if same else None)


def _made(
    definition: ModelDefinition,
    parameters: ParameterSet,
    derived: tuple[Kernels, str] | None = None,
) -> Model:
    """A model of equations that may have been derived already, see `compiled`."""
    name, flat, further = definition.name, parameters.flat(), {}
    values, initial = values_of(definition, flat), {DESIGN_START: np.zeros(0)}
    with blamed(f"model {name!r}: check", definition.check):
        definition.check(values)
    if definition.kind == "ae":
        with blamed(f"model {name!r}: design_coordinates", definition.design_coordinates):
            initial = {DESIGN_START: real_array(definition.design_coordinates(parameters.values()))}
    equations, digest = derived or compiled(definition)
    check_equations(definition, equations)
    with blamed(f"model {name!r}: solve_equilibrium", definition.solve_equilibrium):
        values |= solved_parameters(definition, flat, equations)
        solved = [float(values[key]) for key in definition.solved]
    if definition.kind in ("ode", "dae"):
        with blamed(f"model {name!r}: starts", definition.starts):
            initial = {start: real_array(x) for start, x in definition.starts(values).items()}
        further = {"near": _near(definition, flat, equations, digest)}
    if not initial:
        raise InputError(f"model {name!r} has no start")
    for start, state in initial.items():
        checked_array(state, len(definition.states), f"start {start!r}", name)
    constants = hoisted_constants(equations, flat, solved)
    fields = definition, equations, parameters, digest, constants, initial, _rebuilt
    return _class_of(definition.kind)(*fields, **further)


def _class_of(kind: str) -> type[Model]:
    # Imported here: a model of one kind needs nothing of the others.
    if kind == "ae":
        from vehiclemor.simulation.algebraic import AlgebraicModel

        return AlgebraicModel
    if kind == "structural":
        from vehiclemor.simulation.structures.model import StructuralModel

        return StructuralModel
    from vehiclemor.simulation.dynamic import DynamicModel

    return DynamicModel


def _near(definition: ModelDefinition, flat: np.ndarray, *derived: Any) -> DynamicModel | None:
    """The model of rounded parameters; none if these are round, or there is no such model."""
    try:
        usual, steps = _usual_parameters(definition)
        rounded = usual + steps * np.rint((flat - usual) / steps)
        if np.array_equal(rounded, flat):
            return None
        return _rounded_model(definition, rounded.tobytes(), *derived)
    except VehiclemorError:
        return None


@lru_cache(maxsize=64)
def _usual_parameters(definition: ModelDefinition) -> tuple[np.ndarray, np.ndarray]:
    """Components of the default parameters, and the steps to which others are rounded."""
    declared = definition.parameters
    usual = load_parameters(definition.name, declared, definition.parameter_file).flat()
    points = np.repeat([d.size > 1 for d in declared.values()], [d.size for d in declared.values()])
    steps = np.where(points, ROUNDED_POINT, np.maximum(ROUNDED * np.abs(usual), SMALLEST))
    return usual, steps


@lru_cache(maxsize=8)
def _rounded_model(definition: ModelDefinition, rounded: bytes, *derived: Any) -> Any:
    overrides = values_of(definition, np.frombuffer(rounded))
    name, declared, path = definition.name, definition.parameters, definition.parameter_file
    return _made(definition, load_parameters(name, declared, path, overrides), derived)


def kept_build(name: str) -> Model:
    """As `build` with the default parameters, to be read; cached while their file is the same."""
    definition: ModelDefinition = component("model", name)
    try:
        parameters = (definition.parameter_file or parameter_path(name)).read_bytes()
    except OSError:
        # The error is raised where the file is read.
        parameters = b""
    return _kept(definition, parameters)


@lru_cache(maxsize=8)
def _kept(definition: ModelDefinition, _: bytes) -> Model:
    return build(definition.name)


def build_derived(name: str) -> Model | None:
    """A model that was derived before; deriving one takes long where it is only described."""
    definition: ModelDefinition = component("model", name)
    return build(name) if is_derived(name, *_derivation(definition)) else None


def check_equations(definition: ModelDefinition, equations: Kernels) -> None:
    """Raise `InputError` if functions that were derived are missing or of another shape."""
    n, constraints = len(definition.coordinates), len(definition.constraints)
    needed: dict[str, tuple[int, ...]] = {"outputs": (len(definition.outputs),)}
    further: dict[str, tuple[int, ...]] = {}
    if definition.kind == "ae":
        needed |= {"residual": (n,), "residual_jacobian": (n, n + 1), "newton_step": (n,)}
        further = {"joints": (len(definition.joints), 3)}
    elif definition.kind == "structural":
        needed = {"port_forces": (len(definition.ports), 3)}
    else:
        needed |= {"derivative": (len(definition.states),)}
        further = {"second_order": (n, n + 1), "speeds": (n,), "violations": (constraints, 2)}
        further |= {"descriptor": (n + constraints, n + 1)}
    if definition.further_states:
        for function in {"second_order", "speeds"}.intersection(equations.shapes):
            raise InputError(f"model {definition.name!r} has further states, so no {function}")
    for function, shape in (needed | further).items():
        derived = equations.shapes.get(function)
        if derived is None and function in needed:
            raise InputError(f"model {definition.name!r}: its equations have no {function}")
        if derived not in (None, shape):
            raise InputError(
                f"model {definition.name!r}: {function} has shape {derived}, not {shape}"
            )


def compiled(definition: ModelDefinition) -> tuple[Kernels, str]:
    """Derivation of a model, and the hash of its source and of the loops that run it."""
    name, derive = definition.name, definition.derive
    with blamed(f"model {name!r}: its equations can't be derived", derive):
        equations = derivation(name, *_derivation(definition))
    text = f"{equations.source}\n{loops_digest(_class_of(definition.kind).loops)}"
    return equations, hashlib.sha256(text.encode()).hexdigest()[:16]


def _derivation(definition: ModelDefinition) -> tuple[Callable[[], Program], str]:
    """What derives a model with its choice of inputs, and the name of the choice."""
    derive, choice = definition.derive, definition.choice
    if choice == DEFAULTS:
        return derive, ""
    return partial(derive, choice), repr(choice)
