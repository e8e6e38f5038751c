"""Analytic derivatives of the rates of a system, whole or projected onto a subspace."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vehiclemor.simulation.kernel_derivatives import CONSTANTS, STATE, along, partial
from vehiclemor.simulation.projection_windows import ProjectionWindows
from vehiclemor.simulation.system import System


class Along(NamedTuple):
    """What derivatives are taken by: an argument of the kernels, of the constants directions."""

    place: int
    directions: np.ndarray = np.zeros((0, 0))


class _Slopes(NamedTuple):
    """Derivatives of a system's kernels at states that change themselves."""

    system: System
    inputs: np.ndarray
    by: Along

    def of(self, name: str, x: np.ndarray, moved: np.ndarray, size: int) -> np.ndarray:
        """Derivatives (size, k) of a kernel at x (n,) that moves with its own (n, k)."""
        kernels, arrays = self.system.kernels, (x, self.inputs, self.system.constants)
        found = along(kernels, name, arrays, size, STATE, np.ascontiguousarray(moved.T)).T
        if self.by.place == CONSTANTS:
            found = found + along(kernels, name, arrays, size, *self.by).T
        elif self.by.place != STATE:
            found = found + partial(kernels, name, arrays, size, self.by.place)
        return found


def rate_derivatives(
    system: System,
    windows: ProjectionWindows,
    window: int,
    state: np.ndarray,
    inputs: np.ndarray,
    by: Along,
    from_state: bool = False,
) -> np.ndarray:
    """Derivatives (n, columns) of `Stepper.rates` in a window, whose origin may be the state."""
    n, arrays = len(state), (state, inputs, system.constants)
    if windows.formulation == "full":
        if by.place == CONSTANTS:
            return along(system.kernels, "derivative", arrays, n, *by).T
        return partial(system.kernels, "derivative", arrays, n, by.place)
    rank, mean = int(windows.ranks[window]), state if from_state else windows.means[window]
    trial, test = windows.trial_basis[window, :rank], windows.test_basis[window, :rank]
    columns = {STATE: n, CONSTANTS: len(by.directions)}.get(by.place, len(inputs))
    moved = np.eye(n) if by.place == STATE else np.zeros((n, columns))
    slopes = _Slopes(system, inputs, by)
    if windows.formulation == "state":
        onto = trial.T @ test
        place = mean + onto @ (state - mean)
        return onto @ slopes.of("derivative", place, moved if from_state else onto @ moved, n)
    half = n // 2
    bases = trial[: rank // 2, :half], test[: rank // 2, :half]
    return _of_coordinates(slopes, state, moved, None if from_state else mean, bases)


def _of_coordinates(
    slopes: _Slopes,
    state: np.ndarray,
    moved: np.ndarray,
    mean: np.ndarray | None,
    bases: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """The same where the equations of motion are projected; step by step as in `Stepper.rates`.

    Without a mean the coordinates themselves are the origin.
    """
    (trial, test), half, system = bases, len(state) // 2, slopes.system
    onto = trial.T @ test

    def value(name: str, x: np.ndarray, size: int) -> np.ndarray:
        return system.along(name, x[None], slopes.inputs[None], size)[0]

    q, dq = state[:half], moved[:half]
    if mean is not None:
        q, dq = mean[:half] + onto @ (q - mean[:half]), onto @ dq
    rates = onto @ value("derivative", state, 2 * half)[:half]
    drates = onto @ slopes.of("derivative", state, moved, 2 * half)[:half]
    turned, dturned = np.concatenate([q, rates]), np.vstack([dq, drates])
    place = np.concatenate([q, value("speeds", turned, half)])
    dplace = np.vstack([dq, slopes.of("speeds", turned, dturned, half)])
    size = half * (half + 1)
    table = value("second_order", place, size).reshape(half, half + 1)
    dtable = slopes.of("second_order", place, dplace, size).reshape(half, half + 1, -1)
    mass, force, dmass, dforce = table[:, :half], table[:, half], dtable[:, :half], dtable[:, half]
    small = trial @ mass @ trial.T
    reduced = np.linalg.solve(small, trial @ force) @ trial
    free = np.linalg.solve(mass, force)

    def left(accelerations: np.ndarray) -> np.ndarray:
        return dforce - np.einsum("ijk,j->ik", dmass, accelerations)

    dreduced = trial.T @ np.linalg.solve(small, trial @ left(reduced))
    dfree = np.linalg.solve(mass, left(free))
    change, dchange = np.concatenate([q, reduced - free]), np.vstack([dq, dreduced - dfree])
    own = slopes.of("derivative", place, dplace, 2 * half)[half:]
    return np.vstack([drates, own + slopes.of("speeds", change, dchange, half)])
