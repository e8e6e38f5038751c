"""A path map as a system to be exported: outputs from inputs, without states."""

from __future__ import annotations

import ast

import numpy as np

from vehiclemor.codegen.kernels import kernel_sources
from vehiclemor.codegen.vector_lanes import padded
from vehiclemor.exporting.straight_line import (
    StraightLine,
    call,
    entries,
    straight_line,
    tangent_line,
)
from vehiclemor.exporting.system import SEED, TRUST, ExportedSystem
from vehiclemor.exporting.trust import trust, trust_tangent
from vehiclemor.reduction.methods.path_map import PathMapModel, map_kernel


def map_system(reduced: PathMapModel, name: str) -> ExportedSystem:
    """Outputs as polynomials in cells of the inputs; a table has their coefficients."""
    definition, coefficients = reduced.model.definition, reduced.cells.coefficients
    columns = reduced.columns[len(definition.coordinates) :]
    kept = sorted(set(columns))
    table = np.zeros((*coefficients.shape[:2], padded(len(kept))))
    table[:, :, : len(kept)] = coefficients[:, :, kept]
    size = table[0].size
    n = len(definition.inputs)
    before = straight_line(_cell_text(reduced, size), {"_u": entries("u", n)})
    places, row, used = before.results[:n], before.results[n], before.results[n + 1 :]
    (source,) = kernel_sources(
        map_kernel(reduced.moving, reduced.degree, tuple(kept.index(c) for c in columns))
    ).values()
    rows = [call("entry", row, ast.Constant(i)) for i in range(size)]
    given = {"_x": places, "_coefficients": rows}
    outputs = straight_line(source.text, given, before)

    def tangents() -> dict[str, StraightLine]:
        scales, halves = reduced.cells.scales, reduced.cells.halves
        seeds = entries(f"u{SEED}", n)
        moved = [_times(scale, seed) for scale, seed in zip(scales, seeds, strict=True)]
        steps = [_times(2.0 * half, step) for half, step in zip(halves, moved, strict=True)]
        found = tangent_line(source, given, {"_x": steps}, before)
        return {
            "constants_tangent": nothing,
            "derivative_tangent": nothing,
            "outputs_tangent": found.followed_by([trust_tangent(used, moved)]).pruned(),
        }

    nothing = StraightLine({}, [])
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
            "outputs": outputs.followed_by([trust(used)]).pruned(),
        },
        tangents,
        table.ravel(),
    )


def _times(factor: float, value: ast.expr) -> ast.expr:
    return ast.BinOp(ast.Constant(float(factor)), ast.Mult(), value)


def _cell_text(reduced: PathMapModel, size: int) -> str:
    """Kernel that gives places in a cell, where its coefficients begin, and places in the box.

    It does what `map_loops.map_path` does for a sample.
    """
    centres, scales, halves, tops, counts, _ = reduced.cells
    lines, row, n = [], "0.0", len(centres)
    for i in range(len(centres)):
        lines += [
            f"p{i} = (_u[{i}] - {float(centres[i])!r}) * {float(scales[i])!r}",
            f"q{i} = (p{i} + 1.0) * {float(halves[i])!r}",
            f"n{i} = min(max(np.floor(q{i}), 0.0), {float(tops[i])!r})",
            f"_result[{i}] = 2.0 * (q{i} - n{i}) - 1.0",
        ]
        row = f"({row} * {float(counts[i])!r} + n{i})"
        lines.append(f"_result[{n + 1 + i}] = p{i}")
    lines += [f"row = {row} * {float(size)!r}", f"_result[{n}] = row"]
    return "\n    ".join(["def cell(_u, _result):", *lines]) + "\n"
