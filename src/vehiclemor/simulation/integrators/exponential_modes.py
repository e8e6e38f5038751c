"""Modes of a frozen Jacobian in real blocks of one or two, and functions of them by step size.

J is approximated by A = T B S, S T = I, with B block diagonal and eigenvalue 0 left out.  Any A
will do for an exponential method, the closer to J the longer its steps: so what does not fit into
blocks of two is left out.  Eigenvalues that are close to one another, equal ones split by rounding
among them, share their mean, and their modes span an invariant subspace, be there eigenvectors or
not.  If what J does there beside the mean is nilpotent of degree two, as of stabilised constraints,
its singular vectors pair the modes into Jordan blocks of two.

N. Higham, Functions of Matrices (SIAM 2008), section 9.3; G. Golub, C. Van Loan, Matrix
Computations (4th ed., 2013), section 7.6.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

# Eigenvalues this close, relative to their size, are one.
CLOSE = 1e-3
# Slower modes (1/s) need no exponential.
SLOWEST = 1e-3
# Couplings of close eigenvalues that matter, relative to these.
COUPLED = 1e-2
# Inverse iteration: part of the distance to the other eigenvalues by which it is shifted, how much
# nearer those sought must be, its steps, and what may be left, relative to the Jacobian (Jordan
# blocks of stabilised constraints leave 1e-10).
AWAY, NEARER, ITERATIONS, INVARIANT = 0.3, 0.8, 200, 2e-10
# Terms of the series of phi functions.
TERMS = 40


class Modes(NamedTuple):
    """A = T B S with modes in order: single ones, first and second of each pair.

    Columns are T (n, r), rows S (r, n), rates the diagonal of B (r,), forth and back (pairs,) the
    rest of it: B v = rates v, and of a pair moreover (B v)_1 += forth v_2, (B v)_2 += back v_1;
    forth = -back of complex eigenvalues, forth = 0 of a Jordan block.
    """

    columns: np.ndarray
    rows: np.ndarray
    rates: np.ndarray
    forth: np.ndarray
    back: np.ndarray


def modes(jacobian: np.ndarray) -> Modes:
    """Modes of a Jacobian (n, n)."""
    values = np.asarray(np.linalg.eigvals(jacobian), dtype=complex)
    parts: list[np.ndarray] = [np.empty((len(jacobian), 0))]
    slow = np.abs(values) < SLOWEST
    if slow.any():
        parts.append(_real_basis(_invariant_subspace(jacobian, values, slow)))
    # Of each block: columns of T, rate, forth and back.
    singles: list[tuple[np.ndarray, float]] = []
    pairs: list[tuple[np.ndarray, np.ndarray, float, float, float]] = []
    for chosen in _clusters(values, ~slow):
        if _is_real(values[chosen]).any():
            basis = _real_basis(_invariant_subspace(jacobian, values, chosen))
            _add_real_modes(basis, basis.T @ jacobian @ basis, singles, pairs)
            continue
        basis = _invariant_subspace(jacobian, values, chosen & (np.imag(values) > 0.0))
        rate = np.trace(basis.conj().T @ jacobian @ basis) / basis.shape[1]
        pairs += [(q.real, q.imag, rate.real, rate.imag, -rate.imag) for q in basis.T]
    columns = [column for column, _ in singles] + [p[0] for p in pairs] + [p[1] for p in pairs]
    if not columns:
        nothing = np.empty(0)
        return Modes(np.empty((len(jacobian), 0)), np.empty((0, len(jacobian))), *[nothing] * 3)
    fast = np.column_stack(columns)
    rates = [rate for _, rate in singles] + 2 * [p[2] for p in pairs]
    return Modes(
        fast,
        np.linalg.inv(np.column_stack([fast, *parts]))[: fast.shape[1]],
        np.array(rates),
        np.array([p[3] for p in pairs]),
        np.array([p[4] for p in pairs]),
    )


def _is_real(values: np.ndarray) -> np.ndarray:
    return np.abs(np.imag(values)) <= CLOSE * np.abs(values)


def _clusters(values: np.ndarray, wanted: np.ndarray) -> list[np.ndarray]:
    """Masks of the eigenvalues by cluster; conjugate ones are in the same."""
    points = np.real(values) + 1j * np.abs(np.imag(values))
    reach = CLOSE * np.maximum.outer(np.abs(points), np.abs(points))
    close = np.abs(np.subtract.outer(points, points)) <= reach
    left, found = wanted.copy(), []
    while left.any():
        cluster = np.zeros_like(left)
        cluster[np.flatnonzero(left)[0]] = True
        while (grown := left & close[cluster].any(axis=0)).sum() > cluster.sum():
            cluster = grown
        found.append(cluster)
        left &= ~cluster
    return found


def _invariant_subspace(jacobian: np.ndarray, values: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Orthonormal basis (n, chosen) of the invariant subspace of some eigenvalues.

    By inverse iteration of a block, as an import of SciPy's Schur form takes longer than the first
    run of a process.
    """
    n, count = len(jacobian), int(chosen.sum())
    if count == n:
        return np.eye(n, dtype=complex)
    centre = values[chosen].mean()
    within, apart = np.abs(values[chosen] - centre).max(), np.abs(values[~chosen] - centre).min()
    # Beside the centre, where an eigenvalue may be, and far nearer to these than to all others.
    shift = centre + AWAY * apart
    if within + AWAY * apart < NEARER * (1.0 - AWAY) * apart:
        inverse = np.linalg.inv(jacobian - shift * np.eye(n))
        # Unit vectors may be invariant themselves: positions do not change the rates.
        anything = np.random.default_rng(0).normal(size=(n, count))
        basis = np.linalg.qr(inverse @ anything)[0]
        for _ in range(ITERATIONS):
            moved = jacobian @ basis
            left = moved - basis @ (basis.conj().T @ moved)
            if np.linalg.norm(left) <= INVARIANT * np.linalg.norm(jacobian):
                return basis
            basis = np.linalg.qr(inverse @ basis)[0]
    from scipy.linalg import schur

    def picked(value: complex) -> bool:
        return bool(chosen[np.abs(values - value).argmin()])

    return np.asarray(schur(jacobian, output="complex", sort=picked)[1])[:, :count]


