"""Fits of reduced vehicles: regression on features, and on complete runs.

A fit of rates leaves small errors that add up along a run: a heading that is off by 1e-4 rad is a
lateral position that is off by 1 cm after 5 s.  So the coefficients are changed to bring the
reduced runs themselves nearer to the training runs.  The sensitivities of a run follow from its
variational equations, solved at the output times (E. Hairer, S. Norsett, G. Wanner, Solving
Ordinary Differential Equations I (2nd ed., Springer 1993), section I.14); steps are damped after
Levenberg and Marquardt.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vehiclemor.codegen.loops import loops
from vehiclemor.reduction.training import Training, TrainingRun
from vehiclemor.reduction.vehicle.features import PLANAR, feature_columns
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.simulation.evaluation import PATH_LOOPS
from vehiclemor.simulation.trajectory import Trajectory

# Columns of which less than this share is left are sums of those chosen before.
DEPENDENT = 1e-8
# The paper's bound on the RMS error of yaw in rad (section 3.1, 7.59e-5).
YAW_BOUND = 7.6e-5
# Errors that count as much as one of heading: position in m, part of a slow coordinate's range.
PLACE, PART = 0.03, 0.02
# The variational equations step over so many output times, runs are compared at every so many of
# their steps.
STRIDE, COMPARED = 2, 4
# Where the slow coordinates have come to rest, to this part of their range, steps are longer.
REST, LONG_STRIDE = 3e-4, 25
DIFFERENCE = 1e-6
# Least sum of squares in a weight.
NOTHING = 1e-12
DAMPING = 1e-4
MOST_DAMPING = 1e2
# Features and columns of the coefficients that may change, one entry for each.
Free = tuple[np.ndarray, np.ndarray]


def ridge_fit(columns: np.ndarray, values: np.ndarray, weight: float) -> np.ndarray:
    """Coefficients (terms, ...) of the fit of values (samples, ...) on columns (samples, terms).

    Minimises the mean square error plus `weight` times the squares of the coefficients (ridge
    regression: A. E. Hoerl, R. W. Kennard, Technometrics 12 (1970), 55-67).
    """
    normal = columns.T @ columns + weight * len(columns) * np.eye(columns.shape[1])
    return np.linalg.solve(normal, columns.T @ values)


def largest(values: np.ndarray) -> np.ndarray:
    """Largest magnitude in each column (samples, n) -> (n,); 1 where a column is zero."""
    magnitudes = np.abs(values).max(axis=0)
    return np.where(magnitudes > 0.0, magnitudes, 1.0)


def sizes(values: np.ndarray) -> np.ndarray:
    """Root mean square of each column (samples, n) -> (n,); 1 where a column is zero."""
    mean = np.sqrt(np.mean(values**2, axis=0))
    return np.where(mean > 0.0, mean, 1.0)


def forward_selection(columns: np.ndarray, values: np.ndarray, given: int, more: int) -> list[int]:
    """Indices of the columns that explain most, one after the other (orthogonal least squares).

    S. Chen, S. A. Billings, W. Luo, Int. J. Control 50 (1989), 1873-1896.

    The first `given` columns (samples, terms) are chosen already, `more` beside them; all values
    (samples, targets) count the same, whatever their sizes.
    """
    columns = columns / sizes(columns)
    normal, products = columns.T @ columns, columns.T @ (values / sizes(values))
    least = DEPENDENT * len(columns)
    chosen: list[int] = []
    while len(chosen) < min(given + more, len(normal)):
        if len(chosen) < given:
            best = len(chosen)
        else:
            left = np.diag(normal)
            gains = np.sum(products**2, axis=1) / np.maximum(left, least)
            gains[(left <= least) | np.isin(np.arange(len(gains)), chosen)] = -1.0
            best = int(np.argmax(gains))
        chosen.append(best)
        if normal[best, best] > least:
            row = normal[best] / normal[best, best]
            products = products - np.outer(row, products[best])
            normal = normal - np.outer(row, normal[best])
    return chosen


@dataclass(frozen=True)
class Target:
    """One training run in reduced states (samples, states + 3), as a reduced run should be.

    `steps` are indices of the output times that the variational equations step on, `scale` are
    weights (states + 3,) of errors.
    """

    run: TrainingRun
    times: np.ndarray
    inputs: np.ndarray
    states: np.ndarray
    steps: np.ndarray
    scale: np.ndarray

    @cached_property
    def compared(self) -> np.ndarray:
        """Indices of the output times at which runs are compared, the last one among them."""
        return self.steps[(len(self.steps) - 1) % COMPARED :: COMPARED]

    @cached_property
    def shares(self) -> np.ndarray:
        """Root of the part of the run's time that each of them stands for."""
        widths = np.gradient(self.times[self.compared])
        return np.sqrt(widths / widths.sum())


def targets_of(
    reduced: ReducedVehicle, training: Training, runs: Sequence[Trajectory], heading: float
) -> list[Target]:
    """Training runs in reduced states; `heading` is the error in rad that counts as `PLACE`."""
    k, result = reduced.features.states - 1, []
    paths = [reduced.encoded_path(true.states, true.inputs) for true in runs]
    ranges = np.max([np.abs(states[:, :k]).max(axis=0) for states in paths], axis=0)
    # The speed counts by the position.
    weights = np.array([0.0, 1.0 / heading, 1.0 / PLACE, 1.0 / PLACE])
    scale = np.concatenate([1.0 / (PART * ranges), weights])
    for run, true, states in zip(training, runs, paths, strict=True):
        z = states[:, : k + 1]
        moved = np.abs(z[:, :k] - z[-1, :k]).max(axis=1)
        restless = np.flatnonzero(moved > REST * moved.max())
        last = len(z) - 1
        rest = int(restless[-1]) if len(restless) else 0
        steps = [*range(0, rest, STRIDE), *range(rest, last, LONG_STRIDE), last]
        result.append(Target(run, true.times, true.inputs, states, np.array(steps), scale))
    return result


