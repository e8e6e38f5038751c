"""Which nonlinear terms the lifting of a slow manifold keeps.

With all of them it follows the training runs more closely, and others less; and it takes longer.
"""

from dataclasses import replace

import numpy as np

from vehiclemor.reduction.vehicle.features import Features
from vehiclemor.reduction.vehicle.regression import forward_selection, largest, ridge_fit
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.reduction.vehicle.slow_features import FeatureTable

# How many: those that explain most of all states and outputs, each in parts of its range.
NONLINEAR = 8


def fitted_lifting(
    shape: VehicleShape,
    table: FeatureTable,
    columns: np.ndarray,
    deviations: np.ndarray,
    ridge: float,
) -> tuple[np.ndarray, Features]:
    """Coefficients (terms, n) of the shape's deviations from straight running, and their features.

    Parameters
    ----------
    columns, deviations
        Features of the table (samples, terms), and deviations (samples, n) that they fit.
    """
    features, count = table.features, len(table.features.terms)
    given = [*table.odd[: table.linear_count], *table.even[: table.straight_count]]
    order = [*given, *np.setdiff1d(np.arange(count), given).tolist()]
    outputs = deviations @ shape.linearised.output_a.T
    values = np.hstack([part / largest(part) for part in (deviations, outputs)])
    chosen = forward_selection(columns[:, order], values, len(given), NONLINEAR)
    kept = sorted(order[i] for i in chosen)
    terms = tuple(features.terms[i] for i in kept)
    lifted = replace(features, terms=terms, groups=())
    return ridge_fit(columns[:, kept], deviations, ridge), lifted
