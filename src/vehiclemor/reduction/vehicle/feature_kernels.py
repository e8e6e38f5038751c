"""Text of the kernels of a reduced vehicle: right-hand side, features, lifting."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from vehiclemor.codegen.vector_lanes import padded
from vehiclemor.reduction.vehicle.features import PLANAR, Features


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


def rates_text(features: Features, parameters: int) -> str:
    """Source of the right-hand side; constants are the features' parameters, then C.

    Parameters
    ----------
    parameters
        Number of parameters.
    """
    k, first = features.states, parameters
    lines = _coordinates(features)
    lines += [f"{name} = {_constants(text)}" for name, text in features.lines]
    sums: dict[int, list[str]] = {}
    for b, (terms, columns) in enumerate(features.blocks):
        names = ", ".join(f"t{b}_{i}" for i in columns)
        factors = ", ".join(_constants(features.terms[j]) for j in terms)
        lines.append(f"({names},) = weighted_sums(_constants, {first}, ({factors},))")
        first += len(terms) * padded(len(columns))
        for i in columns:
            sums.setdefault(i, []).append(f"t{b}_{i}")
    totals = [" + ".join(sums.get(i, ["0.0"])) for i in range(k + PLANAR)]
    lines += [f"forward = {totals[k + 1]}", f"sideward = {totals[k + 2]}"]
    lines.append(f"sine, cosine = sincos_one(_x[{k}])")
    lines += [f"_result[{i}] = {totals[i]}" for i in range(k + 1)]
    lines.append(f"_result[{k + 1}] = forward * cosine - sideward * sine")
    lines.append(f"_result[{k + 2}] = forward * sine + sideward * cosine")
    return _function("derivative", lines)


def columns_text(features: Features) -> str:
    """Source of the kernel that evaluates the features; its constants are their parameters."""
    lines = _coordinates(features)
    lines += [f"{name} = {_constants(text)}" for name, text in features.lines]
    lines += [f"_result[{i}] = {_constants(text)}" for i, text in enumerate(features.terms)]
    return _function("columns", lines)


def lifting_text(features: Features, layout: Layout, parameters: int, modes: int) -> str:
    """Source of the kernel that gives full states, and after them what is watched.

    Constants are the features' parameters, then rows of coefficients: of the terms, of the shape at
    straight running, and two of each mode of the transient, whose parts follow the inputs.
    """
    k, first = features.states, features.inputs
    lines = _coordinates(features)
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


def _coordinates(features: Features) -> list[str]:
    coordinates = [f"z{i} = _x[{i}]" for i in range(features.states)]
    return coordinates + [f"u{i} = _u[{i}]" for i in range(features.inputs)]


def _function(name: str, lines: Sequence[str]) -> str:
    body = "\n    ".join(lines)
    return f"def {name}(_x, _u, _constants, _work, _result):\n    {body}\n"


def _constants(text: str) -> str:
    return text.replace("p[", "_constants[")
