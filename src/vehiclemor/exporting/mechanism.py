"""A mechanism as a system to be exported: positions by a fixed number of Newton steps."""

from __future__ import annotations

import ast

import numpy as np

from vehiclemor.exporting.equations_of_motion import (
    full_arrays,
    parameter_quantities,
    seeds_of,
)
from vehiclemor.exporting.straight_line import (
    StraightLine,
    negative,
    numbers,
    straight_line,
    tangent_line,
)
from vehiclemor.exporting.system import ExportedSystem
from vehiclemor.exporting.trust import trust
from vehiclemor.multibody.quantities import Quantity
from vehiclemor.simulation.algebraic import AlgebraicModel

# From the design position; the suspension needs six where wheels and racks go.
STEPS = 7
CORRECTION = Quantity(
    "last_correction", "1", "largest of the last Newton step (rad or m): large where out of reach"
)


def mechanism_system(model: AlgebraicModel, name: str) -> ExportedSystem:
    """A kinematic model: outputs from inputs, without states."""
    definition, sources = model.definition, model.equations.sources
    given = full_arrays(model)
    seeds = seeds_of(given)
    line, correction = StraightLine({}, numbers(model.start())), StraightLine({}, [])
    for step in range(STEPS):
        arrays = given | {"_q": line.results}
        correction = straight_line(sources["newton_step"].text, arrays, line).named(f"step{step}")
        moved = [
            ast.BinOp(q, ast.Sub(), change)
            for q, change in zip(line.results, correction.results, strict=True)
        ]
        line = StraightLine(correction.assignments, moved).named(f"q{step}")
    solved = given | {"_q": line.results}
    outputs = straight_line(sources["outputs"].text, solved, line)

    def tangents() -> dict[str, StraightLine]:
        # The residual is zero: the position changes by minus what the next step does.
        falling = tangent_line(sources["newton_step"], solved, seeds, line)
        moved = [negative(change) for change in falling.results]
        change = StraightLine(falling.assignments, moved).named("moved")
        found = tangent_line(sources["outputs"], solved, seeds | {"_q": change.results}, change)
        return {
            "constants_tangent": tangent_line(sources["constants"], given, seeds).pruned(),
            "derivative_tangent": StraightLine({}, []),
            "outputs_tangent": found.followed_by([ast.Constant(0.0)]).pruned(),
        }

    return ExportedSystem(
        name,
        model.summary,
        (),
        definition.inputs,
        (*definition.outputs, CORRECTION),
        parameter_quantities(model),
        model.parameters.flat(),
        {model.starts[0]: np.zeros(0)},
        {
            "constants": straight_line(sources["constants"].text, given).pruned(),
            "derivative": StraightLine({}, []),
            "outputs": outputs.followed_by([trust(correction.results)]).pruned(),
        },
        tangents,
    )
