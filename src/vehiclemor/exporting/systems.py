"""What is exported: a system in straight-line functions, with names, units, values and starts.

It is that of a full or a reduced model.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib.metadata import version
from typing import Any, NamedTuple

import numpy as np

from vehiclemor.codegen.operations import Value, padded
from vehiclemor.exceptions import InputError
from vehiclemor.exporting.straight_line import SIGNATURES, Lines, StraightLine
from vehiclemor.multibody.quantities import Quantity
from vehiclemor.reduction.fallback import FallbackModel
from vehiclemor.reduction.methods.full_order import FullOrder
from vehiclemor.reduction.methods.path_map import PathMapModel, map_kernel
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.registry import choice
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.system import System

TOOL = f"vehiclemor {version('vehiclemor')}"
# Derivatives along seeds of the arguments: what the results change by.
SEED = "_seed"
TANGENTS = {}
for _name, (*_arguments, _result) in SIGNATURES.items():
    _seeds = [f"{argument}{SEED}" for argument in _arguments]
    TANGENTS[f"{_name}_tangent"] = (*_arguments, *_seeds, f"{_result}_change")
TRUST = Quantity("trust_indicator", "1", "how far it goes: beyond 1 the reduced model isn't known")
# From the design position; the suspension needs six where wheels and racks go.
STEPS = 7
CORRECTION = Quantity(
    "last_correction", "1", "largest of the last Newton step (rad or m): large where out of reach"
)


class CSettings(NamedTuple):
    """How a system is written: step size of its integrator in s, integrator and precision."""

    step: float
    integrator: str = "rk4"
    precision: str = "double"


@dataclass(frozen=True, eq=False, kw_only=True)
class ExportedSystem(ShortRepr):
    """A system x' = f(x, u, c(p)), y = g(x, u, c(p))."""

    repr_fields = ("name", "summary")

    # Of the model, or of the model and the method; one line.
    name: str
    summary: str
    inputs: tuple[Quantity, ...]
    outputs: tuple[Quantity, ...]
    # `constants` of the array `p`, `derivative` and `outputs` of the arrays `x`, `u` and `c`.
    functions: Mapping[str, StraightLine]
    # Gives the derivatives of these functions, by the same names, see `TANGENTS`.
    tangents: Callable[[], Mapping[str, StraightLine]]
    starts: Mapping[str, np.ndarray]  # Name -> state; the default first.
    states: tuple[Quantity, ...] = ()
    # Of a reduced model nothing is a parameter, its numbers are in the code.
    parameters: tuple[Quantity, ...] = ()
    values: np.ndarray = field(default_factory=lambda: np.zeros(0))  # Of the parameters.
    # Numbers that `entry(row, offset)` reads, at row + offset.
    table: np.ndarray = field(default_factory=lambda: np.zeros(0))
    # Has the Jacobian of an implicit step; none without states.
    dynamics: System | None = None

    def with_outputs(self, names: Sequence[str]) -> ExportedSystem:
        """The system with these outputs alone, in this order; `InputError` if it lacks one."""
        if not names:
            raise InputError("outputs are none: name one at least")
        numbers = {q.name: i for i, q in enumerate(self.outputs)}
        chosen = [numbers[choice("output", name, numbers)] for name in dict.fromkeys(names)]

        def selected(functions: Mapping[str, StraightLine]) -> dict[str, StraightLine]:
            operations, results = functions["outputs"]
            few = StraightLine(operations, [results[i] for i in chosen])
            return {**functions, "outputs": few}

        return replace(
            self,
            outputs=tuple(self.outputs[i] for i in chosen),
            functions=selected(self.functions),
            tangents=lambda: selected(self.tangents()),
        )

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
        results = [constants.results[index] for index in used]
        return StraightLine(constants.operations, results).read("p")