def _real_basis(basis: np.ndarray) -> np.ndarray:
    """Orthonormal real basis of a subspace that contains the conjugates of its vectors."""
    return np.linalg.svd(np.hstack([np.real(basis), np.imag(basis)]))[0][:, : basis.shape[1]]


def _add_real_modes(basis: np.ndarray, block: np.ndarray, singles: list, pairs: list) -> None:
    """Modes of an invariant subspace on which J is a block with (almost) one real eigenvalue."""
    size = len(block)
    rate = np.trace(block) / size
    rest = block - rate * np.eye(size)
    left, strengths, right = np.linalg.svd(rest)
    coupled = int((strengths > COUPLED * abs(rate)).sum())
    square = np.linalg.norm(rest @ rest, 2)
    if coupled > size // 2 or square > COUPLED * strengths[0] ** 2:
        coupled = 0
    first, second = right[:coupled].T, left[:, :coupled]
    pairs += [
        (basis @ one, basis @ two, rate, 0.0, strength)
        for one, two, strength in zip(first.T, second.T, strengths, strict=False)
    ]
    # The others: orthogonal to those.
    others = np.linalg.svd(np.hstack([first, second, np.zeros((size, 1))]))[0][:, 2 * coupled :]
    singles += [(basis @ column, rate) for column in others.T]


def phi_functions(z: np.ndarray, highest: int) -> np.ndarray:
    """phi_0 to phi_highest (highest + 1, ...) of complex numbers."""
    found = np.empty((highest + 1, *z.shape), dtype=complex)
    # Small numbers: series of the highest one, then down; others: up from the exponential.
    small = np.abs(z) < highest
    term = np.full(z.shape, 1.0 / math.factorial(highest), dtype=complex)
    found[highest] = term
    near = np.where(small, z, 0.0)
    for j in range(1, TERMS):
        term = term * near / (highest + j)
        found[highest] += term
    for k in range(highest - 1, -1, -1):
        found[k] = near * found[k + 1] + 1.0 / math.factorial(k)
    far = np.where(small, highest, z)
    with np.errstate(over="ignore", invalid="ignore"):
        value = np.exp(far)
        for k in range(highest + 1):
            found[k] = np.where(small, found[k], value)
            value = (value - 1.0 / math.factorial(k)) / far
    return found


def modal_tables(found: Modes, grid: np.ndarray, highest: int) -> np.ndarray:
    """phi_1 to phi_highest of h B (step sizes, highest, r + 2 pairs): diagonal, forth, back."""
    r, pairs = len(found.rates), len(found.forth)
    complex_rates = found.rates + 0j
    complex_rates[r - 2 * pairs : r - pairs] += 1j * found.forth
    h = grid[:, None]
    functions = phi_functions(h * complex_rates, highest + 1)
    tables = np.empty((len(grid), highest, r + 2 * pairs))
    first = slice(r - 2 * pairs, r - pairs)
    jordan = found.forth == 0.0
    for k in range(1, highest + 1):
        table, phi = tables[:, k - 1], functions[k]
        table[:, :r] = phi.real
        table[:, r - pairs : r] = phi[:, first].real
        # Of a Jordan block: the derivative.
        slope = (phi - k * functions[k + 1])[:, first].real
        table[:, r : r + pairs] = np.where(jordan, 0.0, phi[:, first].imag)
        table[:, r + pairs :] = np.where(jordan, h * found.back * slope, -phi[:, first].imag)
    return tables
