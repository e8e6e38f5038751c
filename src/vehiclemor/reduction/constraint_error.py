"""How far a reduced mechanism's run is from that of the full model, found after the run.

The constraint equations say at each sample where the mechanism is.  Newton's method in vector lanes
goes there from extrapolated positions in little more than one step a sample: a correction of the
decoded coordinates takes as many, and can't tell on which branch they are.
"""

import numpy as np

from vehiclemor.inputs.excitation import Excitation
from vehiclemor.simulation.trajectory import Trajectory

# Largest last step (rad or m) of Newton's method, after which its error is far smaller.
LAST_STEP = 1e-6


def constraint_errors(run: Trajectory, maneuver: Excitation) -> tuple[np.ndarray, bool]:
    """Errors (samples, outputs) of a run's outputs, and whether they are known at all samples.

    They are infinite from the first sample on that the mechanism can't reach on the branch of its
    design position.
    """
    model = run.model
    full = model.solved_as_far(model.sampled(maneuver), "newton_lanes", LAST_STEP)
    errors = run.outputs - full.outputs
    errors[~np.isfinite(errors)] = np.inf
    return errors, full.status == "ok"
