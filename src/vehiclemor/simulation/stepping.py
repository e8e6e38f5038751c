"""Steps of a system from one time to another, each of them one call of the compiled time loop.

What the loop reads lies in arrays that are overwritten from step to step: nothing is packed anew.
"""

from __future__ import annotations

from collections.abc import Iterator
from ctypes import c_double
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vehiclemor.codegen.loops import ready
from vehiclemor.errors import ConvergenceError
from vehiclemor.inputs.sample_loops import Pieces
from vehiclemor.simulation.integrators.structures import Output, Spans
from vehiclemor.simulation.projection_windows import ProjectionWindows
from vehiclemor.simulation.rate_derivatives import Along, rate_derivatives
from vehiclemor.simulation.system import REASONS, System
from vehiclemor.simulation.trajectory import DYNAMIC_COUNTS
from vehiclemor.simulation.workspaces import NO_POINTS, Drive, Solver, Workspace

# Shortest step in s: the time loop takes times that differ by less for one.
SHORTEST = 1e-9


class StepSpace(NamedTuple):
    """A workspace of one step at a time, and what is overwritten for each.

    Attributes
    ----------
    times
        Arrays that end with the length of the step.
    window
        Number (1,) of the projection window.
    coefficients
        Of the inputs (1, inputs, 6).
    means
        Origins (windows, n) of the subspaces.
    first
        The word of the first step to try, as a number.
    """

    space: Workspace
    times: tuple[np.ndarray, ...]
    window: np.ndarray
    coefficients: np.ndarray
    means: np.ndarray
    first: c_double


