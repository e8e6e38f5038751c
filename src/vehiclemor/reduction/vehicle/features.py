"""Features: functions of reduced coordinates and inputs, in which reduced equations are linear.

One text serves both sides: evaluated on arrays it makes the columns of a fit, and as a compiled
kernel it makes the right-hand side of the reduced vehicle

    z' = C_z phi(z, u),  psi' = C_r phi
    X' = U cos(psi) - V sin(psi),  Y' = U sin(psi) + V cos(psi),  (U, V) = C_UV phi

Coefficients are constants of the kernel: fits with the same features compile nothing new.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np

from vehiclemor.codegen.foreign_texts import MOST_CHARACTERS, MOST_SIZE, check_line
from vehiclemor.codegen.kernels import Kernels, kernel_sources
from vehiclemor.codegen.vector_lanes import padded
from vehiclemor.simulation.paths import along
from vehiclemor.simulation.system import System
from vehiclemor.sizes import apart, require

# After the reduced coordinates z come heading and place.
PLANAR = 3
# Reduced coordinates that a file may have; the models of this package have at most 9.
MOST_STATES = 100


@dataclass(frozen=True)
class Features:
    """Text of features of so many reduced coordinates `z0, z1, ...` and inputs `u0, u1, ...`.

    Attributes
    ----------
    lines
        Assignments `name = expression` of what the features share, in order; they may use
        parameters `p[i]`.
    terms
        Expression of each feature.
    groups
        (numbers of features, columns of C) of each block of C that is not zero; all if empty.
    watched
        (expression, what it is) of what tells how far a run goes: at a magnitude of 1 it leaves
        what the features were made for.
    lateral
        How many of these, the first ones, move when the vehicle is steered: how long they do
        counts too.
    """

    states: int
    inputs: int
    lines: tuple[tuple[str, str], ...]
    terms: tuple[str, ...]
    groups: tuple[tuple[tuple[int, ...], tuple[int, ...]], ...] = ()
    watched: tuple[tuple[str, str], ...] = ()
    lateral: int = 0

    def check_sizes(self) -> None:
        """Raise `ValueError` if the texts are more than arithmetic of what they are given."""
        needed_parameters(self)

    @property
    def blocks(self) -> tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]:
        """Blocks of C: numbers of features, columns."""
        everything = tuple(range(len(self.terms))), tuple(range(self.states + PLANAR))
        return self.groups or (everything,)


@lru_cache(maxsize=64)
def needed_parameters(features: Features) -> int:
    """Number of parameters that the texts need; `ValueError` if they reach into anything else."""
    states, inputs, columns = features.states, features.inputs, features.states + PLANAR
    require(0 < states <= MOST_STATES and 0 <= inputs <= MOST_STATES, "states")
    lines = [*features.lines, *(("term", text) for text in features.terms)]
    lines += [("watched", text) for text, _ in features.watched]
    require(sum(len(text) for _, text in lines) <= MOST_CHARACTERS, "features")
    known = {f"z{i}" for i in range(states)} | {f"u{i}" for i in range(inputs)}
    sizes, most = [], 0
    for number, (name, text) in enumerate(lines):
        size, needed = check_line(name, text, known)
        sizes.append(size)
        most = max(most, needed)
        if number < len(features.lines):
            known.add(name)
    own, total = sizes[len(features.lines) :], sum(sizes)
    require(len(features.groups) <= columns, "groups")
    for terms, targets in features.blocks:
        apart("groups", terms, len(features.terms))
        apart("groups", targets, columns)
        require(bool(terms and targets), "groups")
        total += sum(own[j] for j in terms) + len(terms) * padded(len(targets))
    require(total <= MOST_SIZE, "features")
    return most


def monomials(names: Sequence[str], degree: int) -> tuple[str, ...]:
    """All products of that many of the names."""
    return tuple(" * ".join(part) for part in combinations_with_replacement(names, degree))


def held(text: str) -> str:
    """Text of a value held in [-1, 1]: nothing is known of what lies beyond the training runs."""
    return f"0.5 * (abs({text} + 1.0) - abs({text} - 1.0))"


class Layout(NamedTuple):
    """Where the shape of a vehicle is kept in its states, place and heading, pairs that turn."""

    size: int
    kept: Sequence[int]
    planar: Sequence[int]
    pairs: Sequence[tuple[int, int]]


def rates_text(features: Features, parameters: int) -> str:
    """Source of the right-hand side; constants are that many parameters, then C."""
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


def feature_columns(
    features: Features, z: np.ndarray, u: np.ndarray, parameters: np.ndarray
) -> np.ndarray:
    """Features (samples, terms) of reduced coordinates (samples, states) and inputs."""
    sizes = features.states, features.inputs, len(features.terms)
    return along(_column_kernels(features), "columns", parameters, (z, u), sizes)


@cache
def _column_kernels(features: Features) -> Kernels:
    return Kernels(kernel_sources(columns_text(features)))


# A fit makes systems of the same features again and again.
@cache
def _kernels(features: Features, parameters: int) -> Kernels:
    return Kernels(kernel_sources(rates_text(features, parameters)))


def feature_system(
    features: Features,
    parameters: np.ndarray,
    coefficients: np.ndarray,
    error_scale: np.ndarray,
    reference: np.ndarray,
) -> System:
    """The reduced vehicle as the compiled loops take it, see `ReducedVehicle`.

    The Jacobian is frozen at the reference (states,).
    """
    blocks = [np.zeros((len(terms), padded(len(c)))) for terms, c in features.blocks]
    for block, (terms, columns) in zip(blocks, features.blocks, strict=True):
        block[:, : len(columns)] = coefficients[np.ix_(terms, columns)]
    constants = np.concatenate([parameters, *(block.ravel() for block in blocks)])
    dim = features.states + PLANAR
    return System(
        _kernels(features, len(parameters)),
        constants,
        features.inputs,
        np.concatenate([reference, np.zeros(PLANAR)]),
        error_scale,
        np.arange(dim - 2),
        np.zeros(0, dtype=np.int64),
    )
