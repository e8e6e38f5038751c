"""Steps, rates and their sensitivities of a system at single states.

A step is one call of the compiled time loop.  What the loop reads lies in arrays that are
overwritten from step to step: nothing is packed anew.
"""

from __future__ import annotations

from collections.abc import Iterator
from ctypes import c_double
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vehiclemor.codegen.loops import ready
from vehiclemor.exceptions import ConvergenceError
from vehiclemor.inputs.polynomial_loops import Pieces
from vehiclemor.simulation.evaluation import CONSTANTS, STATE, directional, partial
from vehiclemor.simulation.loop_arguments import Output, Spans
from vehiclemor.simulation.system import REASONS, System
from vehiclemor.simulation.trajectory import DYNAMIC_COUNTS
from vehiclemor.simulation.workspaces import Pool, Solver, Workspace

# Shortest step in s: the time loop takes times that differ by less for one.
SHORTEST = 1e-9
# A value (n,), and its sensitivities (n, columns).
Varied = tuple[np.ndarray, np.ndarray]


class Sensitivity(NamedTuple):
    """What derivatives are taken by: an argument of the kernels, of the constants directions."""

    argument: int
    directions: np.ndarray = np.zeros((0, 0))


class StepSpace(NamedTuple):
    """A workspace of one step at a time, and what is overwritten for each.

    Times are 0 and the length of the step; window is an index (1,), coefficients (1, 6, inputs) are
    of the inputs, first is the first step.
    """

    space: Workspace
    times: np.ndarray
    window: np.ndarray
    coefficients: np.ndarray
    first: c_double


