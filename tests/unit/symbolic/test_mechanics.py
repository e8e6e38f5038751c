"""Kane's equations on textbook systems, the symmetric solve, and the order of batched calls."""

from itertools import product

import numpy as np
import pytest
import sympy as sp

from tests.unit.programs import run
from vehiclemor.symbolic import mechanics
from vehiclemor.symbolic.elimination import eliminate_symmetric
from vehiclemor.symbolic.geometry import vector
from vehiclemor.symbolic.joints import along, free_rate
from vehiclemor.symbolic.program import assemble
from vehiclemor.symbolic.tape import Tape

one = sp.Symbol("one", real=True)


def real(names: str) -> tuple[sp.Symbol, ...]:
    return sp.symbols(names, real=True)


def motion(value, columns, bias) -> mechanics.Motion:
    named = {k: vector(column) for k, column in columns.items()}
    return mechanics.Motion(vector(value), named, vector(bias))


class System:
    """Mass matrix and forces of bodies, as numbers."""

    def __init__(self, tape: Tape, speeds: int, bodies: list, symbols: list) -> None:
        mass, force = mechanics.kane(tape, speeds, bodies)
        rows = [e for j in range(speeds) for e in [*mass[j], force[j]]]
        # A program has at least one constant.
        results = {"f": ([*rows, one], (len(rows) + 1,))}
        self.n, self.symbols = speeds, symbols
        self.program = assemble(tape, {"x": symbols}, [one], results)

    def __call__(self, *values: float) -> tuple[np.ndarray, np.ndarray]:
        at = dict(zip(self.symbols, values, strict=True)) | {one: 1.0}
        rows = run(self.program, "f", at)[:-1].reshape(self.n, self.n + 1)
        return rows[:, :-1], rows[:, -1]

    def accelerations(self, *values: float) -> np.ndarray:
        return np.linalg.solve(*self(*values))


# Textbook systems


def test_double_pendulum_has_lagranges_equations(rng):
    a, b, va, vb = symbols = real("a b va vb")
    m1, m2, l1, l2, g = 1.3, 0.7, 0.9, 1.4, 9.81
    tape = Tape()
    # x forward, z up, angles from the vertical; components in the inertial frame.
    first = (l1 * sp.cos(a), 0, l1 * sp.sin(a))
    second = (l2 * sp.cos(b), 0, l2 * sp.sin(b))
    turn1 = (-l1 * sp.sin(a) * va**2, 0, l1 * sp.cos(a) * va**2)
    turn2 = (-l2 * sp.sin(b) * vb**2, 0, l2 * sp.cos(b) * vb**2)

    def sums(*vectors):
        return tuple(sum(parts) for parts in zip(*vectors, strict=True))

    v1 = tuple(va * e for e in first)
    v2 = sums(v1, tuple(vb * e for e in second))
    bodies = [
        mechanics.Body(sp.Float(m1), motion(v1, {0: first}, turn1), vector((0, 0, -m1 * g))),
        mechanics.Body(
            sp.Float(m2),
            motion(v2, {0: first, 1: second}, sums(turn1, turn2)),
            vector((0, 0, -m2 * g)),
        ),
    ]
    system = System(tape, 2, bodies, list(symbols))
    for _ in range(10):
        x = rng.uniform(-3.0, 3.0, 4)
        difference = x[0] - x[1]
        c, s = np.cos(difference), np.sin(difference)
        mass = [[(m1 + m2) * l1**2, m2 * l1 * l2 * c], [m2 * l1 * l2 * c, m2 * l2**2]]
        force = [
            -m2 * l1 * l2 * s * x[3] ** 2 - (m1 + m2) * g * l1 * np.sin(x[0]),
            m2 * l1 * l2 * s * x[2] ** 2 - m2 * g * l2 * np.sin(x[1]),
        ]
        expected = np.linalg.solve(mass, force)
        np.testing.assert_allclose(system.accelerations(*x), expected, rtol=1e-11)


INERTIA = np.array([[2.0, 0.3, -0.2], [0.3, 3.0, 0.4], [-0.2, 0.4, 4.5]])
MASS = 1.7


def exact(tensor: np.ndarray) -> tuple:
    return tuple(vector([sp.Float(e) for e in row]) for row in tensor)


def test_a_free_rigid_body_has_newtons_and_eulers_equations(rng):
    speeds, loads = real("u v w p q r"), real("fx fy fz mx my mz")
    tape = Tape()
    frame = mechanics.MovingFrame(vector(speeds[:3]), vector(speeds[3:]), first=0)
    body = mechanics.Body(
        sp.Float(MASS),
        frame.origin(tape),
        vector(loads[:3]),
        frame.rotation(tape, exact(INERTIA)),
        exact(INERTIA),
        vector(loads[3:]),
    )
    system = System(tape, 6, [body], [*speeds, *loads])
    for _ in range(10):
        x = rng.uniform(-5.0, 5.0, 12)
        v, w, f, m = x[:3], x[3:6], x[6:9], x[9:]
        linear = f / MASS - np.cross(w, v)
        angular = np.linalg.solve(INERTIA, m - np.cross(w, INERTIA @ w))
        np.testing.assert_allclose(
            system.accelerations(*x), [*linear, *angular], rtol=1e-12, atol=1e-12
        )


