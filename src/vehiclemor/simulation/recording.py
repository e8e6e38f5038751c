"""Runs as they are recorded: states at the points of steps; the rest follows when it is read."""

from __future__ import annotations

from copy import copy
from functools import cached_property
from typing import Any

import numpy as np

from vehiclemor.codegen.loops import Prepared, Ready, address_of_array, ready
from vehiclemor.codegen.operations import LANES
from vehiclemor.registry import choice
from vehiclemor.simulation.checks import limits_of
from vehiclemor.simulation.evaluation import address_of, path_loops
from vehiclemor.simulation.loop_arguments import Outputs
from vehiclemor.simulation.model import Model

NO_RANGES = np.empty((0, 2))
# States and inputs (points or more, number) at the points of a run, and how its samples follow from
# them (samples, 2), empty if they are these; see `loop_arguments.Output`.
Points = tuple[np.ndarray, np.ndarray, np.ndarray]


class Recorder:
    """Makes outputs of runs of a model; watches those that are `limited`, and loads behind them."""

    def __init__(self, model: Model) -> None:
        self.model, self._constants = model, model.constants.ctypes.data
        self.limited, self._watched, self._ranges = limits_of(model.definition)
        self._packed: dict[tuple[tuple[str, ...], int], tuple[Ready, int]] = {}

    def of(self, model: Model) -> Recorder:
        """The recorder of a model with other constants."""
        other = copy(self)
        other.model, other._constants = model, model.constants.ctypes.data
        return other

    def _run(self, call: Prepared) -> None:
        """Run a loop over outputs with the constants of this model."""
        call.words[call.address("outputs.constants")] = self._constants
        call()

    def first_outside(self, points: Points, rows: int, cached_loops: dict[str, Any]) -> list[int]:
        """The first sample at which each watched output is out of its limits; else all samples.

        So many `rows` of the points are recorded.
        """
        states, held = points[0], cached_loops.get("watched")
        if held is None or held[0] is not states:
            first = np.empty(len(self._watched), dtype=np.int64)
            outputs, results = self.packed(self._watched, rows, self._ranges)
            arrays = np.empty((len(states), results)), first
            call = path_loops()["watched"].prepared(*points, outputs, *arrays)
            held = cached_loops["watched"] = states, call, first, call.address("states") + 1
        _, call, first, word_of_rows = held
        call.words[word_of_rows] = rows
        self._run(call)
        return first.tolist()

    def histories(
        self, names: tuple[str, ...], points: Points, rows: int, cached_loops: dict[str, Any]
    ) -> np.ndarray:
        """Outputs, coordinates or speeds (samples, names), arguments as above."""
        states, samples, held = points[0], len(points[2]) or rows, cached_loops.get("chosen")
        if held is None or held[0] is not states or held[1] != names:
            outputs, results = self.packed(names, rows)
            arrays = np.empty((len(states), results)), np.empty((len(names), samples))
            call = path_loops()["chosen"].prepared(*points, outputs, *arrays)
            words = call.address("states") + 1, call.address("result")
            held = cached_loops["chosen"] = states, names, call, words
        *_, call, (word_of_rows, address) = held
        result = np.empty((len(names), samples))
        call.words[word_of_rows], call.words[address] = rows, address_of_array(result)
        self._run(call)
        return result.T

    def packed(
        self, names: tuple[str, ...], rows: int, ranges: np.ndarray = NO_RANGES
    ) -> tuple[Ready, int]:
        """Outputs, coordinates or speeds as loops over so many points take them.

        The number tells how many of them a kernel makes: the others are states.
        """
        lanes = LANES if rows >= LANES else 1
        if (names, lanes) not in self._packed:
            model = self.model
            states, copied = model.definition.states, model.kernels.sources["outputs"].copies
            kernel, columns = [], []
            for name in names:
                choice("quantity", name, (*model.outputs, *states))
                number = model.outputs.index(name) if name in model.outputs else -1
                column = states.index(name) if number < 0 else copied[number]
                if column < 0:
                    kernel.append(number)
                    column = -len(kernel)
                columns.append(column)
            address = address_of(model.kernels, "outputs", lanes, tuple(kernel)) if kernel else 0
            arrays = np.array([address]), model.constants, np.array(columns, dtype=np.int64), ranges
            self._packed[names, lanes] = ready(Outputs(*arrays)), len(kernel)
        return self._packed[names, lanes]


class Recording:
    """What follows from the points of a run at its samples."""

    def __init__(self, recorder: Recorder, points: Points) -> None:
        self._recorder, self._points = recorder, points
        self.states, self.inputs, self.point_of_sample = points
        # The first sample without numbers.
        self.end = len(self.point_of_sample) or len(self.states)

    @cached_property
    def state_history(self) -> np.ndarray:
        """States (samples, n)."""
        return self._cut(self._sampled(self.states))

    @cached_property
    def output_history(self) -> np.ndarray:
        """Outputs (samples, number of outputs)."""
        table = self._recorder.model.values_at("outputs", self.states, self.inputs)
        return self._cut(self._sampled(table))

    def columns(self, names: tuple[str, ...]) -> np.ndarray:
        """Some outputs, coordinates or speeds (samples, names), without the others."""
        return self._cut(self._recorder.histories(names, self._points, len(self.states), {}))

    def at(self, rows: np.ndarray) -> Recording:
        """The same at some of the samples."""
        states, inputs, samples = self._points
        if len(samples):
            samples = samples[rows]
        else:
            states, inputs = states[rows], inputs[rows]
        part = Recording(self._recorder, (states, inputs, samples))
        part.end = int(np.searchsorted(rows, self.end))
        return part

    def _cut(self, history: np.ndarray) -> np.ndarray:
        history[self.end :] = np.nan
        return history

    def _sampled(self, table: np.ndarray) -> np.ndarray:
        """A table at the points, at the samples."""
        if not len(self.point_of_sample):
            return table.copy()
        histories = np.empty((len(self.point_of_sample), table.shape[1]))
        path_loops()["sampled"](table, self.point_of_sample, histories)
        return histories