def improved(
    reduced: ReducedVehicle,
    targets: Sequence[Target],
    free: Sequence[tuple[Sequence[int], int]],
    steps: int,
) -> ReducedVehicle:
    """The reduced vehicle after so many damped Gauss-Newton steps of its free coefficients.

    Free are indices of features, each with the column of their coefficients.  The sum of the runs'
    errors is minimised, not that of their squares (iteratively reweighted least squares): the worst
    runs, near a spin, count no more than the others.
    """
    paths, error = _compared(reduced, targets)
    terms = np.concatenate([features for features, _ in free])
    columns = np.repeat([column for _, column in free], [len(features) for features, _ in free])
    change, moved, damping = np.zeros(len(terms)), reduced, DAMPING
    for _ in range(steps):
        if not np.isfinite(error):
            break
        normal, gradient = normal_equations(moved, targets, paths, (terms, columns))
        scale = np.sqrt(np.diag(normal))
        # Of a feature that is zero in all samples.
        scale[scale == 0.0] = 1.0
        scaled = normal / np.outer(scale, scale)
        while damping < MOST_DAMPING:
            step = np.linalg.solve(scaled + damping * np.eye(len(scale)), gradient / scale) / scale
            coefficients = reduced.coefficients.copy()
            coefficients[terms, columns] += change - step
            candidate = replace(reduced, coefficients=coefficients)
            new, new_error = _compared(candidate, targets)
            if new_error < error:
                change, moved, paths, error = change - step, candidate, new, new_error
                damping *= 0.1
                break
            damping *= 10.0
    return moved


def _compared(reduced: ReducedVehicle, targets: Sequence[Target]) -> tuple[list[np.ndarray], float]:
    """Reduced runs, and the sum of their errors; infinite if one has failed."""
    paths, total = [], 0.0
    for target in targets:
        path = reduced.path(target.run.maneuver, target.run.start)
        if path is None:
            return [], np.inf
        paths.append(path)
        total += float(np.linalg.norm(_errors(target, path)))
    return paths, total


def _errors(target: Target, path: np.ndarray) -> np.ndarray:
    """Weighted errors (compared times, states + 3) of a reduced run."""
    return (path - target.states)[target.compared] * target.scale * target.shares[:, None]


def normal_equations(
    reduced: ReducedVehicle,
    targets: Sequence[Target],
    paths: Sequence[np.ndarray],
    free: Free,
) -> tuple[np.ndarray, np.ndarray]:
    """Normal matrix and gradient of the sum of errors by the free coefficients."""
    size = len(free[0])
    normal, gradient = np.zeros((size, size)), np.zeros(size)
    for target, path in zip(targets, paths, strict=True):
        rows = _sensitivities(reduced, target, path, free).reshape(-1, size)
        error = _errors(target, path).ravel()
        weight = max(error @ error, NOTHING) ** -0.5
        normal += weight * (rows.T @ rows)
        gradient += weight * (rows.T @ error)
    return normal, gradient


def _sensitivities(
    reduced: ReducedVehicle, target: Target, path: np.ndarray, free: Free
) -> np.ndarray:
    """Derivatives (compared times, states + 3, free coefficients) of `_errors`."""
    k, c = reduced.features.states, reduced.coefficients
    steps = target.steps
    path, inputs, times = path[steps], target.inputs[steps], target.times[steps]
    z, samples = path[:, :k], len(times)
    # One copy as it is, then one with each coordinate moved.
    widths = DIFFERENCE * np.maximum(1.0, np.abs(z).max(axis=0))
    shifts = np.vstack([np.zeros(k), np.diag(widths)])
    moved = (z + shifts[:, None]).reshape(-1, k)
    columns = feature_columns(
        reduced.features, moved, np.tile(inputs, (k + 1, 1)), reduced.parameters
    )
    rates = (columns @ c).reshape(k + 1, samples, -1)
    values, others = rates[0], rates[1:]
    slopes = ((others - values) / widths[:, None, None]).transpose(1, 2, 0)
    # (z', psi', U, V) turned into rates of the state.
    dim, cosine, sine = k + PLANAR, np.cos(path[:, k]), np.sin(path[:, k])
    turns = np.tile(np.eye(dim), (samples, 1, 1))
    turns[:, -2:, -2:] = np.moveaxis(np.array([[cosine, -sine], [sine, cosine]]), -1, 0)
    jacobian = np.zeros((samples, dim, dim))
    jacobian[:, :, :k] = turns @ slopes
    # Turning by a right angle is the derivative by the heading.
    jacobian[:, -2:, k] = np.einsum("nij,nj->ni", turns[:, -2:, -2:], values[:, [-1, -2]] * [-1, 1])
    half = 0.5 * np.diff(times)[:, None, None]
    inverse = np.linalg.inv(np.eye(dim) - half * jacobian[1:])
    advance = inverse @ (np.eye(dim) + half * jacobian[:-1])
    now, before = half * inverse @ turns[1:], half * inverse @ turns[:-1]
    terms, targets = free
    driven = columns[:samples, None, terms]
    forcing = np.take(now, targets, axis=2) * driven[1:]
    forcing += np.take(before, targets, axis=2) * driven[:-1]
    result = np.zeros((samples, dim, len(targets)))
    loop = loops(PATH_LOOPS, ("recurrence",))["recurrence"]
    loop(advance, forcing, result)
    weights = target.shares[:, None] * target.scale
    return weights[:, :, None] * result[(samples - 1) % COMPARED :: COMPARED]
