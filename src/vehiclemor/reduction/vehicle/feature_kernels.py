"""Text of the kernels of a reduced vehicle: its right-hand side, and whole steps of two methods.

With a handful of states the loops of a general integrator take longer than the right-hand side, so
a step is straight-line code of its own: of the W-method, see `integrators/fused_ros34pw2`, and,
where the Jacobian has small diagonal blocks, of the exponential method, see
`integrators/fused_etdrk4`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vehiclemor.codegen.vector_lanes import padded
from vehiclemor.reduction.vehicle.features import PLANAR, Features
from vehiclemor.simulation.integrators import ros34pw2, tableaus
from vehiclemor.simulation.integrators.etdrk4 import ERROR_SHARE
from vehiclemor.simulation.integrators.exponential_functions import (
    AT_ZERO,
    FIRST,
    HALF_FIRST,
    HALF_SECOND,
    JACOBIAN,
    LAST,
    MIDDLE,
    SECOND,
)


class Layout(NamedTuple):
    """Where the shape of a vehicle stands in its states.

    Attributes
    ----------
    size
        Number of states.
    kept, planar, pairs
        Numbers of the states that make the shape, of the place and the heading, and of pairs that
        turn with the heading.
    """

    size: int
    kept: Sequence[int]
    planar: Sequence[int]
    pairs: Sequence[tuple[int, int]]


def diagonal_blocks(sizes: Sequence[int]) -> tuple[tuple[int, ...], ...]:
    """Numbers of the coordinates of blocks of these sizes."""
    ends = np.cumsum([0, *sizes]).tolist()
    return tuple(tuple(range(a, b)) for a, b in pairwise(ends))


def kernel_text(features: Features, parameters: int) -> str:
    """Source of the kernels; constants are the features' parameters, then C.

    Parameters
    ----------
    parameters
        Number of parameters.
    """
    k = features.states + PLANAR
    lines = [f"y{i} = _x[{i}]" for i in range(k)] + _inputs_at(features, 0)
    lines += _rates(features, "y", "", parameters)
    lines += [f"_result[{i}] = rate_{i}" for i in range(k)]
    kernels = [_function("derivative", lines), _w_step(features, parameters)]
    if features.diagonal:
        kernels.append(_exponential_step(features, parameters))
    return "\n".join(kernels)


def columns_text(features: Features) -> str:
    """Source of the kernel that evaluates the features; its constants are their parameters."""
    lines = [f"z{i} = _x[{i}]" for i in range(features.states)] + _inputs_at(features, 0)
    lines += [f"{name} = {_constants(text)}" for name, text in features.lines]
    lines += [f"_result[{i}] = {_constants(text)}" for i, text in enumerate(features.terms)]
    return _function("columns", lines)


def lifting_text(features: Features, layout: Layout, parameters: int, modes: int) -> str:
    """Source of the kernel that gives full states, and after them what is watched.

    Constants are the features' parameters, then rows of coefficients: of the terms, of the shape at
    straight running, and two of each mode of the transient, whose parts follow the inputs.
    """
    k, first = features.states, features.inputs
    lines = [f"z{i} = _x[{i}]" for i in range(k)] + _inputs_at(features, 0)
    lines += [f"{name} = {_constants(text)}" for name, text in features.lines]
    factors = [_constants(text) for text in features.terms]
    factors += ["1.0", *(f"_u[{first + i}]" for i in range(2 * modes))]
    names = ", ".join(f"s{i}" for i in layout.kept)
    lines.append(f"({names},) = weighted_sums(_constants, {parameters}, ({', '.join(factors)},))")
    lines.append(f"sine, cosine = sincos_one(_x[{k}])")
    results = dict.fromkeys(range(layout.size), "0.0") | {i: f"s{i}" for i in layout.kept}
    results |= zip(layout.planar, (f"_x[{i}]" for i in (k + 1, k + 2, k)), strict=True)
    for a, b in layout.pairs:
        results[a] = f"cosine * s{a} - sine * s{b}"
        results[b] = f"sine * s{a} + cosine * s{b}"
    results |= enumerate((_constants(text) for text, _ in features.watched), layout.size)
    lines += [f"_result[{i}] = {text}" for i, text in results.items()]
    return _function("full_state", lines)


def _inputs_at(features: Features, first: int) -> list[str]:
    return [f"u{i} = _u[{first + i}]" for i in range(features.inputs)]


def _rates(features: Features, state: str, mark: str, parameters: int) -> list[str]:
    """Assignments of `rate{mark}_i` for states named `{state}i` and inputs `u0, u1, ...`."""
    k = features.states
    body = [f"z{i} = {state}{i}" for i in range(k)]
    body += [f"{name} = {_constants(text)}" for name, text in features.lines]
    first = parameters
    sums: dict[int, list[str]] = {}
    for b, (terms, columns) in enumerate(features.blocks):
        names = ", ".join(f"t{b}_{i}" for i in columns)
        factors = ", ".join(_constants(features.terms[j]) for j in terms)
        body.append(f"({names},) = weighted_sums(_constants, {first}, ({factors},))")
        first += len(terms) * padded(len(columns))
        for i in columns:
            sums.setdefault(i, []).append(f"t{b}_{i}")
    totals = [" + ".join(sums.get(i, ["0.0"])) for i in range(k + PLANAR)]
    body += [f"rate{mark}_{i} = {totals[i]}" for i in range(k + 1)]
    body += [f"forward = {totals[k + 1]}", f"sideward = {totals[k + 2]}"]
    body += [f"sine, cosine = sincos_one({state}{k})"]
    body += [f"rate{mark}_{k + 1} = forward * cosine - sideward * sine"]
    body += [f"rate{mark}_{k + 2} = forward * sine + sideward * cosine"]
    return body


def _w_step(features: Features, parameters: int) -> str:
    """A whole step of the W-method without a loop, see `fused_ros34pw2`."""
    dim, tableau = features.states + PLANAR, tableaus.ros34pw2()
    a, gamma_c = tableau[:4], tableau[4:8]
    m, e = tableau[ros34pw2.M], tableau[ros34pw2.E]
    active = dim - 2
    lines = [f"y{i} = _x[{i}]" for i in range(dim)]
    lines += [f"rate0_{i} = _x[{dim + i}]" for i in range(dim)]
    lines += [f"h = _x[{2 * dim}]", f"scale = {ros34pw2.GAMMA!r} * h"]
    for stage in range(4):
        if stage:
            for i in range(dim):
                parts = [f"{float(a[stage, j])!r} * s{j}_{i}" for j in range(stage)]
                lines.append(f"m{i} = y{i} + {' + '.join(parts)}")
            lines += _inputs_at(features, (stage - 1) * features.inputs)
            lines += _rates(features, "m", str(stage), parameters)
        for i in range(dim):
            parts = [f"{float(gamma_c[stage, j])!r} * s{j}_{i}" for j in range(stage)]
            lines.append(f"b{i} = " + " + ".join([f"scale * rate{stage}_{i}", *parts]))
        names = ", ".join(f"v{i}" for i in range(dim))
        factors = ", ".join(f"b{i}" for i in range(active))
        lines.append(f"({names},) = weighted_sums(_x, {2 * dim + 1}, ({factors},))")
        # Nothing depends on the place: its columns of the inverse are the identity's.
        lines += [f"s{stage}_{i} = v{i}" for i in range(active)]
        lines += [f"s{stage}_{i} = v{i} + b{i}" for i in range(active, dim)]
    for i in range(dim):
        new = " + ".join(f"{float(m[j])!r} * s{j}_{i}" for j in range(4))
        error = " + ".join(f"{float(e[j])!r} * s{j}_{i}" for j in range(4))
        lines += [f"n{i} = y{i} + {new}", f"_result[{i}] = n{i}"]
        lines.append(f"_result[{dim + i}] = {error}")
    # The third stage was at the end of the step: its inputs serve.
    lines += _rates(features, "n", "", parameters)
    lines += [f"_result[{2 * dim + i}] = rate_{i}" for i in range(dim)]
    return _function("ros34pw2_step", lines)


def _exponential_step(features: Features, parameters: int) -> str:
    """A whole step of the exponential method without a loop, see `fused_etdrk4`."""
    dim = features.states + PLANAR
    blocks = diagonal_blocks(features.diagonal)
    entries = sum(len(block) ** 2 for block in blocks)
    place, first = {}, 4 * dim + 4
    for block in blocks:
        for i in block:
            for j in block:
                place[i, j] = first + len(place)

    def product(table: int, vector: str, i: int) -> str:
        """Entry i of a table's matrix times a vector named `{vector}j`."""
        row = [j for j in range(dim) if (i, j) in place]
        if not row:
            return f"{AT_ZERO[table]!r} * {vector}{i}"
        terms = [f"_x[{place[i, j] + table * entries}] * {vector}{j}" for j in row]
        return f"({' + '.join(terms)})"

    def rest(number: int, state: str, rates: str) -> list[str]:
        """D of a stage: what its rates have beyond the frozen Jacobian's."""
        lines = _rates(features, state, rates, parameters)
        for i in range(dim):
            change = f"rate{rates}_{i} - f{i}"
            linear = f" - {product(JACOBIAN, 'moved', i)}" if (i, i) in place else ""
            lines.append(f"d{number}_{i} = {change}{linear}")
        return lines

    names = ("y", "f", "y_before", "f_before")
    every = range(dim)
    lines = [f"{name}{i} = _x[{n * dim + i}]" for n, name in enumerate(names) for i in every]
    scalars = ("h", "at_past", "at_half", "at_end")
    lines += [f"{name} = _x[{4 * dim + n}]" for n, name in enumerate(scalars)]
    lines += [f"half{i} = h * {product(HALF_FIRST, 'f', i)}" for i in every]
    lines += [f"whole{i} = h * {product(FIRST, 'f', i)}" for i in every]
    lines += [f"moved{i} = half{i}" for i in every] + [f"m{i} = y{i} + moved{i}" for i in every]
    lines += _inputs_at(features, 0) + rest(2, "m", "2")
    lines += [f"moved{i} = half{i} + h * {product(HALF_SECOND, 'd2_', i)}" for i in every]
    lines += [f"m{i} = y{i} + moved{i}" for i in every] + rest(3, "m", "3")
    lines += [f"moved{i} = whole{i} + h * {product(SECOND, 'd3_', i)}" for i in every]
    lines += [f"m{i} = y{i} + moved{i}" for i in every]
    lines += _inputs_at(features, features.inputs) + rest(4, "m", "4")
    lines += [f"s{i} = d2_{i} + d3_{i}" for i in every]
    for i in every:
        lines.append(
            f"moved{i} = whole{i} + h * ({product(MIDDLE, 's', i)} + {product(LAST, 'd4_', i)})"
        )
    lines += [f"n{i} = y{i} + moved{i}" for i in every] + rest(5, "n", "5")
    lines += [f"_result[{i}] = n{i}" for i in every]
    lines += [f"_result[{dim + i}] = rate5_{i}" for i in every]
    for i in every:
        lines += [
            f"start = h * f{i}",
            f"finish = h * rate5_{i}",
            f"_result[{2 * dim + i}] = start",
            f"_result[{3 * dim + i}] = 3.0 * moved{i} - 2.0 * start - finish",
            f"_result[{4 * dim + i}] = start + finish - 2.0 * moved{i}",
        ]
    lines += [f"moved{i} = y{i} - y_before{i}" for i in every]
    for i in every:
        linear = f" - {product(JACOBIAN, 'moved', i)}" if (i, i) in place else ""
        past = f"at_past * (f{i} - f_before{i}{linear})"
        pair = f"{ERROR_SHARE!r} * (d5_{i} - d4_{i})"
        lines.append(f"q{i} = h * ({pair} + at_half * 0.5 * s{i} + at_end * d5_{i} + {past})")
    for i in every:
        # What the cubic between the ends of a step misses of linear motion.
        defect = f"half{i} - 0.5 * whole{i} + 0.125 * h * {product(JACOBIAN, 'whole', i)}"
        missed = f" + abs({defect})" if (i, i) in place else ""
        lines.append(f"_result[{5 * dim + i}] = abs({product(LAST, 'q', i)}){missed}")
    return _function("etdrk4_step", lines)


def _function(name: str, lines: Sequence[str]) -> str:
    body = "\n    ".join(lines)
    return f"def {name}(_x, _u, _constants, _work, _result):\n    {body}\n"


def _constants(text: str) -> str:
    return text.replace("p[", "_constants[")
