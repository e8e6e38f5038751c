"""What is exported: a system in straight-line functions, with names, units, values and starts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial, reduce
from typing import Any

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.export.straight_line import StraightLine, call, entries, numbers, straight_line
from vehiclemor.multibody.quantities import Quantity
from vehiclemor.reduction.methods.guarded import GuardedModel
from vehiclemor.reduction.reduced_system import ReducedSystem
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.build import declared_values, solved_parameters
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model

TRUST = Quantity("trust_indicator", "1", "how far it goes: beyond 1 the reduced model isn't known")


@dataclass(frozen=True, eq=False)
class ExportedSystem(ShortRepr):
    """A system x' = f(x, u, c(p)), y = g(x, u, c(p)).

    Attributes
    ----------
    name, summary
        Of the model, or of the model and the method; one line.
    states, inputs, outputs, parameters
        Quantities in order; of a reduced model nothing is a parameter, its numbers are in the code.
    values
        Of the parameters.
    starts
        Name -> state; the default first.
    functions
        `constants` of the array `p`, `derivative` and `outputs` of the arrays `x`, `u` and `c`.
    """

    repr_fields = ("name", "summary")

    name: str
    summary: str
    states: tuple[Quantity, ...]
    inputs: tuple[Quantity, ...]
    outputs: tuple[Quantity, ...]
    parameters: tuple[Quantity, ...]
    values: np.ndarray
    starts: Mapping[str, np.ndarray]
    functions: Mapping[str, StraightLine]

    @property
    def sizes(self) -> dict[str, int]:
        """Array -> number of floats."""
        constants = len(self.functions["constants"].results)
        counts = len(self.states), len(self.inputs), constants, len(self.parameters)
        return dict(zip("xucp", counts, strict=True))


def exported_system(what: Any, name: str) -> ExportedSystem:
    """The system of a model, or of what the fit of a method has given.

    Parameters
    ----------
    name
        What it is called.

    Raises
    ------
    InputError
        If it is no system of straight-line equations.
    """
    match what:
        case DynamicModel():
            return _full(what, name)
        case GuardedModel():
            return exported_system(what.fast, name)
        case ReducedVehicle():
            return _reduced(what.equations, name, vehicle_states(what), what.lift.text(0))
        case ReducedSystem() if what.spaces.formulation == "full":
            kernels, constants = what.system.kernels, what.system.constants
            text = kernels.sources["full_state"].text if "full_state" in kernels else ""
            return _reduced(what, name, _transformed_states(what), (text, constants))
    raise InputError(f"{name} can't be exported: its equations are no straight-line program")


def _full(model: DynamicModel, name: str) -> ExportedSystem:
    definition, equations = model.definition, model.equations
    sources = equations.sources
    quantities = parameter_quantities(model)
    declared = declared_values(definition, model.parameters)
    solved = solved_parameters(definition, declared, model.parameters, equations)
    values = np.concatenate([model.parameters.flat(), [solved[key] for key in definition.solved]])
    given = {
        "_x": entries("x", len(definition.states)),
        "_u": entries("u", len(definition.inputs)),
        "_constants": entries("c", equations.constants),
    }
    functions = {key: straight_line(sources[key].text, given) for key in ("derivative", "outputs")}
    functions["constants"] = straight_line(
        sources["constants"].text, {"_parameters": entries("p", len(quantities))}
    )
    return ExportedSystem(
        name,
        model.summary,
        (*definition.coordinates, *definition.speeds),
        definition.inputs,
        definition.outputs,
        quantities,
        values,
        model.initial,
        {key: function.pruned() for key, function in functions.items()},
    )


def parameter_quantities(model: Model) -> tuple[Quantity, ...]:
    """Components of the parameters and after them what was solved for, as the kernels take them."""
    found = []
    for name, entry in model.parameters.entries.items():
        size = model.definition.parameters[name].size
        names = [f"{name}.{axis}" for axis in "xyz"] if size > 1 else [name]
        found += [Quantity(component, entry.unit, entry.description) for component in names]
    return (*found, *(Quantity(name, "m", "set at rest") for name in model.definition.solved))


def _reduced(
    reduced: ReducedSystem, name: str, states: tuple[Quantity, ...], lift: tuple[str, np.ndarray]
) -> ExportedSystem:
    """A reduced system: its states are lifted, then the model's outputs follow from them.

    Parameters
    ----------
    lift
        Text and constants of the kernel that gives full states, and after them what is watched; the
        text is empty where the states are the model's.
    """
    model, system = reduced.model, reduced.system
    definition, full = model.definition, 2 * len(model.coordinates)
    inputs = entries("u", system.inputs)
    own = {"_x": entries("x", len(states)), "_u": inputs}
    derivative = straight_line(
        system.kernels.sources["derivative"].text, own | {"_constants": numbers(system.constants)}
    )
    lifted = StraightLine({}, own["_x"])
    if lift[0]:
        lifted = straight_line(lift[0], own | {"_constants": numbers(lift[1])})
    outputs = straight_line(
        model.kernels.sources["outputs"].text,
        {"_x": lifted.results, "_u": inputs, "_constants": numbers(model.constants)},
        lifted,
    )
    used = [call("fabs", size) for size in lifted.results[full:]]
    trust = [reduce(partial(call, "fmax"), used)] if used else []
    outputs = StraightLine(outputs.assignments, [*outputs.results, *trust])
    nothing = np.zeros(system.inputs)
    return ExportedSystem(
        name,
        f"reduced model of: {model.summary}",
        states,
        definition.inputs,
        (*definition.outputs, *([TRUST] if trust else [])),
        (),
        np.zeros(0),
        {key: reduced.encode(state, nothing) for key, state in model.initial.items()},
        {
            "constants": StraightLine({}, []),
            "derivative": derivative.pruned(),
            "outputs": outputs.pruned(),
        },
    )


def _transformed_states(reduced: ReducedSystem) -> tuple[Quantity, ...]:
    definition = reduced.model.definition
    own, count = (*definition.coordinates, *definition.speeds), len(reduced.system.reference)
    if len(own) == count:
        return own
    return tuple(Quantity(f"x{i}", "1", f"reduced state {i}") for i in range(count))


def vehicle_states(reduced: ReducedVehicle) -> tuple[Quantity, ...]:
    """Quantities of the states of a reduced vehicle."""
    definition = reduced.model.definition
    x, y, heading = (
        next(q for q in definition.coordinates if q.name == name) for name in definition.planar
    )
    count = reduced.features.states
    own = [Quantity(f"z{i}", "1", f"reduced coordinate {i}") for i in range(count)]
    return (*own, heading, x, y)
