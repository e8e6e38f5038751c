"""Inputs as piecewise polynomials, so that compiled loops can evaluate them at any time.

Between two break points of a maneuver an input is smooth: polynomials of degree 5 through the
Chebyshev points of equal pieces (L. N. Trefethen, Approximation Theory and Approximation Practice,
2013, chapter 2), halved until the error half-way between these points is below `ACCURACY` times the
input's largest value.
"""

from functools import cache
from itertools import pairwise

import numpy as np

from vehiclemor.exceptions import InputError
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.inputs.polynomial_loops import Pieces

ACCURACY = 1e-11
MOST_PIECES = 1 << 15
DEGREE = 5


def fitted_pieces(maneuver: Excitation) -> Pieces:
    """Piecewise polynomials that approximate the functions of a maneuver.

    `InputError` if an input isn't finite, or isn't smooth between the break points.
    """
    inner = sorted(t for t in set(maneuver.break_points) if 0.0 < t < maneuver.duration)
    edges = np.array([0.0, *inner, maneuver.duration])
    probe = np.linspace(0.0, maneuver.duration, 1001)
    values = maneuver.at(probe)
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        sample, column = bad[0]
        raise InputError(
            f"input {maneuver.inputs[column]} is not finite at t = {probe[sample]:.6g} s"
        )
    # A short pulse may lie between the probes of the run.
    inside = np.concatenate([np.linspace(a, b, 18)[1:-1] for a, b in pairwise(edges)])
    times, samples = np.concatenate([probe, inside]), np.concatenate([values, maneuver.at(inside)])
    largest = np.abs(samples).max(axis=0) + 1e-300
    parts = [_segment(maneuver, (a, b), largest, (times, samples)) for a, b in pairwise(edges)]
    first = np.cumsum([0, *(len(part) for part in parts)])
    return Pieces(edges, first.astype(np.int64), np.empty(0), np.concatenate(parts))


def _segment(
    maneuver: Excitation,
    ends: tuple[float, float],
    largest: np.ndarray,
    known: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """Polynomials (pieces, 6, inputs) between two break points, which also give known values."""
    a, b = ends
    # One-sided values at the ends, where the input may jump.
    inside = min(max(1e-13, 2.0 * np.spacing(b) / (b - a)), 1e-6)
    known_parts = (known[0] - a) / (b - a)
    within = (known_parts > inside) & (known_parts < 1.0 - inside)
    known_parts, known_values = known_parts[within], known[1][within]

    def inputs_at(parts: np.ndarray) -> np.ndarray:
        times = a + (b - a) * np.clip(parts, inside, 1.0 - inside)
        values = maneuver.at(times.ravel())
        if not np.isfinite(values).all():
            raise InputError(f"an input is not finite between t = {a:g} and {b:g} s")
        return values.reshape(*parts.shape, -1)

    nodes = _nodes()
    middles = 0.5 * (nodes[1:] + nodes[:-1])
    pieces = 8
    while pieces <= MOST_PIECES:
        left = np.arange(pieces)[:, None]
        values = inputs_at((left + nodes) / pieces)
        if np.all(values == values[0, 0]) and np.all(known_values == values[0, 0]):
            constant = np.zeros((1, DEGREE + 1, values.shape[2]))
            constant[0, 0] = values[0, 0]
            return constant
        coefficients = _powers(nodes) @ values
        # The first and the last node have been moved inside.
        coefficients[0] = _powers(np.fmax(nodes, inside * pieces)) @ values[0]
        coefficients[-1] = _powers(np.fmin(nodes, 1.0 - inside * pieces)) @ values[-1]
        between = middles[:, None] ** np.arange(DEGREE + 1) @ coefficients
        errors = between - inputs_at((left + middles) / pieces)
        further = _values(coefficients, known_parts) - known_values
        if max(np.abs(e / largest).max(initial=0.0) for e in (errors, further)) < ACCURACY:
            return coefficients
        pieces *= 2
    raise InputError(
        f"maneuver {maneuver.name!r} is not smooth between t = {a:g} and {b:g} s; "
        f"name the times of its corners as break points"
    )


@cache
def _nodes() -> np.ndarray:
    """Chebyshev points on [0, 1], both ends among them."""
    return 0.5 - 0.5 * np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)


def _powers(nodes: np.ndarray) -> np.ndarray:
    """Coefficients of the powers of the polynomials that are 1 at one node, 0 at the others."""
    return np.linalg.inv(nodes[:, None] ** np.arange(DEGREE + 1))


def _values(coefficients: np.ndarray, parts: np.ndarray) -> np.ndarray:
    """Polynomials (n, inputs) at parts (n,) between 0 and 1 of their segment."""
    pieces = np.floor(parts * len(coefficients)).astype(int)
    powers = (parts * len(coefficients) - pieces)[:, None] ** np.arange(DEGREE + 1)
    return np.einsum("npi,np->ni", coefficients[pieces], powers)
