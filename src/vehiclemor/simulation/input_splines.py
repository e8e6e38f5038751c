"""Inputs as piecewise polynomials, so that compiled loops can evaluate them at any time.

Between two break points of a maneuver an input is smooth: quintic splines on equidistant knots,
doubled until the error at the midpoints is below `ACCURACY` times the input's largest value.
"""

from functools import lru_cache
from itertools import pairwise

import numpy as np

from vehiclemor.codegen.loops import Ready, ready
from vehiclemor.errors import InputError
from vehiclemor.maneuvers import Maneuver
from vehiclemor.simulation.integrators.structures import Signal

ACCURACY = 1e-11
MOST_PIECES = 1 << 15
DEGREE = 5


@lru_cache(maxsize=64)
def signal_of(maneuver: Maneuver) -> Ready:
    """Piecewise polynomial inputs of a maneuver.

    Raises
    ------
    InputError
        If an input isn't finite, or isn't smooth between the break points that the maneuver names.
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
    # A short pulse may lie between the probes of the whole run.
    inside = np.concatenate([np.linspace(a, b, 18)[1:-1] for a, b in pairwise(edges)])
    samples = np.concatenate([values, maneuver.at(inside)])
    largest = np.abs(samples).max(axis=0) + 1e-300
    parts = [_segment(maneuver, a, b, largest) for a, b in pairwise(edges)]
    first = np.cumsum([0, *(len(part) for part in parts)])
    return ready(Signal(edges, first.astype(np.int64), np.concatenate(parts)))


def _segment(maneuver: Maneuver, a: float, b: float, largest: np.ndarray) -> np.ndarray:
    """Polynomials (pieces, inputs, 6) between two break points."""
    # Takes longer to import than a model to load.
    from scipy.interpolate import make_interp_spline

    # One-sided values at the ends, where the input may jump.
    inside = 1e-13 * (b - a)
    pieces = 8
    while pieces <= MOST_PIECES:
        knots = np.linspace(a, b, pieces + 1)
        values = maneuver.at(np.clip(knots, a + inside, b - inside))
        if not np.isfinite(values).all():
            raise InputError(f"an input is not finite between t = {a:g} and {b:g} s")
        if np.all(values == values[0]):
            constant = np.zeros((1, values.shape[1], DEGREE + 1))
            constant[0, :, 0] = values[0]
            middle = maneuver.at(np.linspace(a, b, 64)[1:-1])
            if np.all(middle == values[0]):
                return constant
        spline = make_interp_spline(knots, values, k=DEGREE)
        middles = (knots[1:] + knots[:-1]) / 2.0
        error = np.abs(spline(middles) - maneuver.at(middles)) / largest
        if error.max() < ACCURACY:
            # Taylor terms at the left end of each piece.
            step, factorial, terms = (b - a) / pieces, 1.0, []
            for k in range(DEGREE + 1):
                factorial *= max(k, 1)
                terms.append(spline.derivative(k)(knots[:-1]) * step**k / factorial)
            return np.ascontiguousarray(np.stack(terms, axis=-1))
        pieces *= 2
    raise InputError(
        f"maneuver {maneuver.name!r} is not smooth between t = {a:g} and {b:g} s; "
        f"name the times of its corners as break points"
    )
