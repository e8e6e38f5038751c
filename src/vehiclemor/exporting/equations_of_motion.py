"""Dynamic models and reduced ones as systems to be exported."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence

import numpy as np

from vehiclemor.codegen.kernels import KernelSource
from vehiclemor.exporting.straight_line import (
    StraightLine,
    entries,
    numbers,
    straight_line,
    tangent_line,
)
from vehiclemor.exporting.system import SEED, SIGNATURES, TRUST, ExportedSystem
from vehiclemor.exporting.trust import trust, trust_tangent
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
    given = full_arrays(model) | {"_x": entries("x", len(definition.states))}
    seeds = seeds_of(given)
    return ExportedSystem(
        name,
        model.summary,
        (*definition.coordinates, *definition.speeds),
        definition.inputs,
        definition.outputs,
        parameter_quantities(model),
        np.concatenate([flat, [solved[key] for key in definition.solved]]),
        model.initial,
        {key: straight_line(sources[key].text, given).pruned() for key in SIGNATURES},
        lambda: {
            f"{key}_tangent": tangent_line(sources[key], given, seeds).pruned()
            for key in SIGNATURES
        },
    )


def full_arrays(model: Model) -> dict[str, list[ast.expr]]:
    """Arguments of a model's kernels, but for the state, in the entries of the exported arrays."""
    return {
        "_u": entries("u", len(model.inputs)),
        "_constants": entries("c", model.equations.constants),
        "_parameters": entries("p", len(parameter_quantities(model))),
    }


def seeds_of(arrays: Mapping[str, Sequence[ast.expr]]) -> dict[str, list[ast.expr]]:
    """What the entries of arrays change by."""
    return {key: entries(f"{key[1]}{SEED}", len(listed)) for key, listed in arrays.items()}


def parameter_quantities(model: Model) -> tuple[Quantity, ...]:
    """Components of the parameters and after them what was solved for, as the kernels take them."""
    found = []
    for name, entry in model.parameters.entries.items():
        size = model.definition.parameters[name].size
        names = [f"{name}.{axis}" for axis in "xyz"] if size > 1 else [name]
        found += [Quantity(component, entry.unit, entry.description) for component in names]
    return (*found, *(Quantity(name, "m", "set at rest") for name in model.definition.solved))


def reduced_system(
    reduced: ReducedSystem, name: str, lift: tuple[KernelSource, np.ndarray] | None
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
    own = {"_x": entries("x", len(reduced.states)), "_u": entries("u", system.inputs)}
    seeds = seeds_of(own)
    rates = system.kernels.sources["derivative"]
    of_rates = own | {"_constants": numbers(system.constants)}
    source = model.kernels.sources["outputs"]
    lifted = StraightLine({}, own["_x"])
    if lift is not None:
        lifted = straight_line(lift[0].text, own | {"_constants": numbers(lift[1])}).named("full")
    given = {"_x": lifted.results, "_u": own["_u"], "_constants": numbers(model.constants)}
    outputs = straight_line(source.text, given, lifted)
    used = lifted.results[full:]

    def tangents() -> dict[str, StraightLine]:
        moved = StraightLine(lifted.assignments, seeds["_x"])
        if lift is not None:
            of_lift = own | {"_constants": numbers(lift[1])}
            moved = tangent_line(lift[0], of_lift, seeds, lifted).named("moved")
        found = tangent_line(source, given, seeds | {"_x": moved.results}, moved)
        further = [trust_tangent(used, moved.results[full:])] if used else []
        return {
            "constants_tangent": StraightLine({}, []),
            "derivative_tangent": tangent_line(rates, of_rates, seeds).pruned(),
            "outputs_tangent": found.followed_by(further).pruned(),
        }

    known = {q.name: q for q in (*definition.coordinates, *definition.speeds)}
    nothing = np.zeros(system.inputs)
    return ExportedSystem(
        name,
        f"reduced model of: {model.summary}",
        tuple(known.get(n, Quantity(n, "1", "reduced coordinate")) for n in reduced.states),
        definition.inputs,
        (*definition.outputs, *([TRUST] if used else [])),
        (),
        np.zeros(0),
        {key: reduced.begin(key, nothing) for key in model.starts},
        {
            "constants": StraightLine({}, []),
            "derivative": straight_line(rates.text, of_rates).pruned(),
            "outputs": outputs.followed_by([trust(used)] if used else []).pruned(),
        },
        tangents,
    )
