"""Runs as they are recorded: states at the points of steps; the rest follows when it is read."""

from __future__ import annotations

from copy import copy
from functools import cached_property

import numpy as np

from vehiclemor.codegen.loops import Prepared, Ready, address_of_array, ready
from vehiclemor.codegen.operations import LANES
from vehiclemor.registry import choice
from vehiclemor.simulation.checks import limits_of
from vehiclemor.simulation.evaluation import address_of, evaluate, path_loops
from vehiclemor.simulation.loop_arguments import Outputs
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.workspaces import Run

NO_RANGES = np.empty((0, 2))


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

    def first_outside(self, run: Run, inputs: np.ndarray, states: np.ndarray) -> list[int]:
        """The first sample at which each watched output is out of its limits; else all samples.

        Inputs and states are those at the points of the run (points or more, number).
        """
        held = run.cached_loops.get("watched")
        if held is None or held[0] is not states:
            first = np.empty(len(self._watched), dtype=np.int64)
            outputs, results = self.packed(self._watched, run.rows, self._ranges)
            scratch = np.empty((len(states), results))
            arrays = states, inputs, run.point_of_sample, outputs, scratch, first
            call = path_loops()["watched"].prepared(*arrays)
            held = run.cached_loops["watched"] = states, call, first, call.address("states") + 1
        _, call, first, rows = held
        call.words[rows] = run.rows
        self._run(call)
        return first.tolist()

    def histories(
        self, run: Run, inputs: np.ndarray, states: np.ndarray, names: tuple[str, ...]
    ) -> np.ndarray:
        """Outputs, coordinates or speeds (samples, names) of a run, arguments as above."""
        held = run.cached_loops.get("chosen")
        if held is None or held[0] is not states or held[1] != names:
            outputs, results = self.packed(names, run.rows)
            arrays = np.empty((len(states), results)), np.empty((len(names), len(run.times)))
            loop = path_loops()["chosen"]
            call = loop.prepared(states, inputs, run.point_of_sample, outputs, *arrays)
            words = call.address("states") + 1, call.address("result")
            held = run.cached_loops["chosen"] = states, names, call, words
        *_, call, (rows, address) = held
        result = np.empty((len(names), len(run.times)))
        call.words[rows], call.words[address] = run.rows, address_of_array(result)
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
    """States and inputs of a run at its points, and what follows from them at the samples.

    Attributes
    ----------
    states, inputs
        At the points (points, number), see `loop_arguments.Output`.
    point_of_sample
        How the samples follow from them (samples, 2); empty (0, 2) if they are these.
    """

    def __init__(
        self,
        recorder: Recorder,
        states: np.ndarray,
        inputs: np.ndarray,
        point_of_sample: np.ndarray,
    ) -> None:
        self._recorder, self.states, self.inputs = recorder, states, inputs
        self.point_of_sample = point_of_sample
        # The first sample without numbers.
        self.end = len(point_of_sample) or len(states)

    @cached_property
    def state_history(self) -> np.ndarray:
        """States (samples, n)."""
        return self._cut(self._sampled(self.states))

    @cached_property
    def output_history(self) -> np.ndarray:
        """Outputs (samples, number of outputs)."""
        model = self._recorder.model
        table = np.empty((len(self.states), len(model.outputs)))
        evaluate(model.kernels, "outputs", model.constants, (self.states, self.inputs), table)
        return self._cut(self._sampled(table))

    def columns(self, names: tuple[str, ...]) -> np.ndarray:
        """Some outputs, coordinates or speeds (samples, names), without the others."""
        outputs, results = self._recorder.packed(names, len(self.states))
        histories = np.empty((len(names), len(self.point_of_sample) or len(self.states)))
        arrays = np.empty((len(self.states), results)), histories
        path = self.states, self.inputs, self.point_of_sample
        self._recorder._run(path_loops()["chosen"].prepared(*path, outputs, *arrays))
        return self._cut(histories.T)

    def at(self, rows: np.ndarray) -> Recording:
        """The same at some of the samples."""
        states, inputs, points = self.states, self.inputs, self.point_of_sample
        if len(points):
            part = Recording(self._recorder, states, inputs, points[rows])
        else:
            part = Recording(self._recorder, states[rows], inputs[rows], points)
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
