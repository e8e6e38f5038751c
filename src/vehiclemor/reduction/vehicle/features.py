"""Features: functions of reduced coordinates and inputs, in which reduced equations are linear.

The same operations serve both sides: evaluated on arrays they make the columns of a fit, and as a
compiled kernel the right-hand side of the reduced vehicle

    z' = C_z phi(z, u),  psi' = C_r phi
    X' = U cos(psi) - V sin(psi),  Y' = U sin(psi) + V cos(psi),  (U, V) = C_UV phi

Coefficients are constants of the kernel: fits with the same features compile nothing new.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache, reduce
from operator import mul
from typing import Any

import numpy as np

from vehiclemor.arguments import check_distinct_indices, require
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.operations import (
    COMPARISONS,
    FUNCTIONS,
    MOST_SIZE,
    WIDTH,
    Kernel,
    Listing,
    Operation,
    Value,
    padded,
    pruned,
)
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.simulation.evaluation import at_samples
from vehiclemor.simulation.system import System

# After the reduced coordinates z come heading and position.
PLANAR = 3
# Reduced coordinates that a file may have; the models of this package have at most 9.
MOST_STATES = 100
# What an elementary function counts, in operations: chains of them take longest to compile.
CALL = 160
ARGUMENTS = ("_x", "_u", "_constants", "_result")
# Factors of a product, in order.
Term = tuple[Value, ...]


@dataclass(frozen=True)
class Features:
    """Features of so many reduced coordinates z and inputs u, and of parameters p."""

    states: int
    inputs: int
    # All that they are computed by, from entries of `_x` (z), `_u` and `_constants` (p).
    operations: tuple[Operation, ...]
    named: tuple[int, ...]  # Numbers of the operations with names, see `operations`.
    terms: tuple[int, ...]  # Number of the operation that gives each feature.
    # (numbers of features, columns of C) of each block of C that is not zero.
    groups: tuple[tuple[tuple[int, ...], tuple[int, ...]], ...] = ()
    # (operation, what it is) of what tells how far a run goes: at a magnitude of 1 it leaves
    # the training range.
    watched: tuple[tuple[int, str], ...] = ()

    def check_sizes(self) -> None:
        """Raise `ValueError` if the operations are more than arithmetic of what they are given."""
        needed_parameters(self)


@lru_cache(maxsize=64)
def needed_parameters(features: Features) -> int:
    """Number of parameters that they need; `ValueError` if they reach into anything else."""
    states, inputs, columns = features.states, features.inputs, features.states + PLANAR
    require(0 < states <= MOST_STATES and 0 <= inputs <= MOST_STATES, "states")
    operations, reach = features.operations, {"_x": 0, "_u": 0, "_constants": 0}
    for array, index in (op.detail for op in operations if op.kind == "entry"):
        reach[array] = max(reach[array], index + 1)
    require(reach["_x"] <= states and reach["_u"] <= inputs, "features")
    # A comparison is no number, and no number is a comparison.
    tests = [op.arguments[0] for op in operations if op.kind == "select"]
    others = [n for op in operations for n in op.arguments[op.kind == "select" :]]
    others += [*features.named, *features.terms, *(number for number, _ in features.watched)]
    compared = {n for n, op in enumerate(operations) if op.kind in COMPARISONS}
    require(all(0 <= n < len(operations) for n in others), "features")
    require(compared.issuperset(tests) and compared.isdisjoint(others), "features")
    calls = sum(op.kind in (*FUNCTIONS, "atan2", "power") for op in operations)
    total = len(operations) + CALL * calls
    require(len(features.groups) <= columns, "groups")
    for terms, targets in features.groups:
        check_distinct_indices("groups", terms, len(features.terms))
        check_distinct_indices("groups", targets, columns)
        require(bool(terms and targets), "groups")
        total += len(terms) * padded(len(targets))
    require(total <= MOST_SIZE, "features")
    return reach["_constants"]


class FeatureListing(Listing):
    """Features of reduced coordinates `z` and inputs `u` under construction."""

    def __init__(self, states: int, inputs: int) -> None:
        super().__init__()
        self.z = [self.let(self.entry("_x", i)) for i in range(states)]
        self.u = [self.let(self.entry("_u", i)) for i in range(inputs)]

    def p(self, number: int) -> Value:
        """A parameter."""
        return self.entry("_constants", number)

    def features(
        self,
        terms: Sequence[Term],
        groups: Any = (),
        watched: Sequence[tuple[Value, str]] = (),
    ) -> Features:
        """Features, each the product of its factors, and no operation that none needs."""
        numbers = [product(term).number for term in terms]
        needed = [*numbers, *(value.number for value, _ in watched)]
        operations, renumbered = pruned(self.operations, needed)
        named = [renumbered[n] for n in sorted(self.named) if n in renumbered]
        return Features(
            states=len(self.z),
            inputs=len(self.u),
            operations=tuple(operations),
            named=tuple(named),
            terms=tuple(renumbered[n] for n in numbers),
            groups=groups,
            watched=tuple((renumbered[value.number], what) for value, what in watched),
        )


def filled(matrix: np.ndarray, width: int = WIDTH) -> np.ndarray:
    """A matrix with further columns of zeros, up to a multiple of the width."""
    rows, columns = matrix.shape
    result = np.zeros((rows, padded(columns, width)))
    result[:, :columns] = matrix
    return result


def product(factors: Term) -> Value:
    """The product of factors, from the first one on."""
    return reduce(mul, factors)


def _listed(features: Features) -> tuple[Listing, list[Value]]:
    """Operations of features for a kernel, and the features."""
    listing = Listing()
    listing.operations += features.operations
    listing.named.update(features.named)
    return listing, [Value(listing, number) for number in features.terms]


# A fit makes systems of the same features again and again.
@cache
def rates_kernels(features: Features, parameters: int) -> Kernels:
    """The right-hand side; constants are that many parameters, then C."""
    k, first = features.states, parameters
    listing, values = _listed(features)
    sums: dict[int, list[Value]] = {}
    for terms, columns in features.groups:
        parts = listing.sums("_constants", first, len(columns), [values[j] for j in terms])
        first += len(terms) * padded(len(columns))
        for i, part in zip(columns, parts, strict=True):
            sums.setdefault(i, []).append(part)
    nothing, totals = [listing.number(0.0)], []
    for i in range(k + PLANAR):
        one, *others = sums.get(i, nothing)
        totals.append(sum(others, one))
    forward, sideward = map(listing.let, totals[k + 1 :])
    sine, cosine = listing.parts(listing.new("sincos", listing.entry("_x", k)), 2)
    for i in range(k + 1):
        listing.store(i, totals[i])
    listing.store(k + 1, forward * cosine - sideward * sine)
    listing.store(k + 2, forward * sine + sideward * cosine)
    return Kernels([listing.kernel("derivative", ARGUMENTS)])


def decoding_kernel(features: Features, shape: VehicleShape, parameters: int) -> Kernel:
    """What gives full states, and after them what is watched.

    Constants are the features' parameters, then rows of coefficients: of the terms, and of the
    shape at straight running.
    """
    k, size = features.states, len(shape.model.definition.states)
    listing, factors = _listed(features)
    factors.append(listing.number(1.0))
    values = listing.sums("_constants", parameters, len(shape.indices), factors)
    parts = dict(zip(shape.indices.tolist(), values, strict=True))
    sine, cosine = listing.parts(listing.new("sincos", listing.entry("_x", k)), 2)
    results: dict[int, Value | float] = dict.fromkeys(range(size), 0.0) | parts
    for index, i in zip(shape.model.planar.tolist(), (k + 1, k + 2, k), strict=True):
        results[index] = listing.entry("_x", i)
    for a, b in shape.pairs:
        results[a] = cosine * parts[a] - sine * parts[b]
        results[b] = sine * parts[a] + cosine * parts[b]
    watched = (Value(listing, number) for number, _ in features.watched)
    results |= enumerate(watched, size)
    for index, value in results.items():
        listing.store(index, value)
    return listing.kernel("full_state", ARGUMENTS)


def feature_columns(
    features: Features, z: np.ndarray, u: np.ndarray, parameters: np.ndarray
) -> np.ndarray:
    """Features (samples, terms) of reduced coordinates (samples, states) and inputs."""
    sizes = features.states, features.inputs, len(features.terms)
    return at_samples(_column_kernels(features), "columns", parameters, (z, u), sizes)


@cache
def _column_kernels(features: Features) -> Kernels:
    """What evaluates the features; its constants are their parameters."""
    listing, values = _listed(features)
    for i, value in enumerate(values):
        listing.store(i, value)
    return Kernels([listing.kernel("columns", ARGUMENTS)])


def feature_system(
    features: Features,
    parameters: np.ndarray,
    coefficients: np.ndarray,
    error_scale: np.ndarray,
    inputs_at_rest: np.ndarray,
) -> System:
    """The reduced vehicle as the compiled loops take it, its Jacobian frozen at straight running.

    Arrays are those of `ReducedVehicle`.
    """
    blocks = [filled(coefficients[np.ix_(terms, columns)]) for terms, columns in features.groups]
    constants = np.concatenate([parameters, *(block.ravel() for block in blocks)])
    dim = features.states + PLANAR
    return System(
        rates_kernels(features, len(parameters)),
        constants,
        features.inputs,
        np.zeros(dim),
        error_scale,
        np.arange(dim - 2),
        np.zeros(0, dtype=np.int64),
        reference_inputs=inputs_at_rest,
    )
