"""Coefficients of a reduced vehicle improved on whole trajectories (Gauss-Newton).

A fit of rates leaves small errors that add up along a run: a heading that is off by 1e-4 rad is a
lateral position that is off by 1 cm after 5 s.  So the coefficients are changed to bring the
reduced runs themselves nearer to the training runs.  The sensitivities of a run follow from its
variational equations, solved at the output times (E. Hairer, S. Norsett, G. Wanner, Solving
Ordinary Differential Equations I (2nd ed., Springer 1993), section I.14); steps are damped after
Levenberg and Marquardt.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vehiclemor.reduction.training import Training, TrainingRun
from vehiclemor.reduction.vehicle.feature_system import feature_columns
from vehiclemor.reduction.vehicle.features import PLANAR
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.regression import unit_diagonal
from vehiclemor.simulation.trajectory import Trajectory

# Errors that count the same: heading in rad, lateral position in m, part of a slow coordinate's
# range.
HEADING, POSITION, PART = 1e-4, 0.02, 0.01
# Runs are compared at every fifth output time.
STRIDE = 5
DIFFERENCE = 1e-6
DAMPING = 1e-4
MOST_DAMPING = 1e2
# (numbers of features, column) of the coefficients that may change.
Free = Sequence[tuple[Sequence[int], int]]


@dataclass(frozen=True)
class Target:
    """One training run as a reduced run should be.

    Attributes
    ----------
    times, inputs
        Output times (samples,) in s, and inputs (samples, inputs) then.
    states
        Reduced states (samples, states + 3): coordinates, heading, place.
    """

    run: TrainingRun
    times: np.ndarray
    inputs: np.ndarray
    states: np.ndarray


def targets(
    reduced: ReducedVehicle, training: Training, runs: Sequence[Trajectory]
) -> list[Target]:
    """Training runs in reduced states."""
    x, y, heading = reduced.model.planar
    result = []
    for run, true in zip(training, runs, strict=True):
        deviations = reduced.shape.of(true.states) - reduced.shape.reference
        z = deviations @ reduced.encoding.T - true.inputs @ reduced.feedthrough.T
        states = np.hstack([z, true.states[:, [heading, x, y]]])
        result.append(Target(run, true.time, true.inputs, states))
    return result


def improved(
    reduced: ReducedVehicle, goals: Sequence[Target], free: Free, sweeps: int
) -> ReducedVehicle:
    """The reduced vehicle after so many sweeps, damped Gauss-Newton steps."""
    paths, error = _compared(reduced, goals)
    damping = DAMPING
    for _ in range(sweeps):
        if not np.isfinite(error):
            break
        normal, gradient = _normal_equations(reduced, goals, paths, free)
        scaled, scale = unit_diagonal(normal)
        while damping < MOST_DAMPING:
            step = np.linalg.solve(scaled + damping * np.eye(len(scale)), gradient / scale) / scale
            candidate = _changed(reduced, free, -step)
            new_paths, new_error = _compared(candidate, goals)
            if new_error < error:
                reduced, paths, error = candidate, new_paths, new_error
                damping *= 0.1
                break
            damping *= 10.0
    return reduced


def finishes(reduced: ReducedVehicle, goals: Sequence[Target]) -> bool:
    """Whether all reduced training runs come to their end."""
    return bool(np.isfinite(_compared(reduced, goals)[1]))


def normal_matrix(reduced: ReducedVehicle, goals: Sequence[Target], free: Free) -> np.ndarray:
    """Normal matrix of the free coefficients, column by column; all runs must finish."""
    paths, _ = _compared(reduced, goals)
    return _normal_equations(reduced, goals, paths, free)[0]


def _changed(reduced: ReducedVehicle, free: Free, step: np.ndarray) -> ReducedVehicle:
    coefficients, first = reduced.coefficients.copy(), 0
    for terms, column in free:
        coefficients[list(terms), column] += step[first : first + len(terms)]
        first += len(terms)
    return replace(reduced, coefficients=coefficients)


def _compared(reduced: ReducedVehicle, goals: Sequence[Target]) -> tuple[list[np.ndarray], float]:
    """Reduced runs, and the sum of their squared errors; infinite if one has failed."""
    paths, total = [], 0.0
    scale = _scale(goals)
    for goal in goals:
        path = reduced.path(goal.run.maneuver, goal.run.start)
        if path is None:
            return [], np.inf
        paths.append(path)
        total += float(np.sum(((path - goal.states)[::STRIDE] * scale) ** 2))
    return paths, total


def _scale(goals: Sequence[Target]) -> np.ndarray:
    """Weights (states + 3,) of errors; the speed and the way along the road don't count."""
    slow = goals[0].states.shape[1] - PLANAR - 1
    ranges = np.max([np.abs(goal.states[:, :slow]).max(axis=0) for goal in goals], axis=0)
    return np.concatenate([1.0 / (PART * ranges), [0.0, 1.0 / HEADING, 0.0, 1.0 / POSITION]])


