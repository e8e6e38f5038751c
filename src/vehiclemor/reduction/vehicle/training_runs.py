"""What training runs show of initial transients, and of durations and starts.

A car that is dropped leaves the ground, so that its transient is not that of the linearised car;
but soon after it has landed it is, with other amplitudes and a slightly lower speed.  How these
depend on the start's deviation is learnt: linearly, the least change that fits.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vehiclemor.reduction.training import Training
from vehiclemor.reduction.trust import largest_inputs
from vehiclemor.reduction.vehicle.decoding import (
    BESIDE,
    KNOWN,
    LONGER,
    NOTHING_KNOWN,
    ROUNDING,
    SHORTEST,
    UNLIKE,
    TrainingReach,
    Transient,
    durations,
)
from vehiclemor.reduction.vehicle.decoding_loops import MOVING
from vehiclemor.reduction.vehicle.linear_modes import SlowModes
from vehiclemor.reduction.vehicle.reduced_vehicle import NOTHING_EXCITED, ReducedVehicle
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.simulation.run_timer import one_thread
from vehiclemor.simulation.trajectory import Trajectory

# Time (s) after which a car has landed; modes that have decayed by then, to exp(-DECAYED), are
# those of the linearised car.
LANDED, DECAYED = 0.1, 4.0
# Starts whose symmetric deviation is below this (in units of the states) are straight running.
STILL = 1e-6
# Longest time (s) for which a run is looked at.
LONGEST = 1.0
# Histories of a trajectory.
PATHS = ("times", "inputs", "coordinates", "speeds", "outputs")
# Relative singular values of the starts' deviations below this are rounding.
RANK = 1e-7


def after_transient(transient: Transient, shape: VehicleShape, run: Trajectory) -> Trajectory:
    """A run without what its car does in the air; the same if it starts on the ground."""
    deviation = shape.of(run.states[:1])[0] - shape.reference
    if np.abs(transient.left @ deviation).max(initial=0.0) < STILL:
        return run
    later = run.times > 2.0 * LANDED
    return replace(run, **{name: getattr(run, name)[later] for name in PATHS})


def with_transients(
    reduced: ReducedVehicle, modes: SlowModes, runs: Sequence[Trajectory]
) -> ReducedVehicle:
    """The reduced vehicle with the transients and coordinates of runs before they are steered."""
    from scipy.linalg import block_diag, expm

    transient, shape, k = reduced.transient, reduced.shape, modes.lateral
    slow = np.abs(np.real(transient.rates)) * LANDED < DECAYED
    # What is seen of a deviation, and how it moves; the speed, which is last, does not.
    seeing = np.vstack([transient.left[slow], reduced.encoding[k:]])
    rates = block_diag(np.diag(transient.rates[slow]), modes.rates[k:, k:], 0.0)
    # Another speed excites nothing.
    starts, changes = [modes.speed_right], [np.zeros(len(seeing), dtype=complex)]
    for run in runs:
        steered = run.times[run.inputs.any(axis=1)]
        still = (run.times >= LANDED) & (run.times < np.append(steered, LONGEST)[0])
        if not still.any():
            continue
        start = shape.of(run.states[:1])[0] - shape.reference
        seen = (shape.of(run.states[still]) - shape.reference) @ seeing.T
        # The library of SciPy is loaded only now.
        with one_thread():
            moves = np.vstack([expm(rates * time) for time in run.times[still]])
        starts.append(start)
        changes.append(np.linalg.lstsq(moves, seen.ravel())[0] - seeing @ start)
    change = (np.linalg.pinv(np.array(starts), rcond=RANK) @ np.array(changes)).T
    left, encoding = transient.left.copy(), reduced.encoding.copy()
    left[slow] += change[: slow.sum()]
    encoding[k:] += change[slow.sum() :].real
    return replace(reduced, transient=replace(transient, left=left), encoding=encoding)


def training_reach(
    reduced: ReducedVehicle, training: Training, runs: Sequence[Trajectory]
) -> TrainingReach:
    """What the training runs have shown, as the reduced vehicle sees them."""
    shape, features, transient = reduced.shape, reduced.features, reduced.transient
    lateral = features.lateral
    lasted, sideways, decaying, left, starts = [], [MOVING], [], [], []
    maneuvers = [given.maneuver for given in training]
    faded, amplitudes = [], []
    for given, run in zip(training, runs, strict=True):
        path = reduced.path(given.maneuver, given.start)
        if path is None:
            return NOTHING_KNOWN
        sizes = reduced.decoder.states(run.times, path, run.inputs, NOTHING_EXCITED)[0]
        sizes = np.abs(sizes[:, shape.layout.size :])[:, :lateral]
        lasted.append(durations(run.times, sizes)[-1])
        sideways.append(float(sizes[0].max(initial=0.0)))
        excited = reduced.excited(run.states[0])
        at = run.times[(sizes > MOVING).any(axis=1)]
        if excited.size and len(at):
            faded.append(float(at[0]))
            amplitudes.append(np.hypot(*excited[1].T))
        later = after_transient(transient, shape, run)
        moving = (sizes[-len(later.times) :] > MOVING).any(axis=1)
        deviations = shape.of(later.states) - shape.reference
        decaying.append(np.abs(deviations[moving] @ transient.left.T).max(axis=0, initial=0.0))
        left.append(np.abs(reduced.remainder(later.states, later.inputs)).max(axis=0))
        starts.append(reduced.remainder(run.states[:1], run.inputs[:1], excited)[0])
    leaves, steered = np.max(left, axis=0), np.max(decaying, axis=0)
    # Directions in which starts leave more than runs do.
    _, factors, directions = np.linalg.svd(starts / leaves, full_matrices=False)
    directions = directions[factors > UNLIKE]
    lasted, longest = np.max(lasted, axis=0), max(run.times[-1] for run in runs)
    # A little may last as long as any run does, and no longer.
    lasted[:lateral, 0], lasted[lateral:, 0] = longest, longest**2
    amplitudes = np.max(amplitudes or [np.zeros_like(steered)], axis=0)
    return TrainingReach(
        LONGER * np.maximum(lasted, SHORTEST),
        max(sideways),
        BESIDE * np.maximum(steered, ROUNDING * steered.max(initial=1.0)),
        min(faded, default=0.0) / LONGER,
        np.maximum(amplitudes, ROUNDING * amplitudes.max(initial=0.0)),
        leaves,
        directions,
        np.abs(starts / leaves @ directions.T).max(axis=0),
        KNOWN[:, : len(shape.model.inputs)] * largest_inputs(maneuvers),
    )
