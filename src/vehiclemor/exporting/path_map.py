"""A path map as a system to be exported: outputs from inputs, without states."""

from __future__ import annotations

import numpy as np

from vehiclemor.codegen.operations import Value
from vehiclemor.codegen.vector_lanes import padded
from vehiclemor.exporting.straight_line import Lines, StraightLine
from vehiclemor.exporting.system import SEED, TRUST, ExportedSystem
from vehiclemor.reduction.methods.path_map import PathMapModel, map_kernel


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
    outputs, nothing = lines.include(kernel, given), lines.function(())

    def tangents() -> dict[str, StraightLine]:
        scales, halves = reduced.cells.scales, reduced.cells.halves
        seeds = lines.entries(f"u{SEED}", n)
        changes = [scale * seed for scale, seed in zip(scales.tolist(), seeds, strict=True)]
        steps = [2.0 * half * c for half, c in zip(halves.tolist(), changes, strict=True)]
        found = lines.derivative(kernel, given, {"_x": steps})
        return {
            "constants_tangent": nothing,
            "derivative_tangent": nothing,
            "outputs_tangent": lines.function([*found, lines.largest_derivative(used, changes)]),
        }

    return ExportedSystem(
        name,
        f"reduced model of: {reduced.model.summary}",
        (),
        definition.inputs,
        (*definition.outputs, TRUST),
        (),
        np.zeros(0),
        {reduced.model.starts[0]: np.zeros(0)},
        {
            "constants": nothing,
            "derivative": nothing,
            "outputs": lines.function([*outputs, lines.largest(used)]),
        },
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
