"""A path map as a system to be exported: outputs from inputs, without states."""

from __future__ import annotations

import numpy as np

from vehiclemor.codegen.kernels import kernel_sources
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
    (source,) = kernel_sources(
        map_kernel(reduced.moving, reduced.degree, tuple(kept.index(c) for c in columns))
    ).values()
    given = {
        "_x": places,
        "_coefficients": [lines.new("table", row, detail=place) for place in range(size)],
    }
    outputs, nothing = lines.include(source.text, given), lines.function(())

    def tangents() -> dict[str, StraightLine]:
        scales, halves = reduced.cells.scales, reduced.cells.halves
        seeds = lines.entries(f"u{SEED}", n)
        moved = [lines.new("multiply", *p) for p in zip(lines.numbers(scales), seeds, strict=True)]
        doubled = lines.numbers(2.0 * halves)
        steps = [lines.new("multiply", *pair) for pair in zip(doubled, moved, strict=True)]
        found = lines.tangent(source, given, {"_x": steps})
        return {
            "constants_tangent": nothing,
            "derivative_tangent": nothing,
            "outputs_tangent": lines.function([*found, lines.largest_tangent(used, moved)]),
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


def _cell(lines: Lines, reduced: PathMapModel, size: int) -> tuple[list[int], int, list[int]]:
    """Places in a cell, where its coefficients begin, and places in the box.

    It does what `map_loops.map_path` does for a sample.
    """
    new, (one, two, zero) = lines.new, lines.numbers([1.0, 2.0, 0.0])
    places, within, row = [], [], zero
    cells = reduced.cells
    for i, u in enumerate(lines.entries("u", len(cells.centres))):
        numbers = (a[i] for a in (cells.centres, cells.scales, cells.halves, cells.tops))
        centre, scale, half, top = lines.numbers(numbers)
        (count,) = lines.numbers([cells.numbers[i]])
        within.append(new("multiply", new("subtract", u, centre), scale))
        place = new("multiply", new("add", within[-1], one), half)
        cell = new("min", new("max", new("floor", place), zero), top)
        places.append(new("subtract", new("multiply", two, new("subtract", place, cell)), one))
        row = new("add", new("multiply", row, count), cell)
    return places, new("multiply", row, *lines.numbers([size])), within
