"""Constrained models without stabilisation: a check of what Baumgarte's terms do to a run.

The gains are set to zero, which leaves the equations of index 1, and the states are projected onto
the constraints and onto their rates again and again: E. Hairer, G. Wanner, Solving Ordinary
Differential Equations II (2nd ed., Springer 1996), section VII.2.  Slow; not for comparisons of
time.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from vehiclemor.errors import ConvergenceError, InputError
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.simulation.build import build
from vehiclemor.simulation.dynamic import REFERENCE_TOLERANCE, DynamicModel
from vehiclemor.simulation.projection_windows import whole_space
from vehiclemor.simulation.trajectory import DYNAMIC_COUNTS, Trajectory

GAINS = ("baumgarte_a", "baumgarte_b")
# Violations (m, m/s) that are left.
CLOSED = 1e-13
MOST_ITERATIONS = 20


def without_stabilisation(model: DynamicModel) -> DynamicModel:
    """The same model with its constraints on accelerations alone.

    Raises
    ------
    InputError
        If the model has no stabilised constraints.
    """
    if not set(GAINS) <= set(model.parameters.entries):
        raise InputError(f"{model.name} has no constraints that are stabilised")
    values = {name: entry.value for name, entry in model.parameters.entries.items()}
    free = build(model.name, overrides=values | dict.fromkeys(GAINS, 0.0))
    assert isinstance(free, DynamicModel)
    return free


def projected_state(model: DynamicModel, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """The nearest state (2 n,) that holds the constraints, and its rates nearest to those given.

    Nearest in the metric of the mass matrix, so that heavy parts move least.

    Raises
    ------
    ConvergenceError
        If no such state is found nearby.
    """
    n = len(model.coordinates)
    x = np.array(x, dtype=float)
    for _ in range(MOST_ITERATIONS):
        gaps, _ = model.violations(x, u)
        if np.abs(gaps).max() < CLOSED:
            break
        x[:n] += _shortest(model, x, u, -gaps)
    else:
        raise ConvergenceError(f"{model.name}: the constraints can't be closed from this state")
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
    model: DynamicModel,
    maneuver: Maneuver,
    start: str | None = None,
    tolerance: float = REFERENCE_TOLERANCE,
) -> Trajectory:
    """Full-order trajectory without stabilisation, projected at every output time.

    Parameters
    ----------
    model
        With speeds that are the rates of its coordinates.

    Raises
    ------
    InputError
        If the model has no stabilised constraints.
    ConvergenceError
        If the run or a projection fails.
    """
    free = without_stabilisation(model)
    times, inputs = maneuver.times, maneuver.at(maneuver.times)
    x = projected_state(free, model.start(start), inputs[0])
    path, counts = [x], np.zeros(len(DYNAMIC_COUNTS), dtype=np.int64)
    space = whole_space(2 * len(model.coordinates))
    for (a, b), u in zip(pairwise(times), inputs[1:], strict=True):
        part = free.integrate(_later(maneuver, a, b), x, space, "dopri5", tolerance)
        if part.status != "ok":
            raise ConvergenceError(f"{model.name}: {part.message} after t = {a:g} s")
        counts += list(part.counts.values())
        x = projected_state(free, part.states[-1], u)
        path.append(x)
    return free.trajectory(times, inputs, np.array(path), counts, 0.0)


def _later(maneuver: Maneuver, begin: float, end: float) -> Maneuver:
    """The part of a maneuver from one time to another, which becomes a maneuver of its own."""

    def signal(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
        return maneuver.signal(times + begin, frequency, amplitude)

    def corners(frequency: float) -> tuple[float, ...]:
        return tuple(t - begin for t in maneuver.corners(frequency) if begin < t < end)

    return replace(maneuver, signal=signal, corners=corners, duration=end - begin, samples=2)