def exported_system(what: Any, name: str) -> ExportedSystem:
    """The system of a model, or of a fitted method, under a name.

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
            return reduced_system(what, name)
    raise InputError(f"{name} can't be exported: its equations are no straight-line program")


def full_system(model: DynamicModel, name: str) -> ExportedSystem:
    """A model with its parameters, among them those that it has solved for."""
    definition, sources = model.definition, model.equations.sources
    lines = Lines()
    arrays = full_arrays(lines, model) | {"_x": lines.entries("x", len(definition.states))}

    def tangents() -> dict[str, StraightLine]:
        changes = {}
        for function in SIGNATURES:
            seeds = seeds_of(lines, arrays)
            changes[function] = lines.derivative(sources[function], arrays, seeds)
        return lines.functions(changes)

    functions = {function: lines.include(sources[function], arrays) for function in SIGNATURES}
    return ExportedSystem(
        name=name,
        summary=model.summary,
        states=definition.state_quantities,
        inputs=definition.inputs,
        outputs=definition.outputs,
        parameters=parameter_quantities(model),
        values=model.parameter_values,
        starts=model.initial,
        functions=lines.functions(functions),
        tangents=tangents,
        dynamics=model.system,
    )


def mechanism_system(model: AlgebraicModel, name: str) -> ExportedSystem:
    """A kinematic model: outputs from inputs, without states."""
    definition, sources = model.definition, model.equations.sources
    lines = Lines()
    arrays = full_arrays(lines, model)
    q, correction = lines.numbers(model.start()), []
    for _ in range(STEPS):
        correction = lines.include(sources["newton_step"], arrays | {"_q": q})
        q = [coordinate - change for coordinate, change in zip(q, correction, strict=True)]
    solved = arrays | {"_q": q}
    outputs = lines.include(sources["outputs"], solved)

    def tangents() -> dict[str, StraightLine]:
        seeds = seeds_of(lines, arrays)
        # The residual is zero: the position changes by minus the change of the next step.
        step_changes = lines.derivative(sources["newton_step"], solved, seeds)
        q_changes = [-change for change in step_changes]
        outputs = lines.derivative(sources["outputs"], solved, seeds | {"_q": q_changes})
        constants = lines.derivative(sources["constants"], arrays, seeds)
        outputs.append(lines.number(0.0))
        return lines.functions({"constants": constants, "outputs": outputs})

    constants = lines.include(sources["constants"], arrays)
    outputs.append(lines.largest(correction))
    return ExportedSystem(
        name=name,
        summary=model.summary,
        inputs=definition.inputs,
        outputs=(*definition.outputs, CORRECTION),
        parameters=parameter_quantities(model),
        values=model.parameter_values,
        starts={model.starts[0]: np.zeros(0)},
        functions=lines.functions({"constants": constants, "outputs": outputs}),
        tangents=tangents,
    )


def full_arrays(lines: Lines, model: Model) -> dict[str, list[Value]]:
    """Arguments of a model's kernels, but for the state, in the entries of the exported arrays."""
    return {
        "_u": lines.entries("u", len(model.inputs)),
        "_constants": lines.entries("c", model.equations.constants),
        "_parameters": lines.entries("p", len(parameter_quantities(model))),
    }


def seeds_of(lines: Lines, arrays: Mapping[str, Sequence]) -> dict[str, list[Value]]:
    """Changes of the entries of arrays."""
    return {key: lines.entries(f"{key[1]}{SEED}", len(array)) for key, array in arrays.items()}


def parameter_quantities(model: Model) -> tuple[Quantity, ...]:
    """Components of the parameters, then lengths that were solved for, in the kernels' order."""
    quantities = []
    for name, entry in model.parameters.entries.items():
        size = model.definition.parameters[name].size
        names = [f"{name}.{axis}" for axis in "xyz"] if size > 1 else [name]
        quantities += [Quantity(component, entry.unit, entry.description) for component in names]
    quantities += [Quantity(name, "m", "set at rest") for name in model.definition.solved]
    return tuple(quantities)


