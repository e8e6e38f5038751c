"""What a reduced model is to those who step it: a state, and what follows from it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vehiclemor.errors import ConvergenceError, InputError
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.kernel_derivatives import By
from vehiclemor.simulation.trajectory import Start, Trajectory, Trust


class StateSpace(Protocol):
    """A state (dim,) with its steps; what `fit` gives may have one as `state_space`."""

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        ...

    def begin(self, start: Start, inputs: np.ndarray) -> np.ndarray:
        """State of a start at inputs (inputs,)."""
        ...

    def step(
        self, state: np.ndarray, inputs: np.ndarray, ends: np.ndarray | None, dt: float, time: float
    ) -> np.ndarray:
        """State at time + dt s; inputs are held, or go straight to their ends."""
        ...

    def rates(self, state: np.ndarray, inputs: np.ndarray, time: float) -> np.ndarray:
        """Time derivative of a state."""
        ...

    def derivatives(
        self, state: np.ndarray, inputs: np.ndarray, time: float, by: By, of: str
    ) -> np.ndarray:
        """Analytic derivatives of rates or outputs, see `ReducedOrderModel.jacobian`."""
        ...

    def full_states(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """States (samples, n) of the full model."""
        ...

    def trust(self, states: np.ndarray, inputs: np.ndarray) -> Trust | None:
        """What the model tells of states (samples, dim), if it judges itself."""
        ...


@dataclass(frozen=True, eq=False)
class KinematicStates(ShortRepr):
    """A mechanism: its coordinates follow from the inputs at the time.

    Attributes
    ----------
    solved
        (time in s, inputs (1, inputs), coordinates (n,) to begin at) -> solution at one time.
    slopes
        (coordinates (n,), inputs, what by, what of) -> analytic derivatives, if there are some.
    """

    model: AlgebraicModel
    solved: Callable[[float, np.ndarray, np.ndarray], Trajectory]
    slopes: Callable[[np.ndarray, np.ndarray, By, str], np.ndarray] | None = None

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return self.model.coordinates

    def begin(self, start: Start, inputs: np.ndarray) -> np.ndarray:
        """Coordinates at the inputs."""
        return self._coordinates(0.0, inputs, self.model.start(start))

    def step(
        self, state: np.ndarray, inputs: np.ndarray, ends: np.ndarray | None, dt: float, time: float
    ) -> np.ndarray:
        """Coordinates at the end of the step."""
        return self._coordinates(time + dt, inputs if ends is None else ends, state)

    def _coordinates(self, time: float, inputs: np.ndarray, state: np.ndarray) -> np.ndarray:
        found = self.solved(time, inputs[None], state)
        if found.status == "diverged":
            raise ConvergenceError(f"{self.model.name}: {found.message}", found)
        return found.coordinates[0].copy()

    def rates(self, state: np.ndarray, inputs: np.ndarray, time: float) -> np.ndarray:
        """There are none."""
        del state, inputs, time
        raise InputError(f"{self.model.name} is kinematic: its equations have no rates")

    def derivatives(
        self, state: np.ndarray, inputs: np.ndarray, time: float, by: By, of: str
    ) -> np.ndarray:
        """Those of `coordinates` or `outputs`; there are no rates."""
        if of == "rhs":
            self.rates(state, inputs, time)
        if self.slopes is None:
            raise InputError(f"this reduction of {self.model.name} has no analytic derivatives")
        return self.slopes(state, inputs, by, of)

    def full_states(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """The coordinates themselves."""
        del inputs
        return states

    def trust(self, states: np.ndarray, inputs: np.ndarray) -> Trust | None:
        """What the model tells of the inputs, if it judges itself."""
        found = [self.solved(0.0, u[None], q).trust for q, u in zip(states, inputs, strict=True)]
        known = [trust for trust in found if trust is not None]
        return max(known, key=lambda trust: trust.indicator, default=None)
