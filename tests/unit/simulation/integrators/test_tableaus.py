"""Order conditions of the integrators' coefficients.

E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I (2nd ed., 1993),
section II.2; E. Hairer, G. Wanner, II (2nd ed., 1996), sections IV.7 and IV.15.
"""

from itertools import chain
from types import SimpleNamespace

import numpy as np

from vehiclemor.simulation.integrators import dopri5 as pair
from vehiclemor.simulation.integrators import rodas4


def weighted(b: np.ndarray, conditions: list, tolerance: float) -> float:
    """Largest defect of conditions (stage vector, value) that weights must fulfil."""
    found = [b @ stage for stage, _ in conditions]
    error = np.abs(np.subtract(found, [value for _, value in conditions])).max()
    assert error < tolerance or tolerance == np.inf
    return error


def explicit_conditions(a: np.ndarray) -> dict[int, list]:
    """Order -> conditions by rooted trees: elementary weights, and 1 / density."""
    one = np.ones(len(a))
    c = a @ one
    ac, ac2, aac = a @ c, a @ c**2, a @ a @ c
    return {
        1: [(one, 1)],
        2: [(c, 1 / 2)],
        3: [(c**2, 1 / 3), (ac, 1 / 6)],
        4: [(c**3, 1 / 4), (c * ac, 1 / 8), (ac2, 1 / 12), (aac, 1 / 24)],
        5: [
            *((c**4, 1 / 5), (c**2 * ac, 1 / 10), (c * ac2, 1 / 15), (c * aac, 1 / 30)),
            *((ac**2, 1 / 20), (a @ c**3, 1 / 20), (a @ (c * ac), 1 / 40), (a @ ac2, 1 / 60)),
            (a @ aac, 1 / 120),
        ],
    }


def test_the_explicit_pair_has_orders_5_and_4_and_dense_output_of_order_4():
    a, unit = np.zeros((7, 7)), np.eye(7)
    for i in range(2, 7):
        a[i - 1, : i - 1] = [getattr(pair, f"A{i}{j}") for j in range(1, i)]
    a[6] = b = np.array([pair.B1, 0.0, pair.B3, pair.B4, pair.B5, pair.B6, 0.0])
    error = np.array([pair.E1, 0.0, pair.E3, pair.E4, pair.E5, pair.E6, pair.E7])
    dense = np.array([pair.D1, 0.0, pair.D3, pair.D4, pair.D5, pair.D6, pair.D7])
    by_order = explicit_conditions(a)
    weighted(b, [*chain(*by_order.values())], 1e-15)
    assert max(abs(error @ stage) for stage, _ in by_order.pop(5)) > 1e-4
    weighted(b - error, [*chain(*by_order.values())], 1e-15)
    for z in (0.1, 0.37, 0.8):
        bend, back = unit[0] - b, 2 * b - unit[0] - unit[6]
        at = z * (b + (1 - z) * (bend + z * (back + (1 - z) * dense)))
        scaled = [(s, z**k * value) for k, part in by_order.items() for s, value in part]
        weighted(at, scaled, 1e-14)


def rosenbrock(a, c, m, e, gamma) -> SimpleNamespace:
    """alpha, Gamma, b and embedded b of the original form, from the transformed one."""
    matrix = np.linalg.inv(np.eye(len(m)) / gamma - c)
    return SimpleNamespace(
        alpha=a @ matrix, gamma=matrix, b=m @ matrix, embedded=(m - e) @ matrix, one=np.ones(len(m))
    )


ROWS = rodas4.tableau()
RODAS4 = rosenbrock(ROWS[:6], ROWS[6:12], ROWS[14], ROWS[15], 0.25)


def test_rodas4_satisfies_the_conditions_of_orders_4_and_3():
    own, beta = RODAS4, RODAS4.alpha + RODAS4.gamma
    at, image = own.alpha @ own.one, beta @ own.one
    third = [(own.one, 1), (image, 1 / 2), (at**2, 1 / 3), (beta @ image, 1 / 6)]
    fourth = [(at**3, 1 / 4), (at * (own.alpha @ image), 1 / 8)]
    fourth += [(beta @ at**2, 1 / 12), (beta @ beta @ image, 1 / 24)]
    weighted(own.b, third + fourth, 1e-13)
    weighted(own.embedded, third, 1e-13)
    assert weighted(own.embedded, fourth, np.inf) > 1e-3
    # Times of the stages and weights of the time derivative belong to the same matrices.
    np.testing.assert_allclose(at, ROWS[12], atol=1e-13)
    np.testing.assert_allclose(own.gamma.sum(axis=1), ROWS[13], atol=1e-13)
