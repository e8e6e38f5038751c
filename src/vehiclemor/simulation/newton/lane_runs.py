"""Runs of Newton's method in vector lanes, packed once for all with the same inputs."""

from dataclasses import dataclass, field

import numpy as np

from vehiclemor.codegen.loops import Loop, Prepared, Ready, address_of_array
from vehiclemor.codegen.vector_lanes import LANES
from vehiclemor.simulation.newton.newton_loops import SAMPLE, Solution
from vehiclemor.simulation.run_timer import timed
from vehiclemor.simulation.workspaces import Pool


@dataclass(frozen=True, eq=False)
class LaneRuns:
    """Runs of one mechanism by `lane_loops.lane_path`, whose arguments have the same names.

    Sizes are numbers of coordinates, inputs and outputs.
    """

    loop: Loop
    mechanism: Ready
    kernels: np.ndarray
    sizes: tuple[int, int, int]
    # The loop with its arguments, its counts, and the word of the address of its table.
    _pool: Pool[tuple[Prepared, np.ndarray, int]] = field(default_factory=Pool)

    def solved(
        self, samples: Ready, iteration: Ready
    ) -> tuple[np.ndarray, list[int], float] | None:
        """Coordinates and outputs side by side at the samples, counts, seconds; none if it failed.

        There are as many samples as lanes at least.
        """
        kind, (n, _, m) = (samples, iteration), self.sizes
        run = call, counted, place = self._pool.taken(kind, lambda: self._packed(*kind))
        # One table is written faster than two.
        table = np.empty((len(samples.bundle.inputs), n + m))
        call.words[place] = address_of_array(table)
        status, seconds = timed(call)
        counts = counted.tolist()
        self._pool.give_back(kind, run)
        return None if status else (table, counts, seconds)

    def _packed(self, samples: Ready, iteration: Ready) -> tuple[Prepared, np.ndarray, int]:
        n, inputs, m = self.sizes
        solution = Solution(np.empty((0, n + m)), np.zeros(SAMPLE + 1, dtype=np.int64))
        buffer = np.empty(LANES * (5 * n + inputs + m) + n * (n + 2))
        shared = self.mechanism, samples, self.kernels, iteration
        call = self.loop.prepared(*shared, solution, buffer)
        table = call.address("solution.path")
        call.words[table + 1] = len(samples.bundle.inputs)
        return call, solution.counts, table
