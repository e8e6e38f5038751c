"""A mechanism as a system to be exported: positions by a fixed number of Newton steps."""

from __future__ import annotations

import numpy as np

from vehiclemor.exporting.equations_of_motion import (
    full_arrays,
    parameter_quantities,
    seeds_of,
)
from vehiclemor.exporting.straight_line import Lines, StraightLine
from vehiclemor.exporting.system import ExportedSystem
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
    lines = Lines()
    given, nothing = full_arrays(lines, model), lines.function(())
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
        return {
            "constants_tangent": lines.function(constants),
            "derivative_tangent": nothing,
            "outputs_tangent": lines.function([*found, *lines.numbers([0.0])]),
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
            "constants": lines.function(lines.include(sources["constants"], given)),
            "derivative": nothing,
            "outputs": lines.function([*outputs, lines.largest(correction)]),
        },
        tangents,
    )
