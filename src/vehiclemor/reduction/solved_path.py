"""Running a compiled loop that gives a mechanism's coordinates at all samples."""

from collections.abc import Callable

import numpy as np

from vehiclemor.simulation.algebraic import AlgebraicModel, new_counts
from vehiclemor.simulation.newton_loops import SAMPLE, Solution
from vehiclemor.simulation.run_timer import timed
from vehiclemor.simulation.trajectory import Trajectory


def solved_path(
    model: AlgebraicModel,
    times: np.ndarray,
    inputs: np.ndarray,
    prepare: Callable[[Solution], Callable[[], int]],
) -> tuple[Trajectory, int]:
    """Trajectory that a loop gives, and the sample at which it has stopped.

    Parameters
    ----------
    prepare
        Makes of where the solution goes the call that is timed; it gives 0 if all is well.
    """
    path = np.full((len(times), len(model.coordinates)), np.nan)
    solution = Solution(path, new_counts())
    status, seconds = timed(prepare(solution))
    sample = int(solution.counts[SAMPLE])
    failure = (status, sample) if status else None
    return model.trajectory(times, inputs, path, solution.counts.tolist(), seconds, failure), sample
