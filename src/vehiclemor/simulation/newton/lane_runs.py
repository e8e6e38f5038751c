"""Runs of Newton's method in vector lanes, packed once for all with the same inputs."""

from typing import NamedTuple

import numpy as np

from vehiclemor.codegen.loops import Loop, Prepared, Ready, address_of_array
from vehiclemor.codegen.vector_lanes import LANES
from vehiclemor.simulation.newton.newton_loops import SAMPLE, Solution
from vehiclemor.simulation.run_timer import timed
from vehiclemor.simulation.workspaces import Pool


class LaneRun(NamedTuple):
    """The loop with its arguments.

    Attributes
    ----------
    counts
        Counts of the loop, and behind them the sample at which it stops.
    table
        Word of the address of the table, which is fresh in each run.
    """

    call: Prepared
    counts: np.ndarray
    table: int


class LaneRuns:
    """Runs of one mechanism.

    Parameters
    ----------
    loop
        `lane_path` of `lane_loops`.
    mechanism, kernels
        Its arguments of these names.
    sizes
        Numbers of coordinates, inputs and outputs.
    """

    def __init__(
        self, loop: Loop, mechanism: Ready, kernels: Ready, sizes: tuple[int, int, int]
    ) -> None:
        self._loop, self._mechanism, self._kernels = loop, mechanism, kernels
        self._sizes, self._pool = sizes, Pool[LaneRun]()

    def solved(
        self, samples: Ready, iteration: Ready
    ) -> tuple[np.ndarray, list[int], float] | None:
        """Coordinates and outputs side by side at the samples, counts, seconds; none if it failed.

        There are as many samples as lanes at least.
        """
        kind, (n, _, m) = (samples, iteration), self._sizes
        run = self._pool.taken(kind, lambda: self._packed(samples, iteration))
        # One table is written faster than two.
        table = np.empty((len(samples.bundle.inputs), n + m))
        run.call.words[run.table] = address_of_array(table)
        status, seconds = timed(run.call)
        counts = run.counts.tolist()
        self._pool.give_back(kind, run)
        return None if status else (table, counts, seconds)

    def _packed(self, samples: Ready, iteration: Ready) -> LaneRun:
        n, inputs, m = self._sizes
        solution = Solution(np.empty((0, n + m)), np.zeros(SAMPLE + 1, dtype=np.int64))
        buffer = np.empty(LANES * (5 * n + inputs + m) + n * (n + 2))
        shared = self._mechanism, samples, self._kernels, iteration
        call = self._loop.prepared(*shared, solution, buffer)
        table = call.address("solution.path")
        call.words[table + 1] = len(samples.bundle.inputs)
        return LaneRun(call, solution.counts, table)
