"""Starts far from straight running: what decays of them, learnt from training runs.

A car that is dropped leaves the ground, so that its transient is not that of the linearised car;
but soon after it has landed it is, with other amplitudes and a slightly lower speed.  How these
depend on the start's deviation is learnt: linearly, the least change that fits.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle, Transient
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.reduction.vehicle.slow_modes import SlowModes
from vehiclemor.simulation.trajectory import Trajectory

# Time (s) after which a car has landed; modes that have decayed by then, to exp(-DECAYED), are
# those of the linearised car.
LANDED, DECAYED = 0.1, 4.0
# Starts whose symmetric deviation is below this (in units of the states) are straight running.
STILL = 1e-6
# Longest time (s) for which a run is looked at.
LONGEST = 1.0
# Histories of a trajectory.
PATHS = ("time", "inputs", "coordinates", "speeds", "outputs")
# Relative singular values of the starts' deviations below this are rounding.
RANK = 1e-7


def after_landing(transient: Transient, shape: VehicleShape, run: Trajectory) -> Trajectory:
    """A run without what its car does in the air; the same if it starts on the ground."""
    deviation = shape.of(run.states[:1])[0] - shape.reference
    if np.abs(transient.left @ deviation).max(initial=0.0) < STILL:
        return run
    later = run.time > 2.0 * LANDED
    return replace(run, **{name: getattr(run, name)[later] for name in PATHS})


def landed(reduced: ReducedVehicle, modes: SlowModes, runs: Sequence[Trajectory]) -> ReducedVehicle:
    """The reduced vehicle with the transients and coordinates of runs before they are steered."""
    from scipy.linalg import block_diag, expm

    transient, shape, k = reduced.transient, reduced.shape, modes.lateral
    slow = np.abs(transient.rates.real) * LANDED < DECAYED
    # What is seen of a deviation, and how it moves; the speed, which is last, does not.
    seeing = np.vstack([transient.left[slow], reduced.encoding[k:]])
    rates = block_diag(np.diag(transient.rates[slow]), modes.rates[k:, k:], 0.0)
    starts, changes = [], []
    for run in runs:
        steered = run.time[run.inputs.any(axis=1)]
        still = (run.time >= LANDED) & (run.time < np.append(steered, LONGEST)[0])
        if not still.any():
            continue
        start = shape.of(run.states[:1])[0] - shape.reference
        seen = (shape.of(run.states[still]) - shape.reference) @ seeing.T
        moves = expm(rates * run.time[still][:, None, None]).reshape(-1, len(rates))
        starts.append(start)
        changes.append(np.linalg.lstsq(moves, seen.ravel())[0] - seeing @ start)
    if not starts:
        return reduced
    change = (np.linalg.pinv(np.array(starts), rcond=RANK) @ np.array(changes)).T
    left, encoding = transient.left.copy(), reduced.encoding.copy()
    left[slow] += change[: slow.sum()]
    encoding[k:] += change[slow.sum() :].real
    return replace(reduced, transient=replace(transient, left=left), encoding=encoding)
