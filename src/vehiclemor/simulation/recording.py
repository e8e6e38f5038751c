"""Runs as they are recorded: states and outputs at the points of the steps, sampled when read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple
from weakref import ref

import numpy as np

from vehiclemor.codegen.loops import Prepared, Ready, address_of_array, cache_lines, ready
from vehiclemor.codegen.vector_lanes import LANES
from vehiclemor.simulation.checks import limits_of
from vehiclemor.simulation.integrators.structures import Observer
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.paths import address_of, path_loops
from vehiclemor.simulation.workspaces import Run, Spare

ALL, NOTHING = np.zeros(0, dtype=np.int64), np.empty((0, 0))


class Recording(NamedTuple):
    """States and outputs of a run side by side.

    Attributes
    ----------
    points
        At the points (points, width), see `structures.Output`.
    places
        How the samples follow from them (samples, 2); empty (0, 2) if they are these.
    sizes
        Numbers of coordinates and of outputs.
    """

    points: np.ndarray
    places: np.ndarray
    sizes: tuple[int, int]

    def histories(self) -> dict[str, np.ndarray]:
        """Coordinates, speeds and outputs at the samples, by name."""
        (n, outputs), whole = self.sizes, self.table()
        return {
            "coordinates": whole[:, :n],
            "speeds": whole[:, n : 2 * n],
            "outputs": whole[:, 2 * n : 2 * n + outputs],
        }

    def output(self, number: int) -> np.ndarray:
        """One output at the samples (samples,)."""
        return self.columns(np.array([2 * self.sizes[0] + number]))[:, 0]

    def table(self) -> np.ndarray:
        """At the samples (samples, width)."""
        if not len(self.places):
            return self.points
        result, address = cache_lines(len(self.places), self.points.shape[1])
        self._sample(ALL, 0, (address, *result.shape))
        return result

    def columns(self, numbers: np.ndarray) -> np.ndarray:
        """Some of them at the samples (samples, columns)."""
        if not len(self.places):
            return self.points[:, numbers]
        result = np.empty((len(self.places), len(numbers)))
        self._sample(numbers, address_of_array(numbers), (address_of_array(result), *result.shape))
        return result

    def _sample(self, numbers: np.ndarray, address: int, result: tuple[int, ...]) -> None:
        """Write columns of these numbers, which stand at an address, into a matrix."""
        points, places = self.points, self.places
        call = _SAMPLED.taken(
            None, lambda: path_loops()["sampled"].prepared(points, places, ALL, np.empty((0, 0)))
        )
        call.words[0:11] = (
            *(address_of_array(points), *points.shape),
            *(address_of_array(places), *places.shape),
            *(address, len(numbers)),
            *result,
        )
        call()
        _SAMPLED.give_back(None, call)


_SAMPLED: Spare[Prepared] = Spare()


@dataclass
class _Packed:
    """The loop that records runs in the same workspace, packed once.

    Attributes
    ----------
    states, inputs
        Where the run stands.
    first
        Where the loop writes when each limited output is first out of its limits.
    rows, space
        Words of the number of points and of the address of the table.
    table, address
        Of the last run, for the next one.
    last
        Its points, if anybody still has them: then the next run needs a table of its own.
    """

    states: np.ndarray
    inputs: np.ndarray
    first: np.ndarray
    call: Prepared
    rows: int
    space: int
    table: np.ndarray
    address: int = 0
    last: Callable[[], np.ndarray | None] = lambda: None


class Recorder:
    """Records runs of a model.

    Attributes
    ----------
    names
        Outputs with a range of validity, see `checks.limits_of`; loads are watched behind them.
    """

    def __init__(self, model: Model) -> None:
        self._model = model
        self.names, self._limited, self._ranges = limits_of(model.definition)
        self._states = len(model.definition.states)
        self._sizes = self._states // 2, len(model.outputs)
        # Of whole vectors.
        self._width = -(-(self._states + len(model.outputs)) // LANES) * LANES
        self._observers: dict[int, Ready] = {}

    def recorded(
        self, run: Run, inputs: np.ndarray, states: np.ndarray
    ) -> tuple[Recording, list[int]]:
        """A run, and when each limited output is first out of its limits: else all samples.

        Parameters
        ----------
        inputs
            At the samples (samples, inputs).
        states
            Where the run is recorded: the model's, and what may follow them.
        """
        at = run.recorded_at(inputs)[1]
        held = run.kept.get("recorded")
        if held is None or held.states is not states or held.inputs is not at:
            held = run.kept["recorded"] = self._packed(run, at, states)
        rows, places = run.rows, run.places
        if len(held.table) <= rows or held.last() is not None:
            # A row more: outputs are written as rows that begin behind the states.
            held.table, held.address = cache_lines(rows + 1, self._width)
        words, points = held.call.words, held.table[:rows]
        words[held.rows], words[held.space] = rows, held.address
        held.call()
        if len(places):
            held.last = ref(points)
        else:
            # The points themselves are what is read, in parts that outlive the whole.
            held.table = NOTHING
        return Recording(points, places.copy(), self._sizes), held.first.tolist()

    def _packed(self, run: Run, inputs: np.ndarray, states: np.ndarray) -> _Packed:
        first = np.empty(len(self._limited), dtype=np.int64)
        observer = self._observer(LANES if run.rows >= LANES else 1)
        loop = path_loops()["observed"]
        call = loop.prepared(states, inputs, run.places, observer, np.empty(0), first)
        rows, space = call.address("states") + 1, call.address("space")
        return _Packed(states, inputs, first, call, rows, space, NOTHING)

    def _observer(self, lanes: int) -> Ready:
        """How outputs follow from states, so many points at once."""
        if lanes not in self._observers:
            model = self._model
            kernel = np.array([address_of(model.kernels, "outputs", lanes)], dtype=np.int64)
            limits = self._limited, self._ranges
            observer = Observer(kernel, model.constants, *limits, self._states, self._width)
            self._observers[lanes] = ready(observer)
        return self._observers[lanes]