class Stepper:
    """A system as a function of a state, the inputs and a length of time.

    Steps are independent of one another: the same arguments give the same state, in any thread.

    Parameters
    ----------
    windows
        Formulation of the system and its subspaces; in more windows than one the time tells which.
    solver, tolerance
        Integrator and its tolerance.
    moved
        Whether the state at the beginning is the origin of the window's subspace.
    """

    def __init__(
        self,
        system: System,
        windows: ProjectionWindows,
        solver: str,
        tolerance: float,
        moved: bool = False,
    ) -> None:
        self.system, self.windows, self.moved = system, windows, moved
        self.solver = Solver(solver, tolerance)
        self._spare: list[StepSpace] = []

    def step(
        self,
        state: np.ndarray,
        inputs: np.ndarray,
        dt: float,
        time: float = 0.0,
        next_inputs: np.ndarray | None = None,
    ) -> np.ndarray:
        """State (n,) after dt s; inputs are held, or go straight to those at the end.

        Raises
        ------
        ConvergenceError
            If the integration fails.
        """
        try:
            held = self._spare.pop()
        except IndexError:
            held = self._packed()
        space, coefficients = held.space, held.coefficients
        start, output = space.start, space.output
        start[:] = state
        slope = None if next_inputs is None else (next_inputs - inputs) / dt
        for begin, length, window in self._parts(time, dt):
            coefficients[0, :, 0] = inputs
            coefficients[0, :, 1] = 0.0
            if slope is not None:
                coefficients[0, :, 0] += begin * slope
                coefficients[0, :, 1] = length * slope
            for array in held.times:
                array[-1] = length
            held.first.value = length
            held.window[0] = window
            if self.moved:
                held.means[window] = start
            output.counts.fill(0)
            status = space.call()
            if status:
                reached = time + begin + space.buffer[0]
                raise ConvergenceError(f"{REASONS[status]} at t = {reached:.6g} s")
            start[:] = output.path[0]
        found = start.copy()
        self._spare.append(held)
        return found

    def _parts(self, time: float, dt: float) -> Iterator[tuple[float, float, int]]:
        """Parts of a step in one window each: beginning after `time`, length, window."""
        edges = self.windows.edges
        if len(edges) == 2:
            yield 0.0, dt, 0
            return
        slack = 1e-9 * max(float(edges[-1]), 1.0)
        first, last = np.searchsorted(edges[1:-1], (time + slack, time + dt - slack)).tolist()
        cuts = [0.0, *(edges[first + 1 : last + 1] - time).tolist(), dt]
        for window, (begin, end) in enumerate(pairwise(cuts), start=first):
            yield begin, end - begin, window

    def _packed(self) -> StepSpace:
        edges, coefficients = np.zeros(2), np.zeros((1, self.system.inputs, 6))
        span, window, sample = np.zeros(2), np.zeros(1, dtype=np.int64), np.ones(1)
        counts, one = np.zeros(len(DYNAMIC_COUNTS), dtype=np.int64), np.array([0, 1])
        signal = ready(Pieces(edges, one, np.empty(0), coefficients))
        spans = ready(Spans(span, np.zeros(1, dtype=np.int64), window))
        path = np.empty((1, len(self.system.error_scale)))
        windows = self.windows
        if self.moved:
            windows = replace(windows, means=windows.means.copy())
        drive = Drive(signal, spans, NO_POINTS[0])
        output = Output(sample, path, counts, *NO_POINTS, np.inf)
        space = self.system.packed(windows, self.solver, drive, output)
        words = space.call.words
        first = c_double.from_buffer(words, 8 * space.call.address("control.first"))
        times = edges, span, sample
        return StepSpace(space, times, window, coefficients, windows.means, first)

    def rates(self, state: np.ndarray, inputs: np.ndarray, time: float = 0.0) -> np.ndarray:
        """Time derivative (n,) of a state; of a projected one where its subspace is nearest."""
        n, half = len(state), len(state) // 2
        place = self.projected(state, inputs, time)
        rates = self._evaluated("derivative", place, inputs, n)
        if self.windows.formulation == "full":
            return rates
        _, trial, test = self._subspace(state, time)
        if self.windows.formulation == "state":
            return test @ rates @ trial
        q, moved = place[:half], test @ rates[:half] @ trial
        table = self._evaluated("second_order", place, inputs, half * (half + 1))
        mass, force = np.split(table.reshape(half, half + 1), [half], axis=1)
        projected = np.linalg.solve(trial @ mass @ trial.T, trial @ force)[:, 0] @ trial
        # Speeds are linear in the rates, so their change is too in what projection takes away.
        change = np.concatenate([q, projected - np.linalg.solve(mass, force)[:, 0]])
        change = self._evaluated("speeds", change, inputs, half)
        return np.concatenate([moved, rates[half:] + change])

    def projected(self, state: np.ndarray, inputs: np.ndarray, time: float = 0.0) -> np.ndarray:
        """State (n,) where the subspace of its time is nearest: there a step begins."""
        if self.windows.formulation == "full":
            return state
        mean, trial, test = self._subspace(state, time)
        n, half = len(state), trial.shape[1]
        q = mean[:half] + test @ (state[:half] - mean[:half]) @ trial
        if half == n:
            return q
        rates = test @ self._evaluated("derivative", state, inputs, n)[:half] @ trial
        moved = np.concatenate([q, rates])
        return np.concatenate([q, self._evaluated("speeds", moved, inputs, half)])

    def _subspace(self, state: np.ndarray, time: float) -> tuple[np.ndarray, ...]:
        """Origin (n,) and bases by rows: of states (r, n), or of coordinates (r / 2, n / 2)."""
        spaces, window = self.windows, next(self._parts(time, 2.0 * SHORTEST))[2]
        rows, columns = int(spaces.ranks[window]), len(state)
        if spaces.formulation == "coordinates":
            rows, columns = rows // 2, columns // 2
        mean = state if self.moved else spaces.means[window]
        trial, test = (b[window, :rows, :columns] for b in (spaces.trial_basis, spaces.test_basis))
        return mean, trial, test

    def derivatives(
        self, state: np.ndarray, inputs: np.ndarray, time: float, by: Along
    ) -> np.ndarray:
        """Analytic derivatives (n, columns) of the rates."""
        window = next(self._parts(time, 2.0 * SHORTEST))[2]
        return rate_derivatives(self.system, self.windows, window, state, inputs, by, self.moved)

    def _evaluated(
        self, kernel: str, state: np.ndarray, inputs: np.ndarray, size: int
    ) -> np.ndarray:
        return self.system.along(kernel, state[None], inputs[None], size)[0]
