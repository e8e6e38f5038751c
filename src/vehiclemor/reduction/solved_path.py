"""Running a compiled loop that gives a mechanism's coordinates at all samples."""

from collections.abc import Callable

import numpy as np

from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.clock import timed
from vehiclemor.simulation.trajectory import ALGEBRAIC_COUNTS, Trajectory

Loop = Callable[[np.ndarray, np.ndarray], tuple[int, int]]


def solved_path(
    model: AlgebraicModel, times: np.ndarray, inputs: np.ndarray, loop: Loop
) -> tuple[Trajectory, int]:
    """Trajectory that a loop gives, and the sample at which it has stopped.

    Parameters
    ----------
    loop
        (path (samples, n), counts) -> status, zero if all is well, and sample; writes into both.
    """
    path = np.full((len(times), len(model.coordinates)), np.nan)
    counts = np.zeros(len(ALGEBRAIC_COUNTS), dtype=np.int64)
    (status, sample), seconds = timed(lambda: loop(path, counts), counts)
    failure = (status, sample) if status else None
    return model.trajectory(times, inputs, path, counts, seconds, failure), sample
