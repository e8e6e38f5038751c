"""Projected equations that start each time window from the full model.

What the paper's control periods resemble (section 3.1): the operation of onboard model-predictive
controllers, which update at regular intervals.  Errors then grow within a window alone.

Projected onto the subspace of the training run, as in the paper's step 6, the full model's state
becomes one of that run again, wherever the car is.  So the state itself is made the origin of the
window's subspace: only the change within the window is in the span of the training's.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.reduction.projection.dynamic import DynamicProjection
from vehiclemor.simulation.stepping import Stepper
from vehiclemor.simulation.trajectory import DYNAMIC_COUNTS, Start, Trajectory
from vehiclemor.simulation.workspaces import Solver


@dataclass(frozen=True, eq=False)
class RestartedProjection(DynamicProjection):
    """The same subspaces; the state at the beginning of each window is the full model's.

    Attributes
    ----------
    moved
        Whether this state is the origin of the window's subspace, and not the training's mean.
    """

    moved: bool = True

    @cached_property
    def stepper(self) -> Stepper:
        """Steps from any state that is given, as at the beginning of a window."""
        return Stepper(self.system, self.spaces, self.solver, self.tolerance, self.moved)

    def simulate(self, maneuver: Maneuver, start: Start) -> Trajectory:
        """Run the full model, then each window from its state: counts and seconds are of both.

        A sample at the edge of two windows is the end of the first one.
        """
        model, times = self.model, maneuver.times
        edges = np.array([0.0, *self.spaces.edges[1:-1], times[-1]])
        edges = np.unique(edges[edges <= times[-1]])
        full = model.simulate(maneuver, start, edges, self.solver, self.tolerance)
        counts = np.array([full.counts[name] for name in DYNAMIC_COUNTS])
        states = np.full((len(times), full.states.shape[1]), np.nan)
        first, seconds, failure, spaces = 0, full.seconds, "", self.spaces
        for (left, right), state in zip(pairwise(edges), full.states, strict=False):
            end = int(np.searchsorted(times, right + 1e-9 * (right - left)))
            if end == first or failure:
                continue
            if self.moved:
                spaces = replace(spaces, means=np.tile(state, (len(spaces.means), 1)))
            how = Solver(self.solver, self.tolerance, times[first:end], begin=left)
            run = self.system.run(maneuver, state, spaces, how)
            states[first:end], failure = run.whole, run.failure
            counts, seconds, first = counts + run.counts, seconds + run.seconds, end
        return model.trajectory(times, maneuver.at(times), states, counts, seconds, failure)
