"""What training runs show of durations and starts, see `training_reach`."""

from collections.abc import Sequence

import numpy as np

from vehiclemor.reduction.training import Training
from vehiclemor.reduction.trust import largest_inputs
from vehiclemor.reduction.vehicle.landing import after_landing
from vehiclemor.reduction.vehicle.lifting import ROUNDING
from vehiclemor.reduction.vehicle.lifting_loops import MOVING
from vehiclemor.reduction.vehicle.reduced_vehicle import NOTHING_EXCITED, ReducedVehicle
from vehiclemor.reduction.vehicle.training_reach import (
    BESIDE,
    KNOWN,
    LONGER,
    NOTHING_KNOWN,
    SHORTEST,
    TrainingReach,
    durations,
    known_starts,
)
from vehiclemor.simulation.trajectory import Trajectory


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
        sizes = reduced.lift.states(run.time, path, run.inputs, NOTHING_EXCITED)[0]
        sizes = np.abs(sizes[:, shape.layout.size :])[:, :lateral]
        lasted.append(durations(run.time, sizes)[-1])
        sideways.append(float(sizes[0].max(initial=0.0)))
        excited = reduced.excited(run.states[0])
        at = run.time[(sizes > MOVING).any(axis=1)]
        if excited.size and len(at):
            faded.append(float(at[0]))
            amplitudes.append(np.hypot(*excited[1].T))
        later = after_landing(transient, shape, run)
        moving = (sizes[-len(later.time) :] > MOVING).any(axis=1)
        deviations = shape.of(later.states) - shape.reference
        decaying.append(np.abs(deviations[moving] @ transient.left.T).max(axis=0, initial=0.0))
        left.append(np.abs(reduced.remainder(later.states, later.inputs)).max(axis=0))
        starts.append(reduced.remainder(run.states[:1], run.inputs[:1], excited)[0])
    leaves, steered = np.max(left, axis=0), np.max(decaying, axis=0)
    lasted, longest = np.max(lasted, axis=0), max(run.time[-1] for run in runs)
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
        **known_starts(np.array(starts), leaves),
        inputs=KNOWN[:, : len(shape.model.inputs)] * largest_inputs(maneuvers),
    )
