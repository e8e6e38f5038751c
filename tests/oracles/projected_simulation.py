"""Constrained models without stabilisation: a check of what Baumgarte's terms do to a run.

The gains are set to zero, which leaves the equations of index 1, and the states are projected onto
the constraints and onto their rates again and again: E. Hairer, G. Wanner, Solving Ordinary
Differential Equations II (2nd ed., Springer 1996), section VII.2.  Slow; not for comparisons of
time.
"""

from itertools import pairwise

import numpy as np

from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.simulation.build import build
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.trajectory import Trajectory

GAINS = ("baumgarte_a", "baumgarte_b")
# Violations (m, m/s) that are left.
CLOSED = 1e-13
MOST_ITERATIONS = 20


def without_stabilisation(model: DynamicModel) -> DynamicModel:
    """The same model with its constraints on accelerations alone."""
    values = {name: entry.value for name, entry in model.parameters.entries.items()}
    free = build(model.name, overrides=values | dict.fromkeys(GAINS, 0.0))
    assert isinstance(free, DynamicModel)
    return free


def projected_state(model: DynamicModel, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """The nearest state (2 n,) that holds the constraints, and its rates nearest to those given.

    Nearest in the metric of the mass matrix, so that heavy parts move least.
    """
    n = len(model.coordinates)
    x = np.array(x, dtype=float)
    for _ in range(MOST_ITERATIONS):
        gaps, _ = model.violations(x, u)
        if np.abs(gaps).max() < CLOSED:
            break
        x[:n] += _shortest(model, x, u, -gaps)
    else:
        raise ValueError("the constraints can't be closed from this state")
    # The rates are linear in the speeds.
    _, rates = model.violations(x, u)
    x[n:] += _shortest(model, x, u, -rates)
    return x


def _shortest(model: DynamicModel, x: np.ndarray, u: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Shortest step (n,) that changes the constraints by a given amount, to first order."""
    mass, _, constraints, _ = model.descriptor(x, u)
    towards = np.linalg.solve(mass, constraints.T)
    return towards @ np.linalg.solve(constraints @ towards, change)


def simulate_projected(
    model: DynamicModel, maneuver: Maneuver, start: str, tolerance: float
) -> Trajectory:
    """Full-order trajectory without stabilisation, projected at every output time."""
    free = without_stabilisation(model)
    times, inputs = maneuver.times, maneuver.at(maneuver.times)
    path, counts = [projected_state(free, model.start(start), inputs[0])], 0
    for (a, b), u in zip(pairwise(times), inputs[1:], strict=True):
        part = free.simulate(maneuver, path[-1], [b], tolerance=tolerance, begin=a)
        counts += np.array(list(part.counts.values()))
        path.append(projected_state(free, part.states[-1], u))
    return free.trajectory(times, inputs, np.array(path), counts, 0.0)
