"""Linear models at an operating point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vehiclemor.registry import choice
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.trajectory import output_names

# What is smaller, relative to the largest entry of A or B, is rounding.
ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class LinearModel(ShortRepr):
    """x' = rates + A (x - state) + B (u - input_values), and y likewise by C and D.

    Attributes
    ----------
    states, inputs, outputs
        Names of the rows and columns.
    state, input_values, rates, output_values
        The operating point, and what the nonlinear model gives there.
    """

    repr_fields = ("states", "inputs", "outputs")

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    state: np.ndarray
    input_values: np.ndarray
    rates: np.ndarray
    output_values: np.ndarray

    @classmethod
    def of(cls, model: Any, states: tuple[str, ...], point: tuple[np.ndarray, ...]) -> LinearModel:
        """That of a model with these states; the point is state, inputs, rates and outputs."""
        x, u, *_ = point
        outputs = getattr(model, "model", model).outputs
        slopes = [(by, of) for of in ("rhs", "outputs") for by in ("state", "inputs")]
        matrices = (model.jacobian(x, u, *slope) for slope in slopes)
        return cls(states, model.inputs, outputs, *matrices, *point)

    def select(self, states: Sequence[str]) -> LinearModel:
        """Some states alone, in this order; the others stay as they are at the point."""
        names = output_names(states, "states")
        rows = [self.states.index(choice("state", name, self.states)) for name in names]
        point = {"state": self.state[rows], "rates": self.rates[rows]}
        A, B, C = self.A[np.ix_(rows, rows)], self.B[rows], self.C[:, rows]  # noqa: N806
        return replace(self, states=names, A=A, B=B, C=C, **point)

    def reachable(self) -> LinearModel:
        """The states that the inputs change, directly or through other states."""
        moves = abs(self.A) > ROUNDING * abs(self.A).max()
        reached = (abs(self.B) > ROUNDING * abs(self.B).max()).any(axis=1)
        for _ in self.states:
            reached |= moves[:, reached].any(axis=1)
        return self.select([name for name, yes in zip(self.states, reached, strict=True) if yes])
