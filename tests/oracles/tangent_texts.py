"""Texts of tangents run as they stand, where compiling them takes a quarter of a minute."""

from collections.abc import Sequence
from functools import cache

import numpy as np

from vehiclemor.codegen.kernels import KernelSource
from vehiclemor.codegen.tangent import Tangent
from vehiclemor.exporting.straight_line import FUNCTIONS, Lines, StraightLine, evaluated

NUMPY = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2"}
IN_NUMPY = {name: getattr(np, NUMPY.get(name, name)) for name in FUNCTIONS} | {"select": np.where}


@cache
def written_out(source: KernelSource) -> StraightLine:
    lines, pairs = Lines(), zip(source.arguments, source.sizes, strict=True)
    given = {name: lines.entries(name, size) for name, size in pairs}
    return lines.function(lines.include(source.text, given))


def run_as_text(tangent: Tangent, arrays: Sequence[np.ndarray], seeds: np.ndarray) -> np.ndarray:
    """What a tangent gives along all seeds at once, without machine code."""
    values = dict(zip(tangent.source.arguments, [*arrays, seeds.T], strict=False))
    results = evaluated(written_out(tangent.source), values, IN_NUMPY)
    return np.column_stack([np.broadcast_to(result, len(seeds)) for result in results])
