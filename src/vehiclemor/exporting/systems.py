"""What is exported: a system in straight-line functions, with names, units, values and starts.

It is that of a model, or of what a method has made of one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import version
from typing import Any

import numpy as np

from vehiclemor.codegen.operations import Kernel, Value
from vehiclemor.codegen.vector_lanes import padded
from vehiclemor.exceptions import InputError
from vehiclemor.exporting.straight_line import Lines, StraightLine
from vehiclemor.multibody.quantities import Quantity
from vehiclemor.reduction.fallback import FallbackModel
from vehiclemor.reduction.methods.full_order import FullOrder
from vehiclemor.reduction.methods.path_map import PathMapModel, map_kernel
from vehiclemor.reduction.reduced_system import ReducedSystem
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model

# Who has written it.
TOOL = f"vehiclemor {version('vehiclemor')}"
# Function -> names of its arguments, in order, and of its result.
SIGNATURES = {
    "constants": ("p", "c"),
    "derivative": ("x", "u", "c", "dx"),
    "outputs": ("x", "u", "c", "y"),
}
# Derivatives along seeds of the arguments: what the results change by.
SEED = "_seed"
TANGENTS = {
    f"{name}_tangent": (*given, *(f"{argument}{SEED}" for argument in given), f"{result}_change")
    for name, (*given, result) in SIGNATURES.items()
}
TRUST = Quantity("trust_indicator", "1", "how far it goes: beyond 1 the reduced model isn't known")
# From the design position; the suspension needs six where wheels and racks go.
STEPS = 7
CORRECTION = Quantity(
    "last_correction", "1", "largest of the last Newton step (rad or m): large where out of reach"
)


@dataclass(frozen=True, eq=False)
class ExportedSystem(ShortRepr):
    """A system x' = f(x, u, c(p)), y = g(x, u, c(p))."""

    repr_fields = ("name", "summary")

    # Of the model, or of the model and the method; one line.
    name: str
    summary: str
    # Quantities in order; of a reduced model nothing is a parameter, its numbers are in the code.
    states: tuple[Quantity, ...]
    inputs: tuple[Quantity, ...]
    outputs: tuple[Quantity, ...]
    parameters: tuple[Quantity, ...]
    values: np.ndarray  # Of the parameters.
    starts: Mapping[str, np.ndarray]  # Name -> state; the default first.
    # `constants` of the array `p`, `derivative` and `outputs` of the arrays `x`, `u` and `c`.
    functions: Mapping[str, StraightLine]
    # Makes the derivatives of these functions, by the same names, see `TANGENTS`.
    tangents: Callable[[], Mapping[str, StraightLine]]
    # What `entry(row, place)` reads, a number at row + place; empty if there is none.
    table: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def sizes(self) -> dict[str, int]:
        """Array -> number of floats."""
        constants = len(self.functions["constants"].results)
        counts = len(self.states), len(self.inputs), constants, len(self.parameters)
        return dict(zip("xucp", counts, strict=True))

    @cached_property
    def acting(self) -> set[int]:
        """Numbers of the parameters that rates or outputs depend on; others shape the start."""
        constants, rates, outputs = (self.functions[name] for name in SIGNATURES)
        used = sorted(rates.read("c") | outputs.read("c"))
        of_these = [constants.results[place] for place in used]
        return StraightLine(constants.operations, of_these).read("p")


def exported_system(what: Any, name: str) -> ExportedSystem:
    """The system, called so, of a model or of what the fit of a method has given.

    `InputError` if it is no system of straight-line equations.
    """
    match what:
        case DynamicModel():
            return full_system(what, name)
        case AlgebraicModel():
            return mechanism_system(what, name)
        case FullOrder():
            return exported_system(what.model, name)
        case FallbackModel():
            return exported_system(what.reduced, name)
        case PathMapModel():
            return map_system(what, name)
        case ReducedVehicle():
            return reduced_system(what, name, what.decoder.kernel(0))
        case ReducedSystem() if what.spaces.formulation == "full":
            if what.states == what.model.definition.states:
                return reduced_system(what, name, None)
    raise InputError(f"{name} can't be exported: its equations are no straight-line program")


def full_system(model: DynamicModel, name: str) -> ExportedSystem:
    """A model with its parameters; among them is what it has solved for."""
    definition, sources = model.definition, model.equations.sources
    lines = Lines()
    given = full_arrays(lines, model) | {"_x": lines.entries("x", len(definition.states))}
    return ExportedSystem(
        name,
        model.summary,
        (*definition.coordinates, *definition.speeds),
        definition.inputs,
        definition.outputs,
        parameter_quantities(model),
        model.parameter_values,
        model.initial,
        lines.functions({key: lines.include(sources[key], given) for key in SIGNATURES}),
        lambda: lines.functions(
            {
                key: lines.derivative(sources[key], given, seeds_of(lines, given))
                for key in SIGNATURES
            }
        ),
    )


