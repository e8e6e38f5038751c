"""Models in reduced states that are stepped: systems of equations of motion, and mechanisms."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.exceptions import ConvergenceError, InputError
from vehiclemor.inputs.checks import checked_maneuver
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.reduction.interface import OfflineCost
from vehiclemor.registry import choice
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.dynamic import RESULTS, DynamicModel
from vehiclemor.simulation.evaluation import CONSTANTS, INPUTS, PLACES, STATE, By, parameter_names
from vehiclemor.simulation.stepping import Sensitivity, SteppedSystem
from vehiclemor.simulation.trajectory import Start, Trajectory, Trust
from vehiclemor.simulation.workspaces import Run, Solver

# Initial conditions whose reduced states are cached.
MOST_STARTS = 64


class SteppedModel(ShortRepr):
    """What systems and mechanisms share whose states are those of the model."""

    def decode(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Full states (samples, n) of states (samples, dim) at inputs (samples, inputs)."""
        del inputs
        return states

    def trust(self, states: np.ndarray, inputs: np.ndarray) -> Trust | None:
        """How far states (samples, dim) go in what the model knows, if it judges itself."""

    def best_approximation(self, states: np.ndarray) -> np.ndarray | None:
        """There is no subspace."""


class ReducedSystem(SteppedSystem, SteppedModel):
    """Base of systems in reduced states of a full-order model, with the ways there and back.

    A subclass is a dataclass that has the attributes below, as fields or cached properties, and
    overrides what differs from the model's states: `states`, `encode`, `decode`,
    `decoder_slopes`, `trust`.

    Attributes
    ----------
    system, spaces
        The equations that are integrated; their form, and their subspaces if they are projected.
    order
        Number of coordinates or modes that stand for the model's.
    """

    if TYPE_CHECKING:
        model: DynamicModel
        order: Any
        offline: OfflineCost

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states that are stepped."""
        return self.model.definition.states

    def encode(self, state: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """State (dim,) of a full one (2 n,) and the inputs (inputs,) at that time."""
        del inputs
        return state

    def decoder_slopes(
        self, state: np.ndarray, inputs: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the full state (2 n, dim) and (2 n, inputs) by state and inputs."""
        return np.eye(len(state)), np.zeros((len(state), len(inputs)))

    def begin(self, start: Start, inputs: np.ndarray) -> np.ndarray:
        """State (dim,) of a start, as `simulate` begins with it: in the first window's subspace."""
        return self.projected(self.known(start, inputs)[1], inputs).copy()

    def known(self, start: Start, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Full and reduced state of a start at inputs; cached by its name or its numbers."""
        name = start if isinstance(start, str) else self.model.start(start).tobytes()
        key = name, inputs.tobytes()
        states = self._starts.get(key)
        if states is None:
            if len(self._starts) >= MOST_STARTS:
                self._starts.clear()
            state = self.model.start(start)
            states = self._starts[key] = state, self.encode(state, inputs)
        return states

    @cached_property
    def _starts(self) -> dict[tuple[str | bytes, bytes], tuple[np.ndarray, np.ndarray]]:
        return {}

    def sensitivities(
        self, state: np.ndarray, inputs: np.ndarray, time: float, by: By, of: str
    ) -> np.ndarray:
        """Analytic derivatives of the rates or of the outputs."""
        function, names = RESULTS[choice("of", of, RESULTS)], parameter_names(by)
        if not names:
            sensitivity = Sensitivity(PLACES[str(by)])
        elif np.array_equal(self.system.constants, self.model.constants):
            sensitivity = Sensitivity(CONSTANTS, self.model.constant_derivatives(names))
        else:
            raise InputError(
                f"the reduced equations of {self.model.name} don't know {', '.join(names)}: "
                f"reduce a model with another value"
            )
        if function == "derivative":
            return self.rate_sensitivities(state, inputs, time, sensitivity)
        full = self.decode(state[None], inputs[None])[0]
        slopes = self.decoder_slopes(state, inputs)
        by_state = self.model.jacobian_of(function, full, inputs, "state")
        if sensitivity.argument == STATE:
            return by_state @ slopes[STATE]
        direct = self.model.jacobian_of(function, full, inputs, by)
        return direct + by_state @ slopes[INPUTS] if sensitivity.argument == INPUTS else direct

    def run(self, maneuver: Excitation, state: np.ndarray, record_all_until: float = np.inf) -> Run:
        """Path of the states, from a state (dim,); see `System.run`."""
        how = Solver(self.solver, self.tolerance)
        return self.system.run(maneuver, state, self.spaces, how, record_all_until)

    def simulate(
        self, maneuver: Excitation, start: Start, outputs: tuple[str, ...] | None = None
    ) -> Trajectory:
        """Integrate, then decode to full states at the maneuver's output times."""
        maneuver = checked_maneuver(maneuver, self.model.definition)
        inputs = maneuver.recorded_inputs[1]
        run = self.run(maneuver, self.known(start, inputs[0])[1])
        states = self.decode(run.output.states, inputs)
        trajectory = self.model.recorded(maneuver, run, inputs, states, outputs=outputs)
        run.give_back()
        return trajectory


class ReducedMechanism(SteppedModel):
    """Base of kinematic models: the coordinates, which are the states, follow from the inputs.

    A subclass is a dataclass that has `order`, `offline` and `simulate` too.
    """

    if TYPE_CHECKING:
        model: AlgebraicModel

    def solved(self, time: float, inputs: np.ndarray, state: np.ndarray) -> Trajectory:
        """Solution at one time in s and inputs (1, inputs), sought from coordinates (n,)."""
        raise NotImplementedError

    def slopes(self, state: np.ndarray, inputs: np.ndarray, by: By, of: str) -> np.ndarray:
        """Analytic derivatives of the coordinates or the outputs."""
        del state, inputs, by, of
        raise InputError(f"this reduction of {self.model.name} has no analytic derivatives")

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return self.model.coordinates

    def begin(self, start: Start, inputs: np.ndarray) -> np.ndarray:
        """Coordinates at the inputs."""
        return self.step(self.model.start(start), inputs, 0.0)

    def step(
        self,
        state: np.ndarray,
        inputs: np.ndarray,
        dt: float,
        time: float = 0.0,
        next_inputs: np.ndarray | None = None,
    ) -> np.ndarray:
        """Coordinates at the end of the step."""
        ends = inputs if next_inputs is None else next_inputs
        solution = self.solved(time + dt, ends[None], state)
        if solution.status == "diverged":
            raise ConvergenceError(f"{self.model.name}: {solution.message}", solution)
        return solution.coordinates[0].copy()

    def rates(self, state: np.ndarray, inputs: np.ndarray, time: float = 0.0) -> np.ndarray:
        """There are none."""
        del state, inputs, time
        raise InputError(f"{self.model.name} is kinematic: its equations have no rates")

    def sensitivities(
        self, state: np.ndarray, inputs: np.ndarray, time: float, by: By, of: str
    ) -> np.ndarray:
        """Those of `coordinates` or `outputs`; there are no rates."""
        if of == "rhs":
            self.rates(state, inputs, time)
        return self.slopes(state, inputs, by, of)
