"""First-order systems dx/dt = f(x, u) as the compiled loops take them, full and reduced alike."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import ModuleType

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.maneuvers import Maneuver
from vehiclemor.registry import unknown
from vehiclemor.simulation import system_loops
from vehiclemor.simulation.checks import check_positive, check_times, loop_array
from vehiclemor.simulation.clock import timed
from vehiclemor.simulation.compiled_loops import loops_module
from vehiclemor.simulation.exponential_functions import TABLES, exponential_tables
from vehiclemor.simulation.rosenbrock_methods import RODAS4, ROS34PW2
from vehiclemor.simulation.signals import signal_of
from vehiclemor.simulation.spaces import Spaces
from vehiclemor.simulation.trajectory import DYNAMIC_COUNTS

SOLVERS = ("explicit", "rodas4", "ros34pw2", "etdrk4")
# Those with one Jacobian for all runs.
FROZEN = ("ros34pw2", "etdrk4")
# Below it there is only rounding.
SMALLEST_TOLERANCE = 1e-13
# A run that needs more evaluations of its right-hand side than this is going nowhere.
MOST_CALLS = 100_000
# Longest first step (s) after a break point of the inputs.
RESTART = 0.05
# Step sizes (s) for which inverses and matrix functions are stored.  Where a step and its rung
# differ more, its error grows and steps are rejected.
LADDER = 2.0 ** (0.125 * np.arange(-128, 25))
REASONS = {
    1: f"more than {MOST_CALLS} evaluations of the right-hand side",
    2: "a state is not finite",
    3: "the matrix of a linear system is singular",
    4: "the step size has become too small",
}


@dataclass(frozen=True)
class Run:
    """What a compiled run leaves behind.

    Attributes
    ----------
    times
        Output times (samples,) in s.
    path
        States (samples, dim) at these times; not a number from a failure on.
    counts
        Numbers in the order of `DYNAMIC_COUNTS`.
    seconds
        Time spent in the compiled loop.
    failure
        Why the run has ended early, empty if it has not.
    """

    times: np.ndarray
    path: np.ndarray
    counts: np.ndarray
    seconds: float
    failure: str


@dataclass(frozen=True, eq=False)
class System:
    """A first-order system whose right-hand side is machine code.

    Attributes
    ----------
    machine
        Constants and addresses of the kernels, see `system_loops`.
    inputs
        Number of inputs.
    reference
        State (dim,) at which the Jacobian is frozen, all inputs zero.
    typical
        Magnitude of each state (dim,) below which errors are measured absolutely.
    active
        Numbers of the states that the right-hand side depends on.
    turning
        Numbers of the heading and of the pairs of states that turn with it; may be empty.
    stepped
        Whether a kernel takes whole steps of the W-method, see `stepped_loops`.
    diagonal
        Numbers of states by diagonal block of the Jacobian, if a kernel takes whole steps of the
        exponential method, see `modal_loops`; may be empty.
    """

    machine: tuple[np.ndarray, np.ndarray]
    inputs: int
    reference: np.ndarray
    typical: np.ndarray
    active: np.ndarray
    turning: np.ndarray
    stepped: bool = False
    diagonal: tuple[tuple[int, ...], ...] = ()

    @property
    def loops(self) -> ModuleType:
        """Module of compiled loops, the same for all systems."""
        return loops_module()

    def jacobian(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """df/dx (dim, dim) by central differences; columns of inactive states are zero."""
        result = np.empty((len(x), len(x)))
        self.loops.jacobian_at(loop_array(x), loop_array(u), self.machine, self.active, result)
        return result

    @cached_property
    def frozen_jacobian(self) -> np.ndarray:
        """Jacobian (dim, dim) at the reference state, no inputs."""
        return self.jacobian(self.reference, np.zeros(self.inputs))

    @cached_property
    def frozen_inverses(self) -> np.ndarray:
        """Transposed active columns of (I - gamma h J)^-1 on the ladder of step sizes."""
        frozen = self.frozen_jacobian
        identity = np.eye(len(frozen))
        inverses = [np.linalg.inv(identity - ROS34PW2.gamma * h * frozen) for h in LADDER]
        return loop_array(np.stack([inverse[:, self.active].T for inverse in inverses]))

    @cached_property
    def frozen_exponentials(self) -> np.ndarray:
        """Matrix functions of the exponential method on the ladder, see `exponential_loops`."""
        if not self.diagonal:
            tables = exponential_tables(self.frozen_jacobian, LADDER)
            return loop_array(tables.reshape(len(LADDER), -1, tables.shape[-1]))
        parts = []
        for numbers in self.diagonal:
            block = exponential_tables(self.frozen_jacobian[np.ix_(numbers, numbers)], LADDER)
            parts.append(block.swapaxes(2, 3).reshape(len(LADDER), TABLES, -1))
        entries = np.concatenate(parts, axis=2)
        return loop_array(entries.reshape(len(LADDER), 1, -1))

    def run(
        self,
        maneuver: Maneuver,
        state: np.ndarray,
        spaces: Spaces,
        solver: str,
        tolerance: float,
        times: np.ndarray | None = None,
        longest_step: float | None = None,
    ) -> Run:
        """Integrate from a state (dim,) over a maneuver; see `arguments`."""
        arguments = self.arguments(maneuver, state, spaces, solver, tolerance, times, longest_step)
        sampled, path, counts = arguments[-3:]
        if not self.loops.run.signatures:
            # Compile, or load machine code, outside of the time that is measured.
            edges, one = np.array([0.0, 1e-9]), np.zeros(1, dtype=np.int64)
            copies = path.copy(), counts.copy()
            self.loops.run(*arguments[:3], edges, one, one, *arguments[6:-2], *copies)
        (status, reached), seconds = timed(lambda: self.loops.run(*arguments), counts)
        failure = f"{REASONS[status]} at t = {reached:.6g} s" if status else ""
        return Run(sampled, path, counts, seconds, failure)

    def arguments(
        self,
        maneuver: Maneuver,
        state: np.ndarray,
        spaces: Spaces,
        solver: str,
        tolerance: float,
        times: np.ndarray | None = None,
        longest_step: float | None = None,
    ) -> tuple:
        """Arguments of the compiled `run`; times, path and counts come last.

        Parameters
        ----------
        maneuver
            Its inputs are the system's.
        state
            Initial state (dim,).
        spaces
            Form of the system and its subspaces by window.
        solver, tolerance
            One of `SOLVERS`; largest local error of a state relative to its typical size.
        times
            Output times (samples,) in s, the maneuver's by default.
        longest_step
            In s; unlimited by default.

        Raises
        ------
        InputError
            If a value is out of bounds or a name is unknown.
        """
        times = maneuver.times if times is None else loop_array(times)
        check_positive("tolerance", tolerance, SMALLEST_TOLERANCE)
        if longest_step is not None:
            check_positive("longest_step", longest_step)
        if solver not in SOLVERS:
            raise unknown("solver", solver, SOLVERS)
        full = spaces.form == system_loops.FULL
        if solver in FROZEN and not full:
            raise InputError(f"{solver} freezes the full model's Jacobian: not for a reduced model")
        tableau = ROS34PW2 if solver == "ros34pw2" else RODAS4
        frozen, stored = self._frozen(solver)
        check_times(times, maneuver)
        signal = signal_of(maneuver)
        end = float(times[-1]) if len(times) else maneuver.duration
        edges, segments, windows = spaces.spans(signal.edges, end)
        path = np.full((len(times), len(state)), np.nan)
        counts = np.zeros(len(DYNAMIC_COUNTS), dtype=np.int64)
        return (
            spaces.form,
            solver == "explicit",
            loop_array(state),
            loop_array(edges),
            segments,
            windows,
            *spaces.arrays,
            signal.arrays,
            self.machine,
            self.typical,
            (float(tolerance), float(longest_step or np.inf), MOST_CALLS),
            RESTART,
            tableau.arguments,
            frozen,
            self.active if full else np.arange(spaces.ranks.max()),
            self.turning,
            LADDER,
            stored,
            times,
            path,
            counts,
        )

    def _frozen(self, solver: str) -> tuple[int, np.ndarray]:
        """Number by which the compiled `run` knows a solver, and what is stored for it."""
        if solver == "ros34pw2":
            return 2 if self.stepped else 1, self.frozen_inverses
        if solver == "etdrk4":
            return 4 if self.diagonal else 3, self.frozen_exponentials
        return 0, np.zeros((1, 1, 1))
