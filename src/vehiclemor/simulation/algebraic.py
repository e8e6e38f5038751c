"""Kinematic models (kind `ae`) ready to run: compiled kernels with one parameter set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from vehiclemor.codegen.loops import Loop, Prepared, Ready, address_of_array, loops, ready
from vehiclemor.codegen.operations import LANES
from vehiclemor.exceptions import ConvergenceError, GeometryError, InputError, UnreachableError
from vehiclemor.inputs.checks import checked_maneuver
from vehiclemor.inputs.excitation import Excitation, cached
from vehiclemor.multibody.definition import DESIGN_START
from vehiclemor.registry import choice
from vehiclemor.simulation import newton_loops
from vehiclemor.simulation.checks import check_positive, checked_array, checked_inputs, output_times
from vehiclemor.simulation.evaluation import By, address_of
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.run_timer import timed
from vehiclemor.simulation.trajectory import ALGEBRAIC_COUNTS, Names, Start, Trajectory
from vehiclemor.simulation.workspaces import Pool

# Input increment (m) above which a step of the input is cut into substeps.
LARGEST_INCREMENT = 5e-3
NEWTON_TOLERANCE = 1e-12
ITERATION_LIMIT = 50
SOLVERS = ("newton", "newton_lanes")
RESULTS = ("residual", "outputs", "coordinates")
# Largest gap (m or rad) between joints at which coordinates count as a solution, and with which a
# mechanism counts as assembled.
CLOSED, ASSEMBLED = 1e-6, 1e-9
# Smallest singular value of the Jacobian at design below which a mechanism counts as locked.
SMALLEST_SINGULAR_VALUE = 1e-8
# Steps (m) of the inputs: shortest to a sample, and in the search for the limits of travel.
SHORTEST_STEP, SHORTEST_SEARCH_STEP = 1e-9, 1e-7
# Loops of the full-order solution.
KINEMATIC_LOOPS = ("simulation.integrators.dense_solves", "simulation.newton_loops")
REASONS = {
    newton_loops.TOO_MANY_ITERATIONS: f"no convergence in {ITERATION_LIMIT} iterations",
    newton_loops.NOT_FINITE: "a coordinate is not finite",
    newton_loops.SINGULAR: "the matrix of a linear system is singular",
    newton_loops.OFF_BRANCH: "Newton's method does not contract, however short the step",
}


# Times, inputs, and the inputs as an argument of loops.
Sampled = tuple[np.ndarray, np.ndarray, Ready]
# A loop with its arguments, its counts, and the word of the address of its table.
LaneRun = tuple[Prepared, np.ndarray, int]


@dataclass(frozen=True, eq=False)
class AlgebraicModel(Model):
    """Compiled residual equations Phi(q; u) = 0 of one mechanism."""

    loops, reference = KINEMATIC_LOOPS, ("newton", NEWTON_TOLERANCE)

    def __post_init__(self) -> None:
        """`GeometryError` where it can't be assembled or is locked at design."""
        super().__post_init__()
        nothing = np.zeros(len(self.inputs))
        gap = float(np.abs(self.residual(self.design, nothing)).max())
        if not gap < ASSEMBLED:
            raise GeometryError(
                f"the geometry can't be assembled: the joints are {gap:.3g} m apart"
            )
        jacobian = self.jacobian(self.design, nothing)
        smallest = float(np.linalg.svd(jacobian, compute_uv=False)[-1])
        if smallest < SMALLEST_SINGULAR_VALUE:
            raise GeometryError(
                f"the geometry can't be assembled: the mechanism is locked at design "
                f"(smallest singular value of the Jacobian {smallest:.1e})"
            )

    @property
    def design(self) -> np.ndarray:
        """Coordinates (n,) at the design position, where all inputs are zero."""
        return self.initial[DESIGN_START]

    def start(self, name: Start | None = None) -> np.ndarray:
        """Coordinates (n,) at the design position, whose name is the only start."""
        self.check_start(name)
        return self.design.copy()

    def check_start(self, name: Start | None) -> None:
        """Raise `InputError` if it is another name, or coordinates: the inputs give these."""
        if not isinstance(name, str | None):
            raise InputError(
                f"{self.name} starts from {DESIGN_START!r} alone: its inputs say where it is"
            )
        if name is not None:
            choice("start", name, self.initial)

    def residual(self, q: Any, u: Any) -> np.ndarray:
        """Residual Phi(q; u), shape (n,)."""
        return self.evaluated("residual", q, u)

    def jacobian(
        self, state: Any, u: Any, with_respect_to: By = "state", of: str = "residual"
    ) -> np.ndarray:
        """Analytic derivatives of `residual`, `outputs` or `coordinates`, see `Model.jacobian`.

        By the state: of the residual or of the outputs as functions of q.  By inputs or parameters:
        of the residual with q held, of coordinates and outputs with q following, by the implicit
        function theorem dq = -Phi_q^-1 Phi_u du; the coordinates must close the joints.
        """
        of, by = choice("of", of, RESULTS), with_respect_to
        if by == "state" and of == "coordinates":
            raise InputError("derivatives of the coordinates are by inputs or parameters")
        if of == "residual" and by == "state":
            return self.evaluated("residual_jacobian", state, u)[:, :-1].copy()
        if of == "residual" or by == "state":
            return self.jacobian_of(of, state, u, by)
        gap = float(np.abs(self.evaluated("residual", state, u)).max())
        if not gap < CLOSED:
            raise InputError(f"{self.name}: at these coordinates the joints are {gap:.3g} m apart")
        change = self.jacobian_of("residual", state, u, by)
        moved = -np.linalg.solve(self.evaluated("residual_jacobian", state, u)[:, :-1], change)
        if of == "coordinates":
            return moved
        follows = self.jacobian_of(of, state, u, "state") @ moved
        return self.jacobian_of(of, state, u, by) + follows

    def joints_at(self, q: Any) -> dict[str, np.ndarray]:
        """Positions (3,) in m of the moving joints, for drawing."""
        positions = self.evaluated("joints", q, np.zeros(len(self.inputs)))
        return dict(zip(self.definition.joints, positions, strict=True))

    def solve(self, u: Any) -> np.ndarray:
        """Coordinates (n,) at inputs u, on the branch of the design position, see `simulate`."""
        inputs = self._inputs(u)[None, :]
        return self.solve_path(np.zeros(1), inputs).coordinates[0]

    def reach(self, rack: float = 0.0) -> tuple[float, float]:
        """Lowest and highest reachable wheel travel (m) at a rack displacement (m).

        It is what can be reached by moving the rack at the design height, then the wheel: up to the
        first fold, where the Jacobian is singular, or to the first of the model's `stops`, to
        1e-6 m on the side that can be reached.  The folds alone would let the reach jump: those of
        the double wishbone's lower limit end in a cusp at a rack of 0.28 mm, beyond which the wheel
        goes 39 mm further down while its steering angle runs from 1 to 3 rad.

        `UnreachableError` if not even the design height can be reached at this displacement.
        """
        (rack,) = checked_array(rack, 1, "rack displacement", self.name)
        low, high = (self._limit(rack, end) for end in (-1.0, 1.0))
        return low, high

    def _limit(self, rack: float, direction: float) -> float:
        """How far (m) the height gets downwards (-1) or upwards (1) at a rack displacement (m)."""
        target, reached = np.array([direction * self.definition.travel_limit, rack]), np.empty(2)
        iteration = _iteration(NEWTON_TOLERANCE, SHORTEST_SEARCH_STEP)
        loop = kinematic_loop("travel_limit")
        loop(self._mechanism, target, iteration, reached, self._buffer())
        if reached[1] != rack:
            raise UnreachableError(
                f"{self.name}: rack displacement {rack:g} m is out of reach at the design height; "
                f"it goes to {reached[1]:.4f} m"
            )
        return float(reached[0])

    @cached_property
    def _mechanism(self) -> Ready:
        stops = self.definition.stops
        largest = np.array([stops.get(name, np.inf) for name in self.coordinates])
        jacobian = self.jacobian(self.design, np.zeros(len(self.inputs)))
        orientation = int(np.linalg.slogdet(jacobian).sign)
        kernels = self.addresses("newton_step", "residual_jacobian")
        fields = self.design, largest, self.constants, kernels, orientation
        return ready(newton_loops.Mechanism(*fields))

    def _buffer(self) -> np.ndarray:
        n = len(self.coordinates)
        return np.empty(n * (n + 4) + 2 * len(self.inputs))

    def simulate(
        self,
        maneuver: Excitation,
        start: Start | None = None,
        times: np.ndarray | None = None,
        solver: str | None = None,
        tolerance: float | None = None,
        outputs: Names = None,
    ) -> Trajectory:
        """Full-order solution, see `Model.simulate`."""
        self.check_start(start)
        solver = "newton" if solver is None else solver
        tolerance = NEWTON_TOLERANCE if tolerance is None else tolerance
        if times is None:
            run = self._solved(self.sampled(maneuver), solver, tolerance)
        else:
            maneuver = checked_maneuver(maneuver, self.definition)
            times = output_times(times, maneuver, repeats=True)
            run = self.solve_path(times, maneuver.at(times), solver, tolerance)
        return run if outputs is None else run.chosen(outputs)

    def sampled(self, maneuver: Excitation) -> Sampled:
        """Output times in s of a maneuver and its inputs, ready for loops; to be read only."""
        return _sampled(checked_maneuver(maneuver, self.definition))

    def solve_path(
        self,
        times: np.ndarray,
        inputs: np.ndarray,
        solver: str = "newton",
        tolerance: float = NEWTON_TOLERANCE,
    ) -> Trajectory:
        """Full-order solution for inputs (samples, number of inputs); see `simulate`."""
        times = checked_array(times, np.size(times), "times", self.name)
        inputs = checked_inputs(inputs, times, self.inputs)
        sampled = times, inputs, ready(newton_loops.Samples(inputs))
        return self._solved(sampled, solver, tolerance)

    def _solved(self, sampled: Sampled, solver: str, tolerance: float) -> Trajectory:
        run = self.solved_as_far(sampled, solver, tolerance)
        if run.status == "ok":
            return run
        times, inputs, _ = sampled
        self._check_reach(times, inputs, int(np.isfinite(run.coordinates[:, 0]).sum()))
        raise ConvergenceError(f"{self.name}: {run.message} (newton)", run)

    def solved_as_far(self, sampled: Sampled, solver: str, tolerance: float) -> Trajectory:
        """Solution up to where there is none on the branch: from there on it has diverged."""
        check_positive("tolerance", tolerance)
        choice("solver", solver, SOLVERS)
        times, inputs, given = sampled
        n = len(self.coordinates)
        if solver == "newton_lanes" and len(times) >= LANES:
            trajectory = self._solved_in_lanes(sampled, _iteration(tolerance, SHORTEST_STEP))
            if trajectory is not None:
                return trajectory
        path = np.full((len(inputs), n), np.nan)
        solution = newton_loops.Solution(path, new_counts())
        iteration, buffer = _iteration(tolerance, SHORTEST_STEP), self._buffer()
        arguments = self._mechanism, given, iteration, solution, buffer
        status, seconds = timed(kinematic_loop("newton_path").prepared(*arguments))
        return self.trajectory(times, inputs, path, solution.counts.tolist(), seconds, status)

    def _solved_in_lanes(self, sampled: Sampled, iteration: Ready) -> Trajectory | None:
        """Solution with the samples in vector lanes, as many at least; none if it fails."""
        (times, inputs, given), n = sampled, len(self.coordinates)
        kind = given, iteration
        run = call, counted, table_word = self._lanes.taken(kind, lambda: self._packed(*kind))
        # One table is written faster than two.
        table = np.empty((len(inputs), n + len(self.outputs)))
        call.words[table_word] = address_of_array(table)
        status, seconds = timed(call)
        counts = counted.tolist()
        self._lanes.give_back(kind, run)
        if status:
            return None
        return self.trajectory(times, inputs, table[:, :n], counts, seconds, 0, table[:, n:])

    @cached_property
    def _lanes(self) -> Pool[LaneRun]:
        return Pool()

    def _packed(self, samples: Ready, iteration: Ready) -> LaneRun:
        n, inputs, m = len(self.coordinates), len(self.inputs), len(self.outputs)
        lane_kernels = self.addresses("newton_step", "outputs", lanes=LANES)
        solution = newton_loops.Solution(np.empty((0, n + m)), new_counts())
        buffer = np.empty(LANES * (5 * n + inputs + m) + n * (n + 1))
        loop = kinematic_loop("lane_path")
        shared = self._mechanism, samples, lane_kernels, iteration
        call = loop.prepared(*shared, solution, buffer)
        table = call.address("solution.path")
        call.words[table + 1] = len(samples.bundle.inputs)
        return call, solution.counts, table

    def trajectory(
        self,
        times: np.ndarray,
        inputs: np.ndarray,
        path: np.ndarray,
        counts: Sequence[int],
        seconds: float,
        reason: int = newton_loops.CONVERGED,
        outputs: np.ndarray | None = None,
    ) -> Trajectory:
        """Trajectory of a path of coordinates; `reason` is why a loop has stopped.

        Outputs are those of the path where none are given.
        """
        status, message = "ok", ""
        if reason:
            status = "diverged"
            message = f"{REASONS[reason]} at t = {times[counts[newton_loops.SAMPLE]]:.6g} s"
        return Trajectory.of(
            times=times,
            inputs=inputs,
            coordinates=path,
            speeds=path[:, :0],
            outputs=self.values_at("outputs", path, inputs) if outputs is None else outputs,
            counts=dict(zip(ALGEBRAIC_COUNTS, counts, strict=False)),
            seconds=seconds,
            status=status,
            message=message,
            names=self.outputs,
            model=self,
        )

    def addresses(self, *names: str, lanes: int = 1) -> np.ndarray:
        """Addresses of kernels for loops, which take so many samples at once."""
        return np.array([address_of(self.kernels, name, lanes) for name in names], dtype=np.int64)

    def _check_reach(self, times: np.ndarray, inputs: np.ndarray, sample: int) -> None:
        """Raise `UnreachableError` if the height of a sample is out of reach."""
        (height, rack), heights = inputs[sample], inputs[:, 0]
        low, high = self.reach(rack)
        if not low <= height <= high:
            raise UnreachableError(
                f"{self.name}: height {height:.5g} m at t = {times[sample]:.6g} s is out of reach "
                f"(from {heights.min():.4g} to {heights.max():.4g} m are asked for); the reachable "
                f"range is {low:.4f} to {high:.4f} m (rack at {rack:g} m)"
            )


def kinematic_loop(name: str, *further: str) -> Loop:
    """A loop of the full-order solution, or of the last of further modules, which call it."""
    return loops((*KINEMATIC_LOOPS, *further), (name,))[name]


@lru_cache(maxsize=64)
def _iteration(tolerance: float, shortest: float) -> Ready:
    limits = ITERATION_LIMIT, LARGEST_INCREMENT, shortest
    return ready(newton_loops.Iteration(tolerance, *limits))


@cached
def _sampled(maneuver: Excitation) -> Sampled:
    times, inputs = maneuver.recorded_inputs
    checked_inputs(inputs, times, maneuver.inputs)
    return times, inputs, ready(newton_loops.Samples(inputs))


def new_counts() -> np.ndarray:
    """Counts of a loop, and behind them the sample at which it stops."""
    return np.zeros(newton_loops.SAMPLE + 1, dtype=np.int64)
