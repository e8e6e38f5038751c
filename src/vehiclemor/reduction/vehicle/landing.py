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
from vehiclemor.simulation.trajectory import Trajectory

# Time (s) after which a car has landed; modes that have decayed by then, to exp(-DECAYED), are
# those of the linearised car.
LANDED, DECAYED = 0.1, 4.0
# Starts whose symmetric deviation is below this (in units of the states) are straight running.
STILL = 1e-6
# Relative singular values of the starts' deviations below this are rounding.
RANK = 1e-7


def starts_still(transient: Transient, shape: VehicleShape, run: Trajectory) -> bool:
    """Whether a run starts without motion that the reduced coordinates leave out."""
    deviation = shape.of(run.states[:1])[0] - shape.reference
    return bool(np.abs(transient.left @ deviation).max(initial=0.0) < STILL)


def landed(reduced: ReducedVehicle, runs: Sequence[Trajectory]) -> ReducedVehicle:
    """The reduced vehicle with the transients and the speed of runs before they are steered."""
    transient, shape = reduced.transient, reduced.shape
    slow = np.abs(transient.rates.real) * LANDED < DECAYED
    speed = reduced.encoding[-1]
    starts, changes = [], []
    for run in runs:
        steered = np.flatnonzero(run.inputs.any(axis=1))
        last = int(steered[0]) if len(steered) else len(run.time)
        deviations = shape.of(run.states[:last]) - shape.reference
        after = run.time[:last] >= LANDED
        if not after.any():
            continue
        decays = np.exp(np.outer(run.time[:last][after], transient.rates[slow]))
        seen = deviations[after] @ transient.left[slow].T
        found = (decays.conj() * seen).sum(axis=0) / (np.abs(decays) ** 2).sum(axis=0)
        lost = np.mean(deviations[after] @ speed) - deviations[0] @ speed
        starts.append(deviations[0])
        changes.append([*(found - transient.left[slow] @ deviations[0]), lost])
    if not starts:
        return reduced
    change = (np.linalg.pinv(np.array(starts), rcond=RANK) @ np.array(changes)).T
    left, encoding = transient.left.copy(), reduced.encoding.copy()
    left[slow] += change[:-1]
    encoding[-1] += change[-1].real
    return replace(reduced, transient=replace(transient, left=left), encoding=encoding)