def _normal_equations(
    reduced: ReducedVehicle, goals: Sequence[Target], paths: Sequence[np.ndarray], free: Free
) -> tuple[np.ndarray, np.ndarray]:
    scale = _scale(goals)
    kept = np.flatnonzero(scale)
    size = sum(len(terms) for terms, _ in free)
    normal, gradient = np.zeros((size, size)), np.zeros(size)
    for goal, path in zip(goals, paths, strict=True):
        sensitivity = _sensitivities(reduced, goal, path, free)[:, kept] * scale[kept][:, None]
        rows = sensitivity.reshape(-1, size)
        error = ((path - goal.states)[::STRIDE] * scale)[:, kept].ravel()
        normal += rows.T @ rows
        gradient += rows.T @ error
    return normal, gradient


def _sensitivities(
    reduced: ReducedVehicle, goal: Target, path: np.ndarray, free: Free
) -> np.ndarray:
    """Derivatives (samples / STRIDE, states + 3, free coefficients) of a reduced run."""
    k, c = reduced.features.states, reduced.coefficients
    z, heading = path[:, :k], path[:, k]
    columns = feature_columns(reduced.features, z, goal.inputs, reduced.parameters)
    values = columns @ c
    dim, samples = k + PLANAR, len(path)
    cosine, sine = np.cos(heading), np.sin(heading)
    # Derivatives of the states' rates by the columns z', psi', U and V of C phi.
    spread = np.zeros((samples, dim, dim))
    spread[:, range(k + 1), range(k + 1)] = 1.0
    spread[:, k + 1, k + 1], spread[:, k + 1, k + 2] = cosine, -sine
    spread[:, k + 2, k + 1], spread[:, k + 2, k + 2] = sine, cosine
    jacobian = np.zeros((samples, dim, dim))
    for j in range(k):
        width = DIFFERENCE * max(1.0, float(np.abs(z[:, j]).max()))
        shifted = z.copy()
        shifted[:, j] += width
        change = (
            feature_columns(reduced.features, shifted, goal.inputs, reduced.parameters) @ c - values
        )
        jacobian[:, :, j] = np.einsum("nij,nj->ni", spread, change / width)
    forward, sideward = values[:, k + 1], values[:, k + 2]
    jacobian[:, k + 1, k] = -forward * sine - sideward * cosine
    jacobian[:, k + 2, k] = forward * cosine - sideward * sine
    forcing = np.concatenate(
        [spread[:, :, [column]] * columns[:, None, list(terms)] for terms, column in free], axis=2
    )
    # The trapezoidal rule, for all coefficients at once.
    half = 0.5 * np.diff(goal.times)[:, None, None]
    identity = np.eye(dim)
    inverse = np.linalg.inv(identity - half * jacobian[1:])
    advance = inverse @ (identity + half * jacobian[:-1])
    pushed = inverse @ (half * (forcing[1:] + forcing[:-1]))
    current = np.zeros(forcing.shape[1:])
    kept = [current]
    for n in range(samples - 1):
        current = advance[n] @ current + pushed[n]
        if (n + 1) % STRIDE == 0:
            kept.append(current)
    return np.array(kept)
