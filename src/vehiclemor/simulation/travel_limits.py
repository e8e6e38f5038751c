"""Reachable travel of a mechanism, found by continuation from its design position."""

from __future__ import annotations

import numpy as np

from vehiclemor.errors import UnreachableError
from vehiclemor.simulation.model import Model

# Steps of the continuation (m): larger Newton steps can jump to another branch beyond the fold.
FIRST_STEP = 5e-4
LAST_STEP = 1e-6
# Newton's method needs 3 to 4 iterations on the branch.
ITERATIONS = 12
TOLERANCE = 1e-11
# Change of a coordinate (rad or m) in one step that can only be a jump to another branch.
LARGEST_CHANGE = 0.1


def reachable_range(model: Model, rack: float, limit: float) -> tuple[float, float]:
    """Lowest and highest reachable height (m) at a rack displacement.

    Parameters
    ----------
    model
        Kinematic model with inputs (height, rack displacement).
    rack
        Rack displacement in m.
    limit
        Travel in m at which the search ends.

    Returns
    -------
    tuple of float
        Both limits, to 2e-6 m, on the side that can be reached.

    Raises
    ------
    UnreachableError
        If not even the design height can be reached at this rack displacement.
    """
    q = model.start()
    steps = max(1, int(np.ceil(abs(rack) / FIRST_STEP)))
    for step in range(1, steps + 1):
        moved = _solve(model, q, np.array([0.0, rack * step / steps]))
        if moved is None:
            raise UnreachableError(
                f"{model.name}: rack displacement {rack:g} m is out of reach at the design height"
            )
        q = moved
    return _limit(model, q, rack, -limit), _limit(model, q, rack, limit)


def _limit(model: Model, q: np.ndarray, rack: float, limit: float) -> float:
    direction = 1.0 if limit > 0.0 else -1.0
    step, travelled = FIRST_STEP, 0.0
    sign = _orientation(model, q, np.array([0.0, rack]))
    while travelled < abs(limit):
        u = np.array([direction * (travelled + step), rack])
        moved = _solve(model, q, u)
        # At a fold the Jacobian's determinant changes its sign.
        if moved is not None and _orientation(model, moved, u) == sign:
            q, travelled = moved, travelled + step
            continue
        step /= 2.0
        if step < LAST_STEP:
            break
    return direction * travelled


def _orientation(model: Model, q: np.ndarray, u: np.ndarray) -> float:
    jacobian = model.evaluated("residual_jacobian", q, u)[:, :-1]
    return float(np.linalg.slogdet(jacobian).sign)


def _solve(model: Model, start: np.ndarray, u: np.ndarray) -> np.ndarray | None:
    q = start
    for _ in range(ITERATIONS):
        step = model.evaluated("newton_step", q, u)
        q = q - step
        if not np.isfinite(q).all() or np.abs(q - start).max() > LARGEST_CHANGE:
            return None
        if np.abs(step).max() < TOLERANCE:
            return q
    return None
