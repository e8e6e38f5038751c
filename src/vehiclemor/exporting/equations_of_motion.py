"""Dynamic models and reduced ones as systems to be exported."""

from __future__ import annotations

from functools import partial, reduce

import numpy as np

from vehiclemor.exporting.straight_line import StraightLine, call, entries, numbers, straight_line
from vehiclemor.exporting.system import TRUST, ExportedSystem
from vehiclemor.multibody.quantities import Quantity
from vehiclemor.reduction.reduced_system import ReducedSystem
from vehiclemor.simulation.constants import solved_parameters
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model


def full_system(model: DynamicModel, name: str) -> ExportedSystem:
    """A model with its parameters; among them is what it has solved for."""
    definition, equations = model.definition, model.equations
    sources = equations.sources
    quantities = parameter_quantities(model)
    flat = model.parameters.flat()
    solved = solved_parameters(definition, flat, equations)
    values = np.concatenate([flat, [solved[key] for key in definition.solved]])
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


def reduced_system(
    reduced: ReducedSystem, name: str, lift: tuple[str, np.ndarray]
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
    own = {"_x": entries("x", len(reduced.states)), "_u": inputs}
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
    known = {q.name: q for q in (*definition.coordinates, *definition.speeds)}
    nothing = np.zeros(system.inputs)
    return ExportedSystem(
        name,
        f"reduced model of: {model.summary}",
        tuple(known.get(n, Quantity(n, "1", "reduced coordinate")) for n in reduced.states),
        definition.inputs,
        (*definition.outputs, *([TRUST] if trust else [])),
        (),
        np.zeros(0),
        {key: reduced.begin(key, nothing) for key in model.starts},
        {
            "constants": StraightLine({}, []),
            "derivative": derivative.pruned(),
            "outputs": outputs.pruned(),
        },
    )
