"""Which terms of a regression can go: the surgeon's order of elimination.

Near the minimum of a sum of squares with normal matrix H, setting the coefficients c_g of one
feature to zero and moving the others to their new optimum raises the sum by

    c_g^T ((H^-1)_gg)^-1 c_g

The feature with the least rise goes first, H^-1 is updated, and so on (B. Hassibi, D. Stork, Second
order derivatives for network pruning: optimal brain surgeon, NIPS 5 (1992), 164-171; here for
groups of coefficients, since a feature that one equation needs costs the others nothing).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vehiclemor.reduction.vehicle.feature_system import feature_columns
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.regression import unit_diagonal
from vehiclemor.reduction.vehicle.slow_features import FeatureTable
from vehiclemor.reduction.vehicle.trajectory_fit import Target, normal_matrix

# Of the normal matrix, scaled to a diagonal of ones: nearly dependent features are told apart.
REGULARISATION = 1e-11
# Number of symmetric terms for each lateral one.
SYMMETRIC = 0.25


def pruned(
    reduced: ReducedVehicle,
    table: FeatureTable,
    goals: Sequence[Target],
    slow: np.ndarray,
    kept: int,
) -> tuple[ReducedVehicle, FeatureTable]:
    """A reduced vehicle of `kept` lateral terms beyond the linear ones; the lifting keeps its own.

    Its coefficients are best near the goals, all of which it must finish; `slow` are slow
    coordinates and speed (samples, states) of the training runs.
    """
    k = reduced.features.states - 1
    normal = normal_matrix(reduced, goals, table.free)
    c = reduced.coefficients.copy()
    odd, even = table.odd_nonlinear, table.even_nonlinear
    places = [(i, column) for terms, column in table.free for i in terms]
    rows, columns = np.array(places).T
    numbers = {place: n for n, place in enumerate(places)}
    lateral = sorted({column for _, column in places})
    groups = [[numbers[i, column] for column in lateral] for i in odd]
    left, c[rows, columns] = surviving(normal, c[rows, columns], groups, kept)
    # The symmetric equations are fitted to rates; each counts by its nonlinear part.
    inputs = np.concatenate([goal.inputs for goal in goals])
    values = feature_columns(reduced.features, slow, inputs, reduced.parameters)[:, even]
    symmetric = c[np.ix_(even, [k, k + 2])]
    sizes = np.mean((values @ symmetric) ** 2, axis=0)
    weights = 1.0 / np.where(sizes > 0.0, sizes, 1.0)
    normal = np.kron(np.diag(weights), values.T @ values)
    groups = [[i, len(even) + i] for i in range(len(even))]
    most = min(len(even), max(1, round(SYMMETRIC * kept)))
    left_even, changed = surviving(normal, symmetric.T.ravel(), groups, most)
    c[np.ix_(even, [k, k + 2])] = changed.reshape(2, -1).T
    linear = [*table.odd[: table.linear_count], *table.even[:2]]
    stay = sorted([*linear, *(odd[i] for i in left), *(even[i] for i in left_even)])
    fewer = table.with_only(stay)
    return (
        replace(
            reduced,
            features=fewer.features,
            coefficients=c[stay],
            lifted_features=reduced.lifted_features or reduced.features,
        ),
        fewer,
    )


def surviving(
    normal: np.ndarray, coefficients: np.ndarray, groups: Sequence[Sequence[int]], kept: int
) -> tuple[list[int], np.ndarray]:
    """Groups that are left when all but a number of them have been eliminated.

    Parameters
    ----------
    normal
        Normal matrix (n, n) of all coefficients, also of those in no group, which stay.
    coefficients
        Their values (n,) at the minimum.
    groups
        Numbers of the coefficients of each feature that may go.
    kept
        How many groups are left.

    Returns
    -------
    tuple
        Numbers of the groups left, in order, and the coefficients (n,), zero where eliminated.
    """
    scaled, scale = unit_diagonal(normal)
    inverse = np.linalg.inv(scaled + REGULARISATION * np.eye(len(normal)))
    c = coefficients * scale
    left = list(range(len(groups)))
    while len(left) > kept:
        rises = []
        for group in left:
            g = list(groups[group])
            rises.append(c[g] @ np.linalg.solve(inverse[np.ix_(g, g)], c[g]))
        worst = left.pop(int(np.argmin(rises)))
        g = list(groups[worst])
        part = np.linalg.solve(inverse[np.ix_(g, g)], inverse[g])
        c = c - part.T @ c[g]
        inverse = inverse - inverse[:, g] @ part
        c[g] = 0.0
        # Rows of what is gone are zero but for rounding.
        inverse[g], inverse[:, g] = 0.0, 0.0
        inverse[g, g] = 1.0
    return left, c / scale
