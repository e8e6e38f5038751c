"""A path map as a system to be exported: outputs from inputs, without states."""

from __future__ import annotations

import ast

import numpy as np

from vehiclemor.codegen.vector_lanes import padded
from vehiclemor.exporting.straight_line import StraightLine, call, entries, straight_line
from vehiclemor.exporting.system import TRUST, ExportedSystem
from vehiclemor.reduction.methods.path_map import PathMapModel
from vehiclemor.reduction.polynomials.kernels import map_kernel


def map_system(reduced: PathMapModel, name: str) -> ExportedSystem:
    """Outputs as polynomials in cells of the inputs; a table has their coefficients."""
    definition, coefficients = reduced.model.definition, reduced.cells.coefficients
    columns = reduced.columns[len(definition.coordinates) :]
    used = sorted(set(columns))
    table = np.zeros((*coefficients.shape[:2], padded(len(used))))
    table[:, :, : len(used)] = coefficients[:, :, used]
    size = table[0].size
    inputs = {"_u": entries("u", len(definition.inputs))}
    before = straight_line(_cell_text(reduced, size), inputs)
    *places, row, indicator = before.results
    outputs = straight_line(
        map_kernel(reduced.moving, reduced.degree, tuple(used.index(c) for c in columns)),
        {
            "_x": places,
            "_coefficients": [call("entry", row, ast.Constant(i)) for i in range(size)],
        },
        before,
    )
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
            "outputs": StraightLine(outputs.assignments, [*outputs.results, indicator]).pruned(),
        },
        table.ravel(),
    )


def _cell_text(reduced: PathMapModel, size: int) -> str:
    """Kernel that gives the place in a cell (inputs,), where its coefficients begin, and the trust.

    It does what `map_loops.map_path` does for a sample.
    """
    centres, scales, halves, tops, counts, _ = reduced.cells
    lines, row, indicator = [], "0.0", "0.0"
    for i in range(len(centres)):
        lines += [
            f"p{i} = (_u[{i}] - {float(centres[i])!r}) * {float(scales[i])!r}",
            f"q{i} = (p{i} + 1.0) * {float(halves[i])!r}",
            f"n{i} = min(max(np.floor(q{i}), 0.0), {float(tops[i])!r})",
            f"_result[{i}] = 2.0 * (q{i} - n{i}) - 1.0",
        ]
        row = f"({row} * {float(counts[i])!r} + n{i})"
        indicator = f"max({indicator}, abs(p{i}))"
    n = len(centres)
    lines += [f"row = {row} * {float(size)!r}", f"indicator = {indicator}"]
    lines += [f"_result[{n}] = row", f"_result[{n + 1}] = indicator"]
    return "\n    ".join(["def cell(_u, _result):", *lines]) + "\n"