class SteppedSystem:
    """A system as a function of a state, the inputs and a length of time.

    Steps are independent of one another: the same arguments give the same state, in any thread.
    """

    if TYPE_CHECKING:
        # A `System`, and its formulation with the subspaces, `ControlPeriods`; in more windows than
        # one the time says which.  Any: a field or a property.
        system: Any
        spaces: Any
        solver: str
        tolerance: float

    def step(
        self,
        state: np.ndarray,
        inputs: np.ndarray,
        dt: float,
        time: float = 0.0,
        next_inputs: np.ndarray | None = None,
    ) -> np.ndarray:
        """State (n,) after dt s; inputs are held, or go straight to those at the end.

        `ConvergenceError` if the integration fails.
        """
        held = self._pool.taken(None, self._packed)
        space, coefficients = held.space, held.coefficients
        start, output = space.memory.start, space.output
        start[:] = state
        slope = None if next_inputs is None else (next_inputs - inputs) / dt
        for begin, length, window in self._parts(time, dt):
            coefficients[0, 0] = inputs
            coefficients[0, 1] = 0.0
            if slope is not None:
                coefficients[0, 0] += begin * slope
                coefficients[0, 1] = length * slope
            held.times[1] = length
            held.first.value = length
            held.window[0] = window
            output.counts.fill(0)
            status = space.call()
            if status:
                reached = time + begin + space.memory.buffer[0]
                raise ConvergenceError(f"{REASONS[status]} at t = {reached:.6g} s")
            start[:] = output.states[0]
        after = start.copy()
        self._pool.give_back(None, held)
        return after

    @cached_property
    def _pool(self) -> Pool[StepSpace]:
        return Pool()

    def _parts(self, time: float, dt: float) -> Iterator[tuple[float, float, int]]:
        """Parts of a step in one window each: beginning after `time`, length, window."""
        edges = self.spaces.edges
        if len(edges) == 2:
            yield 0.0, dt, 0
            return
        slack = 1e-9 * max(float(edges[-1]), 1.0)
        first, last = np.searchsorted(edges[1:-1], (time + slack, time + dt - slack)).tolist()
        cuts = [0.0, *(edges[first + 1 : last + 1] - time).tolist(), dt]
        for window, (begin, end) in enumerate(pairwise(cuts), start=first):
            yield begin, end - begin, window

    def _packed(self) -> StepSpace:
        times, coefficients = np.zeros(2), np.zeros((1, 6, self.system.inputs))
        window, counts = (np.zeros(size, dtype=np.int64) for size in (1, len(DYNAMIC_COUNTS)))
        signal = ready(Pieces(times, np.array([0, 1]), np.empty(0), coefficients))
        spans = ready(Spans(times, np.zeros(1, dtype=np.int64), window))
        output = Output.of(times[1:], np.empty((1, len(self.system.error_scale))), counts)
        how = Solver(self.solver, self.tolerance)
        space = self.system.packed(self.spaces, how, signal, spans, output)
        words = space.call.words
        first = c_double.from_buffer(words, 8 * space.call.address("control.first"))
        return StepSpace(space, times, window, coefficients, first)

    def rates(self, state: np.ndarray, inputs: np.ndarray, time: float = 0.0) -> np.ndarray:
        """Time derivative (n,) of a state; of a projected one where its subspace is nearest."""
        if self.spaces.formulation == "full":
            return self.system.values_at("derivative", state[None], inputs[None], len(state))[0]
        return self._projected_rates(_Kernels(self.system, inputs), state, time)[0]

    def rate_sensitivities(
        self, state: np.ndarray, inputs: np.ndarray, time: float, by: Sensitivity
    ) -> np.ndarray:
        """Analytic derivatives (n, columns) of the rates."""
        kernels = _Kernels(self.system, inputs, by)
        if self.spaces.formulation == "full":
            return kernels.at_state("derivative", state, len(state))
        return self._projected_rates(kernels, state, time)[1]

    def projected(self, state: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """State (n,) where the subspace of the first window is nearest: there a run begins."""
        if self.spaces.formulation == "full":
            return state
        return self._nearest(_Kernels(self.system, inputs), state, self._subspace(0.0))[0]

    def _subspace(self, time: float) -> tuple[np.ndarray, ...]:
        """Mean (n,) and bases by rows: of states (r, n), or of coordinates (r / 2, n / 2)."""
        spaces, window = self.spaces, next(self._parts(time, 2.0 * SHORTEST))[2]
        rows, columns = int(spaces.ranks[window]), spaces.means.shape[1]
        if spaces.formulation == "coordinates":
            rows, columns = rows // 2, columns // 2
        trial, test = (b[window, :rows, :columns] for b in (spaces.trial_basis, spaces.test_basis))
        return spaces.means[window, :columns], trial, test

    def _nearest(
        self, kernels: _Kernels, state: np.ndarray, subspace: tuple[np.ndarray, ...]
    ) -> Varied:
        """State where a subspace is nearest."""
        (mean, trial, test), (n, half) = subspace, (len(state), subspace[1].shape[1])
        change = kernels.seeds(n)
        q, dq = mean + test @ (state[:half] - mean) @ trial, trial.T @ (test @ change[:half])
        if half == n:
            return q, dq
        rates, drates = kernels.of("derivative", state, change, n)
        rates, drates = test @ rates[:half] @ trial, trial.T @ (test @ drates[:half])
        turned = np.concatenate([q, rates]), np.vstack([dq, drates])
        speeds, dspeeds = kernels.of("speeds", *turned, half)
        return np.concatenate([q, speeds]), np.vstack([dq, dspeeds])

    def _projected_rates(self, kernels: _Kernels, state: np.ndarray, time: float) -> Varied:
        """Rates of the projected equations."""
        n, subspace = len(state), self._subspace(time)
        (_, trial, test), half = subspace, n // 2
        x, dx = self._nearest(kernels, state, subspace)
        rates, drates = kernels.of("derivative", x, dx, n)
        if self.spaces.formulation == "state":
            return test @ rates @ trial, trial.T @ (test @ drates)
        size = half * (half + 1)
        table, dtable = kernels.of("second_order", x, dx, size)
        table, dtable = table.reshape(half, half + 1), dtable.reshape(half, half + 1, -1)
        mass, force, dmass, dforce = table[:, :-1], table[:, -1], dtable[:, :-1], dtable[:, -1]
        small = trial @ mass @ trial.T
        reduced = np.linalg.solve(small, trial @ force) @ trial
        free = np.linalg.solve(mass, force)
        dreduced = dfree = drates[:half]
        if kernels.by is not None:
            left = [dforce - np.einsum("ijk,j->ik", dmass, q) for q in (reduced, free)]
            dreduced = trial.T @ np.linalg.solve(small, trial @ left[0])
            dfree = np.linalg.solve(mass, left[1])
        # Speeds are linear in the rates, so their change is too in what projection takes away.
        change = np.concatenate([x[:half], reduced - free])
        dchange = np.vstack([dx[:half], dreduced - dfree])
        lost, dlost = kernels.of("speeds", change, dchange, half)
        moved, dmoved = test @ rates[:half] @ trial, trial.T @ (test @ drates[:half])
        return (
            np.concatenate([moved, rates[half:] + lost]),
            np.vstack([dmoved, drates[half:] + dlost]),
        )


class _Kernels(NamedTuple):
    """Kernels of a system at states that vary; without `by` sensitivities have no columns."""

    system: System
    inputs: np.ndarray
    by: Sensitivity | None = None

    def seeds(self, n: int) -> np.ndarray:
        """Sensitivities (n, columns) of the state that is given."""
        if self.by is None or self.by.argument == STATE:
            return np.eye(n, n if self.by else 0)
        constants = self.by.argument == CONSTANTS
        return np.zeros((n, len(self.by.directions if constants else self.inputs)))

    def at_state(self, name: str, x: np.ndarray, size: int) -> np.ndarray:
        """Sensitivities (size, columns) at a state that doesn't vary but by itself."""
        assert self.by is not None
        arrays = x, self.inputs, self.system.constants
        if self.by.argument == CONSTANTS:
            return directional(self.system.kernels, name, arrays, size, *self.by).T
        return partial(self.system.kernels, name, arrays, size, self.by.argument)

    def of(self, name: str, x: np.ndarray, dx: np.ndarray, size: int) -> Varied:
        """Result of a kernel with its sensitivities, at a state with sensitivities (n, columns)."""
        value = self.system.values_at(name, x[None], self.inputs[None], size)[0]
        if self.by is None:
            return value, np.zeros((size, 0))
        arrays, seeds = (x, self.inputs, self.system.constants), np.ascontiguousarray(dx.T)
        change = directional(self.system.kernels, name, arrays, size, STATE, seeds).T
        if self.by.argument != STATE:
            change = change + self.at_state(name, x, size)
        return value, change