def mechanism_system(model: AlgebraicModel, name: str) -> ExportedSystem:
    """A kinematic model: outputs from inputs, without states."""
    definition, sources = model.definition, model.equations.sources
    lines = Lines()
    given = full_arrays(lines, model)
    q, correction = lines.numbers(model.start()), []
    for _ in range(STEPS):
        correction = lines.include(sources["newton_step"], given | {"_q": q})
        q = [place - change for place, change in zip(q, correction, strict=True)]
    solved = given | {"_q": q}
    outputs = lines.include(sources["outputs"], solved)

    def tangents() -> dict[str, StraightLine]:
        seeds = seeds_of(lines, given)
        # The residual is zero: the position changes by minus what the next step does.
        falling = lines.derivative(sources["newton_step"], solved, seeds)
        moved = [-change for change in falling]
        found = lines.derivative(sources["outputs"], solved, seeds | {"_q": moved})
        constants = lines.derivative(sources["constants"], given, seeds)
        return lines.functions({"constants": constants, "outputs": [*found, *lines.numbers([0.0])]})

    return ExportedSystem(
        name,
        model.summary,
        (),
        definition.inputs,
        (*definition.outputs, CORRECTION),
        parameter_quantities(model),
        model.parameter_values,
        {model.starts[0]: np.zeros(0)},
        lines.functions(
            {
                "constants": lines.include(sources["constants"], given),
                "outputs": [*outputs, lines.largest(correction)],
            }
        ),
        tangents,
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
    reduced: ReducedSystem, name: str, decoder: tuple[Kernel, np.ndarray] | None
) -> ExportedSystem:
    """A reduced system: its states are decoded, then the model's outputs follow from them.

    The decoder is the kernel that gives full states, and after them what is watched, with its
    constants; none where the states are the model's.
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
    decoded, of_decoder = own["_x"], own
    if decoder is not None:
        of_decoder = own | {"_constants": lines.numbers(decoder[1])}
        decoded = lines.include(decoder[0], of_decoder)
    given = {"_x": decoded, "_u": own["_u"], "_constants": lines.numbers(model.constants)}
    outputs, used = lines.include(source, given), decoded[full:]

    def tangents() -> dict[str, StraightLine]:
        seeds = seeds_of(lines, own)
        moved = seeds["_x"] if decoder is None else lines.derivative(decoder[0], of_decoder, seeds)
        found = lines.derivative(source, given, seeds | {"_x": moved})
        further = [lines.largest_derivative(used, moved[full:])] if used else []
        rising = lines.derivative(rates, of_rates, seeds)
        return lines.functions({"derivative": rising, "outputs": [*found, *further]})

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
        lines.functions(
            {
                "derivative": lines.include(rates, of_rates),
                "outputs": [*outputs, *([lines.largest(used)] if used else [])],
            }
        ),
        tangents,
    )


def map_system(reduced: PathMapModel, name: str) -> ExportedSystem:
    """Outputs as polynomials in cells of the inputs; a table has their coefficients."""
    definition, coefficients = reduced.model.definition, reduced.cells.coefficients
    columns = reduced.columns[len(definition.coordinates) :]
    kept = sorted(set(columns))
    table = np.zeros((*coefficients.shape[:2], padded(len(kept))))
    table[:, :, : len(kept)] = coefficients[:, :, kept]
    lines, size, n = Lines(), table[0].size, len(definition.inputs)
    places, row, used = _cell(lines, reduced, size)
    own = tuple(kept.index(column) for column in columns)
    kernel = map_kernel(reduced.moving, reduced.degree, own)
    given = {
        "_x": places,
        "_coefficients": [lines.new("table", row, detail=place) for place in range(size)],
    }
    outputs = lines.include(kernel, given)

    def tangents() -> dict[str, StraightLine]:
        scales, halves = reduced.cells.scales, reduced.cells.halves
        seeds = lines.entries(f"u{SEED}", n)
        changes = [scale * seed for scale, seed in zip(scales.tolist(), seeds, strict=True)]
        steps = [2.0 * half * c for half, c in zip(halves.tolist(), changes, strict=True)]
        found = lines.derivative(kernel, given, {"_x": steps})
        return lines.functions({"outputs": [*found, lines.largest_derivative(used, changes)]})

    return ExportedSystem(
        name,
        f"reduced model of: {reduced.model.summary}",
        (),
        definition.inputs,
        (*definition.outputs, TRUST),
        (),
        np.zeros(0),
        {reduced.model.starts[0]: np.zeros(0)},
        lines.functions({"outputs": [*outputs, lines.largest(used)]}),
        tangents,
        table.ravel(),
    )


def _cell(lines: Lines, reduced: PathMapModel, size: int) -> tuple[list[Value], Value, list[Value]]:
    """Places in a cell, where its coefficients begin, and places in the box.

    It does what `map_loops.map_path` does for a sample.
    """
    places, within, row, cells = [], [], lines.number(0.0), reduced.cells
    for i, u in enumerate(lines.entries("u", len(cells.centres))):
        numbers = (float(a[i]) for a in (cells.centres, cells.scales, cells.halves, cells.tops))
        centre, scale, half, top = numbers
        within.append((u - centre) * scale)
        place = (within[-1] + 1.0) * half
        cell = lines.new("min", lines.new("max", lines.new("floor", place), 0.0), top)
        places.append(2.0 * (place - cell) - 1.0)
        row = row * float(cells.numbers[i]) + cell
    return places, row * float(size), within
