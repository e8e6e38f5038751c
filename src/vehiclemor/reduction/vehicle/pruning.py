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

from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.regression import unit_diagonal
from vehiclemor.reduction.vehicle.slow_features import FeatureTable
from vehiclemor.reduction.vehicle.trajectory_fit import Target, normal_matrix

# Of the normal matrix, scaled to a diagonal of ones: nearly dependent features are told apart.
REGULARISATION = 1e-11


def pruned(
    reduced: ReducedVehicle, table: FeatureTable, goals: Sequence[Target], kept: int
) -> tuple[ReducedVehicle, FeatureTable]:
    """A reduced vehicle of `kept` nonlinear terms; the lifting keeps its own.

    Its coefficients are best near the goals, all of which it must finish.
    """
    normal = normal_matrix(reduced, goals, table.free)
    c = reduced.coefficients.copy()
    rows, columns = np.array([(i, column) for terms, column in table.free for i in terms]).T
    nonlinear = sorted([*table.odd_nonlinear, *table.even_nonlinear])
    groups = [np.flatnonzero(rows == i).tolist() for i in nonlinear]
    left, c[rows, columns] = surviving(normal, c[rows, columns], groups, kept)
    linear = [*table.odd[: table.linear_count], *table.even[: table.straight_count]]
    stay = sorted([*linear, *(nonlinear[i] for i in left)])
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
