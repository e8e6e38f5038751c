"""Dynamic models and reduced ones as systems to be exported."""

from __future__ import annotations

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
        "_parameters": entries("p", len(quantities)),
    }

    def tangents() -> dict[str, StraightLine]:
        seeds = {name: entries(f"{name[1:2]}{SEED}", len(own)) for name, own in given.items()}
        return {f"{k}_tangent": tangent_line(sources[k], given, seeds).pruned() for k in SIGNATURES}

    return ExportedSystem(
        name,
        model.summary,
        (*definition.coordinates, *definition.speeds),
        definition.inputs,
        definition.outputs,
        quantities,
        values,
        model.initial,
        {key: straight_line(sources[key].text, given).pruned() for key in SIGNATURES},
        tangents,
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
    seeds = {key: entries(f"{key[1:]}{SEED}", len(listed)) for key, listed in own.items()}
    rates = system.kernels.sources["derivative"], own | {"_constants": numbers(system.constants)}
    derivative = straight_line(rates[0].text, rates[1])
    source = model.kernels.sources["outputs"]
    lifted = StraightLine({}, own["_x"])
    if lift is not None:
        lifting = lift[0], own | {"_constants": numbers(lift[1])}
        lifted = straight_line(lifting[0].text, lifting[1])
    given = {"_x": lifted.results, "_u": own["_u"], "_constants": numbers(model.constants)}
    outputs = straight_line(source.text, given, lifted)
    used = lifted.results[full:]

    def tangents() -> dict[str, StraightLine]:
        moved = StraightLine(lifted.assignments, seeds["_x"])
        if lift is not None:
            moved = tangent_line(*lifting, seeds, lifted)
        found = tangent_line(source, given, seeds | {"_x": moved.results}, moved)
        further = [trust_tangent(used, moved.results[full:])] if used else []
        return {
            "constants_tangent": StraightLine({}, []),
            "derivative_tangent": tangent_line(*rates, seeds).pruned(),
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
            "derivative": derivative.pruned(),
            "outputs": outputs.followed_by([trust(used)] if used else []).pruned(),
        },
        tangents,
    )
