"""Outputs that are cheap: limited ones alone, and states under the names of outputs."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cached_property

import numpy as np

from vehiclemor.codegen.kernels import Kernels
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.paths import address_of

RESULT = re.compile(r"\s*_result\[(\d+)\] = (.*)")
STATE = re.compile(r"\s*(\w+) = _x\[(\d+)\]")


class WatchedOutputs:
    """What the text of a model's outputs tells of them."""

    def __init__(self, model: DynamicModel) -> None:
        self.model, self.source = model, model.kernels.sources["outputs"]

    @cached_property
    def _lines(self) -> list[str]:
        return self.source.text.splitlines(keepends=True)

    def columns(self, columns: np.ndarray) -> np.ndarray:
        """Numbers of states and, behind them, outputs; of a state where an output is one."""
        found = [STATE.match(line) for line in self._lines]
        states = {match[1]: int(match[2]) for match in found if match}
        n = len(self.model.definition.states)
        own = {
            n + int(found[1]): states[found[2]]
            for line in self._lines
            if (found := RESULT.match(line)) and found[2] in states
        }
        return np.array([own.get(column, column) for column in columns.tolist()], dtype=np.int64)

    def kernel(self, lanes: int) -> np.ndarray:
        """Address (1,) of a kernel of the limited outputs alone, for so many samples at once."""
        limited = self.model.limits[1].tolist()
        text = "".join(
            line
            for line in self._lines
            if not (found := RESULT.match(line)) or int(found[1]) in limited
        )
        kernels = Kernels({"outputs": replace(self.source, text=text)})
        return np.array([address_of(kernels, "outputs", lanes)], dtype=np.int64)