def carrier_with_slider_and_rotor():
    """A free body that carries a mass on a slide and a spinning rotor; no loads."""
    *speeds, slid, rate, spin = symbols = real("u v w p q r slid rate spin")
    tape = Tape()
    frame = mechanics.MovingFrame(vector(speeds[:3]), vector(speeds[3:]), first=0)
    axis = vector([sp.Float(e) for e in (0.6, 0.0, 0.8)])
    about = mechanics.axisymmetric_inertia(sp.Float(1.9), sp.Float(1.1), axis)
    place = vector((sp.Float(0.5), sp.Float(-0.3), slid + sp.Float(0.2)))
    none = mechanics.ZERO
    bodies = [
        mechanics.Body(
            sp.Float(MASS),
            frame.origin(tape),
            none,
            frame.rotation(tape, exact(INERTIA)),
            exact(INERTIA),
        ),
        mechanics.Body(
            sp.Float(0.9),
            frame.point(tape, place, along(free_rate(6, rate), mechanics.UNIT[2])),
            none,
            frame.rotation(tape, about, spin=(7, spin, axis)),
            about,
        ),
    ]
    return System(tape, 8, bodies, list(symbols)), np.array([0.6, 0.0, 0.8])


def momenta(x: np.ndarray, axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Momentum and angular momentum about the frame's origin, by their definitions."""
    v, w, slid, rate, spin = x[:3], x[3:6], *x[6:]
    place = np.array([0.5, -0.3, 0.2 + slid])
    speed = v + np.cross(w, place) + [0.0, 0.0, rate]
    rotor = 1.1 * np.eye(3) + 0.8 * np.outer(axis, axis)
    momentum = MASS * v + 0.9 * speed
    turning = INERTIA @ w + np.cross(place, 0.9 * speed) + rotor @ (w + spin * axis)
    return momentum, turning


def test_momentum_and_angular_momentum_of_a_free_system_stay_constant(rng):
    system, axis = carrier_with_slider_and_rotor()
    for _ in range(10):
        x = rng.uniform(-2.0, 2.0, 9)
        nu_dot = system.accelerations(*x)
        v, w = x[:3], x[3:6]
        step = 1e-6
        change = step * np.array([*nu_dot[:6], x[7], nu_dot[6], nu_dot[7]])
        later, earlier = momenta(x + change, axis), momenta(x - change, axis)
        momentum, turning = momenta(x, axis)
        rates = [(a - b) / (2 * step) for a, b in zip(later, earlier, strict=True)]
        # Rates in the inertial frame, the second about a moving origin.
        np.testing.assert_allclose(rates[0] + np.cross(w, momentum), 0.0, atol=1e-7)
        balance = rates[1] + np.cross(w, turning) + np.cross(v, momentum)
        np.testing.assert_allclose(balance, 0.0, atol=1e-7)


def test_kinetic_energy_of_a_free_system_stays_constant(rng):
    system, _ = carrier_with_slider_and_rotor()
    for _ in range(10):
        x, shift = rng.uniform(-2.0, 2.0, 9), np.zeros(9)
        nu = np.array([*x[:6], *x[7:]])
        shift[6] = 1e-6 * x[7]
        change = (system(*(x + shift))[0] - system(*(x - shift))[0]) / 2e-6
        assert nu @ system(*x)[1] + 0.5 * nu @ change @ nu == pytest.approx(0.0, abs=1e-7)


# Symmetric elimination


@pytest.mark.parametrize("seed", range(12))
def test_symmetric_elimination_equals_a_dense_solve_in_any_order(seed):
    rng = np.random.default_rng(seed)
    n = 3 + seed % 6
    factor = np.tril(rng.uniform(-1.0, 1.0, (n, n)) * (rng.random((n, n)) < 0.4), -1)
    factor += np.diag(rng.uniform(0.5, 2.0, n))
    shuffle = rng.permutation(n)
    matrix = (factor @ factor.T)[shuffle][:, shuffle]
    right_side = rng.standard_normal(n)
    names = {
        (i, j): sp.Symbol(f"a_{i}_{j}", real=True)
        for i, j in product(range(n), repeat=2)
        if i >= j and matrix[i, j] != 0.0
    }
    entries = [
        [names.get((max(i, j), min(i, j)), sp.Integer(0)) for j in range(n)] for i in range(n)
    ]
    b = real(" ".join(f"b{i}" for i in range(n)))
    tape = Tape()
    order = [int(k) for k in rng.permutation(n)]
    unknowns = eliminate_symmetric(tape, entries, list(b), order)
    arguments = {"a": list(names.values()), "b": list(b)}
    program = assemble(tape, arguments, [one], {"f": ([*unknowns, one], (n + 1,))})
    values = {name: matrix[place] for place, name in names.items()}
    values |= dict(zip(b, right_side, strict=True)) | {one: 1.0}
    found = run(program, "f", values)[:n]
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right_side), rtol=1e-9, atol=1e-11)
