"""How far a reduced mechanism's run is from that of the full model, found after the run.

The constraint equations say at each sample where the mechanism is.  Newton's method in vector lanes
goes there from extrapolated positions in little more than one step a sample: a correction of the
decoded coordinates takes as many, and can't tell on which branch they are.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from vehiclemor.inputs.excitation import Excitation
from vehiclemor.simulation.trajectory import Trajectory

# Largest last step (rad or m) of Newton's method, after which its error is far smaller.
LAST_STEP = 1e-6


def constraint_errors(
    run: Trajectory, maneuver: Excitation
) -> tuple[Callable[[tuple[str, ...]], np.ndarray], bool]:
    """Errors (samples, names) of a run by names of outputs, and whether all samples are in reach.

    They are infinite from the first sample on that the mechanism can't reach on the branch of its
    design position.
    """
    model = run.model
    full = model.solved_as_far(model.sampled(maneuver), "newton_lanes", LAST_STEP)
    return partial(_errors, run, full), full.status == "ok"


def _errors(run: Trajectory, full: Trajectory, names: tuple[str, ...]) -> np.ndarray:
    columns = [full.names.index(name) for name in names]
    errors = run.outputs[:, columns] - full.outputs[:, columns]
    return np.where(np.isfinite(errors), errors, np.inf)
