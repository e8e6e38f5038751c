"""Dynamic models and reduced ones as systems to be exported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from vehiclemor.codegen.operations import Kernel, Value
from vehiclemor.exporting.straight_line import Lines, StraightLine
from vehiclemor.exporting.system import SEED, SIGNATURES, TRUST, ExportedSystem
from vehiclemor.multibody.quantities import Quantity
from vehiclemor.reduction.reduced_system import ReducedSystem
from vehiclemor.simulation.constants import solved_parameters
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model


def full_system(model: DynamicModel, name: str) -> ExportedSystem:
    """A model with its parameters; among them is what it has solved for."""
    definition, sources = model.definition, model.equations.sources
    flat = model.parameters.flat()
    solved = solved_parameters(definition, flat, model.equations)
    lines = Lines()
    given = full_arrays(lines, model) | {"_x": lines.entries("x", len(definition.states))}
    return ExportedSystem(
        name,
        model.summary,
        (*definition.coordinates, *definition.speeds),
        definition.inputs,
        definition.outputs,
        parameter_quantities(model),
        np.concatenate([flat, [solved[key] for key in definition.solved]]),
        model.initial,
        {key: lines.function(lines.include(sources[key], given)) for key in SIGNATURES},
        lambda: {
            f"{key}_tangent": lines.function(
                lines.derivative(sources[key], given, seeds_of(lines, given))
            )
            for key in SIGNATURES
        },
    )


def full_arrays(lines: Lines, model: Model) -> dict[str, list[Value]]:
    """Arguments of a model's kernels, but for the state, in the entries of the exported arrays."""
    return {
        "_u": lines.entries("u", len(model.inputs)),
        "_constants": lines.entries("c", model.equations.constants),
        "_parameters": lines.entries("p", len(parameter_quantities(model))),
    }


def seeds_of(lines: Lines, arrays: Mapping[str, Sequence]) -> dict[str, list[Value]]:
    """What the entries of arrays change by."""
    return {key: lines.entries(f"{key[1]}{SEED}", len(listed)) for key, listed in arrays.items()}


def parameter_quantities(model: Model) -> tuple[Quantity, ...]:
    """Components of the parameters and after them what was solved for, as the kernels take them."""
    found = []
    for name, entry in model.parameters.entries.items():
        size = model.definition.parameters[name].size
        names = [f"{name}.{axis}" for axis in "xyz"] if size > 1 else [name]
        found += [Quantity(component, entry.unit, entry.description) for component in names]
    return (*found, *(Quantity(name, "m", "set at rest") for name in model.definition.solved))


def reduced_system(
    reduced: ReducedSystem, name: str, lift: tuple[Kernel, np.ndarray] | None
) -> ExportedSystem:
    """A reduced system: its states are lifted, then the model's outputs follow from them.

    Parameters
    ----------
    lift
        The kernel that gives full states, and after them what is watched, with its constants; none
        where the states are the model's.
    """
    model, system = reduced.model, reduced.system
    definition, full = model.definition, 2 * len(model.coordinates)
    lines = Lines()
    own = {
        "_x": lines.entries("x", len(reduced.states)),
        "_u": lines.entries("u", system.inputs),
    }
    rates, source = system.kernels.sources["derivative"], model.kernels.sources["outputs"]
    of_rates = own | {"_constants": lines.numbers(system.constants)}
    lifted, of_lift = own["_x"], own
    if lift is not None:
        of_lift = own | {"_constants": lines.numbers(lift[1])}
        lifted = lines.include(lift[0], of_lift)
    given = {"_x": lifted, "_u": own["_u"], "_constants": lines.numbers(model.constants)}
    outputs, used = lines.include(source, given), lifted[full:]
    nothing = lines.function(())

    def tangents() -> dict[str, StraightLine]:
        seeds = seeds_of(lines, own)
        moved = seeds["_x"] if lift is None else lines.derivative(lift[0], of_lift, seeds)
        found = lines.derivative(source, given, seeds | {"_x": moved})
        further = [lines.largest_derivative(used, moved[full:])] if used else []
        return {
            "constants_tangent": nothing,
            "derivative_tangent": lines.function(lines.derivative(rates, of_rates, seeds)),
            "outputs_tangent": lines.function([*found, *further]),
        }

    known = {q.name: q for q in (*definition.coordinates, *definition.speeds)}
    at_rest = np.zeros(system.inputs)
    return ExportedSystem(
        name,
        f"reduced model of: {model.summary}",
        tuple(known.get(n, Quantity(n, "1", "reduced coordinate")) for n in reduced.states),
        definition.inputs,
        (*definition.outputs, *([TRUST] if used else [])),
        (),
        np.zeros(0),
        {key: reduced.begin(key, at_rest) for key in model.starts},
        {
            "constants": nothing,
            "derivative": lines.function(lines.include(rates, of_rates)),
            "outputs": lines.function([*outputs, *([lines.largest(used)] if used else [])]),
        },
        tangents,
    )
