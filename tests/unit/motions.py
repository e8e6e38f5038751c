"""Histories of positions and rotations in many digits, and motions of the tape as numbers."""

from collections.abc import Callable, Sequence

import mpmath as mp
import numpy as np
import sympy as sp
from hypothesis import strategies as st

from tests.unit.programs import function_of
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import mechanics as m
from vehiclemor.symbolic.tape import Tape

# Central differences at this step and as many digits are exact to 28 digits.
STEP, DIGITS = mp.mpf("1e-15"), 60
X, Y, Z = np.eye(3)
numbers = st.floats(-2.0, 2.0)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)
angles = st.floats(-3.0, 3.0)


# Positions, rotations and their histories, in many digits


def history(rng: np.random.Generator) -> Callable:
    """A smooth function of time."""
    size, rate, phase, rest = rng.uniform(0.3, 1.5, 4)
    return lambda t: rest - 1 + size * mp.sin(rate * t + phase)


def column(vector: Sequence) -> mp.matrix:
    return mp.matrix(list(vector))


def skew(a) -> mp.matrix:
    return mp.matrix([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def turned(axis, angle) -> mp.matrix:
    """Rotation about a unit axis."""
    k = skew(axis)
    return mp.eye(3) + mp.sin(angle) * k + (1 - mp.cos(angle)) * (k * k)


def rate(f: Callable) -> Callable:
    """Derivative of a function of time."""
    return lambda t: (f(t + STEP) - f(t - STEP)) / (2 * STEP)


def second(f: Callable):
    """Second derivative at time zero."""
    return (f(STEP) - 2 * f(mp.mpf(0)) + f(-STEP)) / STEP**2


def spin_of(rotation: Callable) -> Callable:
    """Angular velocity of a rotation that is a function of time, in the axes that stand still."""

    def value(t):
        tensor = rate(rotation)(t) * rotation(t).T
        return column([tensor[2, 1], tensor[0, 2], tensor[1, 0]])

    return value


def floats(a) -> np.ndarray:
    return np.array([float(e) for e in a])


def unit(rng: np.random.Generator) -> np.ndarray:
    a = rng.standard_normal(3)
    return a / np.linalg.norm(a)


# Motions as numbers


def exact(a) -> g.Vector:
    return g.vector([sp.Float(float(e), 17) for e in a])


def real(names: str) -> tuple[sp.Symbol, ...]:
    return sp.symbols(names, real=True)


def moving(tape: Tape, symbols: Sequence, motion: m.Motion, speeds: int) -> Callable:
    """Values of the symbols -> velocity (3,), its columns (3, speeds), its bias (3,)."""
    assert set(motion.columns) <= set(range(speeds))
    rows = [[motion.columns.get(k, m.ZERO)[i] for k in range(speeds)] for i in range(3)]
    function = function_of(tape, symbols, [list(motion.value), rows, list(motion.bias)])

    def values(*given) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        value, columns, bias = function(*given)
        return np.array(value), np.array(columns), np.array(bias)

    return values


def assert_moves(found, velocity, acceleration, rates, accelerations) -> None:
    """Velocity and acceleration that follow from speeds and their derivatives are those given."""
    value, columns, bias = found
    np.testing.assert_allclose(value, floats(velocity), rtol=0, atol=1e-13)
    np.testing.assert_allclose(columns @ floats(rates), value, rtol=0, atol=1e-13)
    reached = columns @ floats(accelerations) + bias
    np.testing.assert_allclose(reached, floats(acceleration), rtol=0, atol=1e-12)


def at_zero(histories: Sequence[Callable]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Histories, their first and their second derivatives at time zero."""
    now = mp.mpf(0)
    return (
        floats([h(now) for h in histories]),
        floats([rate(h)(now) for h in histories]),
        floats([second(h) for h in histories]),
    )


TENSOR = np.array([[2.0, 0.3, -0.2], [0.3, 3.0, 0.4], [-0.2, 0.4, 4.5]])


def tensor_of(tensor: np.ndarray) -> m.Tensor:
    rows = [exact(row) for row in tensor]
    return rows[0], rows[1], rows[2]
