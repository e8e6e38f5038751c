"""Features of the slow manifold: what is odd and what is even in the lateral quantities.

The nonlinear terms are products of the axles' slip angles (held within their training range), the
roll angle, its rate and the steering; a vehicle that is its own mirror image has odd ones in the
lateral equations and even ones in the others.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from vehiclemor.reduction.vehicle.features import FeatureListing, Features, Term, held, monomials
from vehiclemor.reduction.vehicle.lifting_loops import MOVING
from vehiclemor.reduction.vehicle.regression import forward_selection, largest, ridge_fit
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.reduction.vehicle.slow_modes import SlowModes

VARIABLES = ("front", "rear", "roll", "rolling", "steer")
MEANINGS = ("slip of the front axle", "slip of the rear axle", "roll", "rate of roll", "steering")
# Part of heave and pitch at the start that samples after the landing still show.
AFTER_LANDING = 0.3
# And how much of it, in parts of what samples show, a car may have that is steered.
STEERED = 1.2
# Nonlinear terms that the lifting keeps: those that explain most of all states and outputs, each in
# parts of its range.  With all it follows the training runs more closely, and others less.
LIFTED = 8


class Ranges(NamedTuple):
    """Largest magnitudes in training runs: of the nonlinear terms' arguments (5,) and the rest."""

    arguments: np.ndarray
    states: np.ndarray
    inputs: np.ndarray
    speed: float


@dataclass(frozen=True)
class FeatureTable:
    """Features with the numbers of those that are odd and even in the lateral quantities.

    The first odd ones, `linear_count` of them, are lateral coordinates and the inputs, the first
    even ones, `straight_count` of them, are 1, the speed and the symmetric coordinates.
    """

    features: Features
    parameters: np.ndarray
    odd: list[int]
    even: list[int]
    linear_count: int
    straight_count: int
    ranges: Ranges

    def set_linear(self, c: np.ndarray, shape: VehicleShape, modes: SlowModes) -> None:
        """Write what is exact at straight running into coefficients (terms, states + 3)."""
        k, n, states = modes.lateral, len(modes.rates), self.ranges.states[:, None]
        odd, even = self.odd, self.even
        # Linear terms are scaled by the ranges of the training runs.
        c[odd[:k], :k] = modes.rates[:k, :k].T * states[:k]
        c[odd[k], :k] = modes.drive[:k] * self.ranges.inputs[0]
        # Straight running at any speed is an equilibrium: the speed changes by even terms alone.
        own = even[2 : self.straight_count]
        c[own, k:n] = modes.rates[k:, k:].T * states[k:]
        c[even[0], n + 2], c[even[1], n + 2] = shape.speed, 1.0
        c[own, n + 2] = shape.linearised.motion_a[1] @ modes.right[:, k:] * states[k:, 0]

    @property
    def odd_nonlinear(self) -> list[int]:
        """Odd features that are not linear."""
        return self.odd[self.linear_count :]

    @property
    def even_nonlinear(self) -> list[int]:
        """Even features that are not linear."""
        return self.even[self.straight_count :]

    @property
    def free(self) -> list[tuple[list[int], int]]:
        """(features, column of C) of the coefficients that whole runs may change."""
        (_, lateral), (_, symmetric) = self.features.groups
        heading = self.features.states
        free = [(self.odd_nonlinear, column) for column in lateral if column < heading]
        free += [(self.odd, column) for column in lateral if column >= heading]
        return [*free, *((self.even_nonlinear, column) for column in symmetric)]

    def with_only(self, kept: Sequence[int]) -> "FeatureTable":
        """Some of the features, by their numbers in order."""
        odd = [i for i in kept if i in self.odd]
        even = [i for i in kept if i in self.even]
        numbers = tuple(range(len(odd) + len(even)))
        (_, lateral), (_, symmetric) = self.features.groups
        groups = ((numbers[: len(odd)], lateral), (numbers[len(odd) :], symmetric))
        features = self.features.with_terms([*odd, *even], groups)
        first, rest = list(numbers[: len(odd)]), list(numbers[len(odd) :])
        return replace(self, features=features, odd=first, even=rest)


def ranges_of(
    shape: VehicleShape, modes: SlowModes, deviations: np.ndarray, u: np.ndarray
) -> Ranges:
    """Ranges of deviations of the shape (samples, n) at inputs (samples, inputs)."""
    z, speed = modes.coordinates(deviations, u)
    k, rows = modes.lateral, _variables(shape, modes)
    # The axles' slips go as one over the speed where they come from motion, not from steering.
    at_speed = shape.speed / (shape.speed + speed)
    values = np.column_stack([z[:, :k], u[:, 0]]) @ rows[:, : k + 1].T
    values[:, :2] = values[:, :2] * at_speed[:, None] + np.outer(u[:, 0], rows[:2, k + 1])
    return Ranges(largest(values), largest(z), largest(u), float(largest(speed[:, None])[0]))


