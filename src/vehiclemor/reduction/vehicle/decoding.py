"""From reduced states to full ones, in one compiled pass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.loops import Prepared
from vehiclemor.codegen.operations import LANES, Kernel, padded
from vehiclemor.reduction.vehicle.features import PLANAR, Features, Layout, decoding_kernel
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.evaluation import (
    INPUTS,
    STATE,
    address_of,
    at_samples,
    partial,
    path_loops,
)
from vehiclemor.simulation.workspaces import Run


class DecodingSpace(NamedTuple):
    """Arrays of one decoding at a time, and the loop that writes the states.

    `counts` are the words of the call in which the number of rows stands.
    """

    states: np.ndarray
    call: Prepared
    counts: Sequence[int]


@dataclass(frozen=True, eq=False)
class Decoding(ShortRepr):
    """How full states follow from reduced ones, see `ReducedVehicle`.

    Coefficients (terms, n) are of the shape's deviation from its reference, straight running.
    """

    features: Features
    parameters: np.ndarray
    coefficients: np.ndarray
    reference: np.ndarray
    layout: Layout

    @property
    def kernel(self) -> tuple[Kernel, np.ndarray]:
        """The kernel of full states and, behind them, of what is watched; and its constants."""
        rows = np.vstack([self.coefficients, self.reference])
        rows = np.pad(rows, ((0, 0), (0, padded(rows.shape[1]) - rows.shape[1])))
        kernel = decoding_kernel(self.features, self.layout, len(self.parameters))
        return kernel, np.concatenate([self.parameters, rows.ravel()])

    @cached_property
    def _kernels(self) -> tuple[Kernels, np.ndarray]:
        kernel, constants = self.kernel
        kernel.check(self.features.states + PLANAR, self.features.inputs, len(constants))
        return Kernels([kernel]), constants

    @property
    def _results(self) -> int:
        return self.layout.size + len(self.features.watched)

    def slopes(self, state: np.ndarray, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of full states by reduced ones and inputs."""
        kernels, constants = self._kernels
        size, arrays = self.layout.size, (state, inputs, constants)
        by_state = partial(kernels, "full_state", arrays, self._results, STATE)
        by_inputs = partial(kernels, "full_state", arrays, self._results, INPUTS)
        return by_state[:size], by_inputs[:size]

    def states(self, path: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Full states and, behind them, what is watched (samples, 2 n + watched).

        The path has reduced states (samples, states + 3).
        """
        kernels, constants = self._kernels
        sizes = self.features.states + PLANAR, self.features.inputs, self._results
        return at_samples(kernels, "full_state", constants, (path, inputs), sizes)

    def of_run(self, run: Run, inputs: np.ndarray) -> np.ndarray:
        """As of `states`, results where a run is recorded: its first `run.rows` rows.

        `inputs` are those at the samples.  The array belongs to the run.
        """
        space = run.cached_loops.get("decoded")
        if space is None:
            space = self._space(run.recorded_states, run.recorded_at(inputs)[1], run.rows)
            run.cached_loops["decoded"] = space
        for index in space.counts:
            space.call.words[index] = run.rows
        space.call()
        return space.states

    def _space(self, path: np.ndarray, inputs: np.ndarray, rows: int) -> DecodingSpace:
        """The loop over arrays of a run, packed once."""
        kernels, constants = self._kernels
        lanes = LANES if rows >= LANES else 1
        address = np.array([address_of(kernels, "full_state", lanes)], dtype=np.int64)
        states = np.empty((len(path), self._results))
        loop = path_loops()["lane_path" if lanes == LANES else "kernel_path"]
        call = loop.prepared(path, inputs, address, constants, states)
        counts = [call.address(name) + 1 for name in ("path", "inputs", "result")]
        return DecodingSpace(states, call, counts)