def reduced_system(reduced: ReducedVehicle, name: str) -> ExportedSystem:
    """A reduced vehicle: its states are decoded, then the model's outputs follow from them.

    The decoder gives full states, and after them trust indicators.
    """
    model, system = reduced.model, reduced.system
    definition, full = model.definition, len(model.definition.states)
    lines = Lines()
    arrays = {
        "_x": lines.entries("x", len(reduced.states)),
        "_u": lines.entries("u", system.inputs),
    }
    rates, source = system.kernels.sources["derivative"], model.kernels.sources["outputs"]
    rate_arrays = arrays | {"_constants": lines.numbers(system.constants)}
    decoder, decoder_constants = reduced.decoder
    decoder_arrays = arrays | {"_constants": lines.numbers(decoder_constants)}
    decoded = lines.include(decoder, decoder_arrays)
    output_arrays = {
        "_x": decoded,
        "_u": arrays["_u"],
        "_constants": lines.numbers(model.constants),
    }
    outputs, trust = lines.include(source, output_arrays), decoded[full:]

    def tangents() -> dict[str, StraightLine]:
        seeds = seeds_of(lines, arrays)
        state_changes = lines.derivative(decoder, decoder_arrays, seeds)
        changes = lines.derivative(source, output_arrays, seeds | {"_x": state_changes})
        if trust:
            changes.append(lines.largest_derivative(trust, state_changes[full:]))
        rate_changes = lines.derivative(rates, rate_arrays, seeds)
        return lines.functions({"derivative": rate_changes, "outputs": changes})

    derivative = lines.include(rates, rate_arrays)
    quantities = definition.outputs
    if trust:
        outputs.append(lines.largest(trust))
        quantities = (*quantities, TRUST)
    of_model = {q.name: q for q in definition.state_quantities}
    states = [of_model.get(n, Quantity(n, "1", "reduced coordinate")) for n in reduced.states]
    at_rest = np.zeros(system.inputs)
    return ExportedSystem(
        name=name,
        summary=f"reduced model of: {model.summary}",
        states=tuple(states),
        inputs=definition.inputs,
        outputs=quantities,
        starts={key: reduced.begin(key, at_rest) for key in model.starts},
        functions=lines.functions({"derivative": derivative, "outputs": outputs}),
        tangents=tangents,
        dynamics=system,
    )


def map_system(reduced: PathMapModel, name: str) -> ExportedSystem:
    """Outputs as polynomials in cells of the inputs; a table has their coefficients."""
    definition, coefficients = reduced.model.definition, reduced.cells.coefficients
    columns = reduced.columns[len(definition.coordinates) :]
    exported, table_columns = np.unique(columns, return_inverse=True)
    table = np.zeros((*coefficients.shape[:2], padded(len(exported))))
    table[:, :, : len(exported)] = coefficients[:, :, exported]
    lines, size, n = Lines(), table[0].size, len(definition.inputs)
    in_cell, row, in_box = _cell(lines, reduced, size)
    kernel = map_kernel(reduced.moving, reduced.degree, tuple(table_columns.tolist()))
    arrays = {
        "_x": in_cell,
        "_coefficients": [lines.new("table", row, detail=offset) for offset in range(size)],
    }
    outputs = lines.include(kernel, arrays)

    def tangents() -> dict[str, StraightLine]:
        scales, halves = reduced.cells.scales, reduced.cells.halves
        seeds = lines.entries(f"u{SEED}", n)
        changes = [scale * seed for scale, seed in zip(scales.tolist(), seeds, strict=True)]
        steps = [2.0 * half * c for half, c in zip(halves.tolist(), changes, strict=True)]
        output_changes = lines.derivative(kernel, arrays, {"_x": steps})
        output_changes.append(lines.largest_derivative(in_box, changes))
        return lines.functions({"outputs": output_changes})

    return ExportedSystem(
        name=name,
        summary=f"reduced model of: {reduced.model.summary}",
        inputs=definition.inputs,
        outputs=(*definition.outputs, TRUST),
        starts={reduced.model.starts[0]: np.zeros(0)},
        functions=lines.functions({"outputs": [*outputs, lines.largest(in_box)]}),
        tangents=tangents,
        table=table.ravel(),
    )


def _cell(lines: Lines, reduced: PathMapModel, size: int) -> tuple[list[Value], Value, list[Value]]:
    """Inputs in their cell (-1 to 1), first coefficient of the cell, inputs in the box (-1 to 1).

    The same as `map_loops.map_path` computes for a sample.
    """
    in_cell, in_box, row, cells = [], [], lines.number(0.0), reduced.cells
    for i, u in enumerate(lines.entries("u", len(cells.centres))):
        numbers = (float(a[i]) for a in (cells.centres, cells.scales, cells.halves, cells.tops))
        centre, scale, half, top = numbers
        in_box.append((u - centre) * scale)
        position = (in_box[-1] + 1.0) * half
        cell = lines.new("min", lines.new("max", lines.new("floor", position), 0.0), top)
        in_cell.append(2.0 * (position - cell) - 1.0)
        row = row * float(cells.numbers[i]) + cell
    return in_cell, row * float(size), in_box
