"""What is stepped: a state, and what follows from it; full states of a model in other states."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from vehiclemor.errors import ConvergenceError, InputError
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.reduction.interface import Offline
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.dynamic import RESULTS, DynamicModel
from vehiclemor.simulation.input_polynomials import recorded_inputs
from vehiclemor.simulation.kernel_derivatives import (
    CONSTANTS,
    INPUTS,
    PLACES,
    STATE,
    By,
    chosen,
    parameter_names,
)
from vehiclemor.simulation.maneuver_checks import checked_maneuver
from vehiclemor.simulation.projection_windows import ProjectionWindows
from vehiclemor.simulation.rate_derivatives import Along
from vehiclemor.simulation.stepping import Stepper
from vehiclemor.simulation.system import System
from vehiclemor.simulation.trajectory import Start, Trajectory, Trust
from vehiclemor.simulation.workspaces import Run, Solver
from vehiclemor.sizes import require


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

    `solved` makes of a time in s, inputs (1, inputs) and coordinates (n,) to begin at the solution
    at that time, `slopes` of coordinates, inputs, what by and what of analytic derivatives.
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


# Encoded starts that are kept.
MOST_STARTS = 64


def _given(states: np.ndarray) -> Run:
    """States (samples, dim) as a run, all at time zero."""
    return Run(np.zeros(len(states)), states, np.zeros(0), 0.0, "")


@dataclass(frozen=True, eq=False)
class ReducedSystem(ShortRepr):
    """Equations in reduced states of a full-order model, with the ways there and back.

    Attributes
    ----------
    system, spaces
        The equations that are integrated; their form, and their subspaces if they are projected.
    effective_rank
        Number of coordinates or modes that stand for the model's.
    encode
        (full state (2 n,), inputs) -> state (dim,) of the system; the same if there is none.
    lift
        (run of the system, inputs (samples, inputs)) -> full states, the run's own if there is
        none.  It keeps nothing of the run.
    judge
        (run of the system, inputs) -> what the model tells of it.
    names
        Of the system's states; the model's by default.
    slopes
        (state (dim,), inputs) -> derivatives of the full state (2 n, dim) and (2 n, inputs) by
        both, where the full state is another than the system's.
    """

    model: DynamicModel
    system: System
    spaces: ProjectionWindows
    effective_rank: int
    offline: Offline
    solver: str
    tolerance: float
    encode: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None
    lift: Callable[[Run, np.ndarray], np.ndarray] | None = None
    judge: Callable[[Run, np.ndarray], Trust | None] | None = None
    names: tuple[str, ...] = ()
    slopes: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]] | None = None

    def check_sizes(self) -> None:
        """Raise `ValueError` if the subspaces are of other states than the system's."""
        spaces, dim = self.spaces, len(self.system.reference)
        if spaces.formulation == "full":
            require(spaces.ranks.dtype == int and spaces.ranks.tolist() == [dim], "ranks")
        else:
            require(spaces.means.shape[1] == dim, "spaces")

    @property
    def state_space(self) -> ReducedSystem:
        """Itself, see `StateSpace`."""
        return self

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states that are stepped."""
        return self.names or tuple(self.model.definition.states)

    def begin(self, start: Start, inputs: np.ndarray) -> np.ndarray:
        """State (dim,) of a start, as `simulate` begins with it: in the first window's subspace."""
        return self.stepper.projected(self._encoded(start, inputs), inputs).copy()

    @cached_property
    def stepper(self) -> Stepper:
        """The system as a function of state, inputs and length of time."""
        return Stepper(self.system, self.spaces, self.solver, self.tolerance)

    def step(
        self, state: np.ndarray, inputs: np.ndarray, ends: np.ndarray | None, dt: float, time: float
    ) -> np.ndarray:
        """State (dim,) after dt s, see `Stepper`."""
        return self.stepper.step(state, inputs, dt, time, ends)

    def rates(self, state: np.ndarray, inputs: np.ndarray, time: float) -> np.ndarray:
        """Time derivative (dim,) of a state."""
        return self.stepper.rates(state, inputs, time)

    def derivatives(
        self, state: np.ndarray, inputs: np.ndarray, time: float, by: By, of: str
    ) -> np.ndarray:
        """Analytic derivatives of the rates or of the outputs."""
        function, names, along = chosen(of, RESULTS), parameter_names(by), Along(CONSTANTS)
        if not names:
            along = Along(PLACES[str(by)])
        elif np.array_equal(self.system.constants, self.model.constants):
            along = Along(CONSTANTS, self.model.constants_along(names))
        else:
            raise InputError(
                f"the reduced equations of {self.model.name} don't know {', '.join(names)}: "
                f"reduce a model that is made with another value"
            )
        if function == "derivative":
            return self.stepper.derivatives(state, inputs, time, along)
        full, slopes = state, (np.eye(len(state)), np.zeros((len(state), len(inputs))))
        if self.slopes is not None:
            full = self.full_states(state[None], inputs[None])[0]
            slopes = self.slopes(state, inputs)
        by_state = self.model.derivatives(function, full, inputs, "state")
        if along.place == STATE:
            return by_state @ slopes[STATE]
        found = self.model.derivatives(function, full, inputs, by)
        return found + by_state @ slopes[INPUTS] if along.place == INPUTS else found

    def full_states(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """States (samples, 2 n) of the model."""
        return self._lifted(_given(states), inputs)[:, : 2 * len(self.model.coordinates)]

    def _lifted(self, run: Run, inputs: np.ndarray) -> np.ndarray:
        return self.lift(run, inputs) if self.lift else run.whole

    def trust(self, states: np.ndarray, inputs: np.ndarray) -> Trust | None:
        """What the model tells of states, if it judges itself."""
        return self.judge(_given(states), inputs) if self.judge else None

    def run(
        self,
        maneuver: Maneuver,
        start: Start,
        times: np.ndarray | None = None,
        direct_until: float = np.inf,
    ) -> Run:
        """Path of the reduced states, from a full state; see `System.run`."""
        maneuver = checked_maneuver(maneuver, self.model.definition)
        # Output times begin with zero.
        state = self._encoded(start, recorded_inputs(maneuver)[1][0])
        how = Solver(self.solver, self.tolerance, times)
        return self.system.run(maneuver, state, self.spaces, how, direct_until)

    def _encoded(self, start: Start, inputs: np.ndarray) -> np.ndarray:
        """State of a start; kept by its name or its numbers."""
        name = start if isinstance(start, str) else self.model.start(start).tobytes()
        key = name, inputs.tobytes()
        found = self._starts.get(key)
        if found is None:
            if len(self._starts) >= MOST_STARTS:
                self._starts.clear()
            full = self.model.start(start)
            found = self._starts[key] = self.encode(full, inputs) if self.encode else full
        return found

    @cached_property
    def _starts(self) -> dict[tuple[str | bytes, bytes], np.ndarray]:
        return {}

    def simulate(
        self, maneuver: Maneuver, start: Start, outputs: tuple[str, ...] | None = None
    ) -> Trajectory:
        """Integrate, then lift to full states at the maneuver's output times."""
        maneuver = checked_maneuver(maneuver, self.model.definition)
        run = self.run(maneuver, start)
        inputs = recorded_inputs(maneuver)[1]
        states = self._lifted(run, inputs)
        trust = self.judge(run, inputs) if self.judge else None
        found = self.model.recorded(maneuver, run, inputs, states, trust, outputs)
        run.give_back()
        return found

    def best_approximation(self, states: np.ndarray) -> np.ndarray | None:  # noqa: ARG002
        """There is no subspace."""
        return None