def feature_table(
    shape: VehicleShape,
    modes: SlowModes,
    ranges: Ranges,
    hull: float,
    trusted: float,
) -> FeatureTable:
    """Features, scaled by the ranges of training runs; see the settings of the slow manifold."""
    k, n, inputs = modes.lateral, len(ranges.states), len(ranges.inputs)
    rows = _variables(shape, modes) * (1.0 / (hull * ranges.arguments))[:, None]
    # The last one tells how far lateral arguments may go.
    ends = [shape.speed, 1.0 / (hull * ranges.speed), hull / trusted]
    parameters = np.concatenate([rows.ravel(), 1.0 / ranges.states, 1.0 / ranges.inputs, ends])
    width = k + 2

    listing = FeatureListing(n + 1, inputs)
    z, u, let = listing.z, listing.u, listing.let
    p = [*map(listing.p, range(len(parameters)))]
    first, last = len(VARIABLES) * width, len(VARIABLES) * width + n + inputs
    part, speed = let(p[last] / (p[last] + z[n])), let(p[last + 1] * z[n])
    m, raw, v = let(held(speed)), [], []
    for i in range(len(VARIABLES)):
        row = p[i * width : (i + 1) * width]
        one, *others = [a * b for a, b in zip(row[: k + 1], [*z[:k], u[0]], strict=True)]
        moved = sum(others, one)
        raw.append(let(part * moved + row[k + 1] * u[0] if i < 2 else moved))
        v.append(let(held(raw[-1])))
    own: list[Term] = [*zip(p[first:], z[:n], strict=False)]
    straight: list[Term] = [*own[:k], *zip(p[first + n :], u, strict=False)]
    scaled = straight[: k + 1]
    odd = [*straight, *((m, *term) for term in scaled), *((m, m, *term) for term in scaled)]
    odd += monomials(v, 3)
    odd += [(v[i], v[i], v[i], v[j], v[j]) for i, j in product((0, 1), (0, 1))]
    slides = [(v[i], abs(v[i])) for i in (0, 1)]
    odd += [term for slide in slides for term in (slide, (m, *slide), (m, m, *slide))]
    odd += [(*slide, *pair) for slide in slides for pair in monomials(v, 2)]
    odd += [(m, *term) for term in monomials(v, 3)]
    odd += [(*term, variable) for term in own[k:] for variable in v]
    squares = monomials(v, 2)
    even = [(listing.number(1.0),), (z[n],), *own[k:], *squares, *((m, *pair) for pair in squares)]
    numbers = tuple(range(len(odd) + len(even)))
    lateral, symmetric = numbers[: len(odd)], numbers[len(odd) :]
    groups = ((lateral, (*range(k), n + 1, n + 3)), (symmetric, (*range(k, n + 1), n + 2)))
    one, *others = map(abs, v)
    steered = held(1.0 / MOVING * sum(others, one))
    watched: list[tuple[Term, str]] = [
        ((p[last + 2], value), meaning) for value, meaning in zip(raw, MEANINGS, strict=True)
    ]
    watched.append(((listing.number(hull / trusted), speed), "change of speed"))
    # More of it than corners make is known only where the car runs straight.
    alive = AFTER_LANDING + (1.0 / STEERED - AFTER_LANDING) * steered
    watched += [((alive, *term), "heave and pitch") for term in own[k:]]
    terms = (*odd, *even)
    features = listing.features(terms, groups, watched, len(MEANINGS))
    counts = k + inputs, 2 + n - k
    return FeatureTable(features, parameters, list(lateral), list(symmetric), *counts, ranges)


def fitted_lifting(
    shape: VehicleShape,
    table: FeatureTable,
    columns: np.ndarray,
    deviations: np.ndarray,
    ridge: float,
) -> tuple[np.ndarray, Features]:
    """Coefficients (terms, n) of the shape's deviations from straight running, and their features.

    Parameters
    ----------
    columns, deviations
        Features of the table (samples, terms), and deviations (samples, n) that they fit.
    """
    features, count = table.features, len(table.features.terms)
    given = [*table.odd[: table.linear_count], *table.even[: table.straight_count]]
    order = [*given, *np.setdiff1d(np.arange(count), given).tolist()]
    outputs = deviations @ shape.linearised.output_a.T
    values = np.hstack([part / largest(part) for part in (deviations, outputs)])
    chosen = forward_selection(columns[:, order], values, len(given), LIFTED)
    kept = sorted(order[i] for i in chosen)
    return ridge_fit(columns[:, kept], deviations, ridge), features.with_terms(kept)


def _variables(shape: VehicleShape, modes: SlowModes) -> np.ndarray:
    """Rows (5, k + 2) of the arguments of the nonlinear terms, per z, and per steering twice.

    The steering moves the shape (last but one) and the wheels themselves (last).
    """
    linear, outputs, k = shape.linearised, shape.model.outputs, modes.lateral

    def row(name: str) -> np.ndarray:
        a, b = linear.output_a[outputs.index(name)], linear.output_b[outputs.index(name), 0]
        return np.concatenate([a @ modes.right[:, :k], [a @ modes.follow, b]])

    front = 0.5 * (row("slip_angle_FL") + row("slip_angle_FR"))
    rear = 0.5 * (row("slip_angle_RL") + row("slip_angle_RR"))
    roll = row("roll")
    rolling = np.concatenate([roll[:k] @ modes.rates[:k, :k], [0.0, 0.0]])
    steer = np.concatenate([np.zeros(k), [1.0, 0.0]])
    return np.array([front, rear, roll, rolling, steer])
