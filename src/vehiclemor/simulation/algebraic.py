"""Kinematic models (kind `ae`) ready to run: compiled kernels with one parameter set."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from vehiclemor.codegen.loops import Loop, loops
from vehiclemor.errors import ConvergenceError, InputError, UnreachableError
from vehiclemor.maneuvers import Maneuver
from vehiclemor.models.definition import DESIGN_START
from vehiclemor.registry import unknown
from vehiclemor.simulation import newton_loops
from vehiclemor.simulation.checks import check_inputs, check_positive, output_times
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.run_timer import timed
from vehiclemor.simulation.trajectory import ALGEBRAIC_COUNTS, Start, Trajectory
from vehiclemor.simulation.travel_limits import reachable_range

# Input increment (m) above which a step of the input is cut into substeps.  Beside a fold, Newton's
# method jumps to the other branch from farther away than this.
LARGEST_INCREMENT = 5e-3
NEWTON_TOLERANCE = 1e-12
ITERATION_LIMIT = 50
SOLVERS = ("newton", "newton_dense", "chord")
# Rack displacements at which the limits of travel are found; between them the tighter ones count.
RACKS_OF_REACH = 9
# Loops of the full-order solution, and the kernels that stand in loops.
KINEMATIC_LOOPS = ("simulation.newton_loops",)
INLINED_KERNELS = ("residual", "residual_jacobian", "newton_step", "tangent_parts", "tangent")
REASONS = {
    newton_loops.TOO_MANY_ITERATIONS: f"no convergence in {ITERATION_LIMIT} iterations",
    newton_loops.NOT_FINITE: "a coordinate is not finite",
    newton_loops.SINGULAR: "the matrix of a linear system is singular",
}


@dataclass(frozen=True, eq=False)
class AlgebraicModel(Model):
    """Compiled residual equations Phi(q; u) = 0 of one mechanism."""

    @property
    def design(self) -> np.ndarray:
        """Coordinates (n,) at the design position, where all inputs are zero."""
        return self.initial[DESIGN_START]

    def residual(self, q: Any, u: Any) -> np.ndarray:
        """Residual Phi(q; u), shape (n,)."""
        return self.evaluated("residual", q, u)

    def jacobian(self, q: Any, u: Any) -> np.ndarray:
        """Analytic Jacobian of the residual with respect to q, shape (n, n)."""
        return self.evaluated("residual_jacobian", q, u)[:, :-1].copy()

    def newton_step(self, q: Any, u: Any) -> np.ndarray:
        """Newton step Phi_q^-1 Phi by straight-line elimination, shape (n,)."""
        return self.evaluated("newton_step", q, u)

    def residual_at(self, coordinates: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Residuals (samples, n) along a path of coordinates and inputs."""
        return self.along("residual", coordinates, inputs)

    def joints_at(self, q: Any) -> dict[str, np.ndarray]:
        """Positions (3,) in m of the moving joints, for drawing."""
        places = self.evaluated("joints", q, np.zeros(len(self.inputs)))
        return dict(zip(self.definition.joints, places, strict=True))

    def solve(self, u: Any) -> np.ndarray:
        """Coordinates (n,) at inputs u, on the branch of the design position.

        Raises
        ------
        UnreachableError
            If the mechanism can't reach the height; the reachable range is named.
        """
        inputs = self._inputs(u)[None, :]
        return self.solve_path(np.zeros(1), inputs).coordinates[0]

    def reach(self, rack: float = 0.0) -> tuple[float, float]:
        """Lowest and highest reachable wheel travel (m) at a rack displacement (m)."""
        known: dict[float, tuple[float, float]] = self.__dict__.setdefault("_reach", {})
        if rack not in known:
            known[rack] = reachable_range(self, rack, self.definition.travel_limit)
        return known[rack]

    def simulate(
        self,
        maneuver: Maneuver,
        start: Start | None = None,
        times: np.ndarray | None = None,
        solver: str | None = None,
        tolerance: float | None = None,
    ) -> Trajectory:
        """Full-order solution at the given times (the maneuver's output times by default).

        Parameters
        ----------
        maneuver
            Its inputs are the model's.
        start
            One of `starts`.
        times
            Increasing times (samples,) in s.
        solver
            `newton`, the default: fresh Jacobians, generated elimination, started at the previous
            sample.  `newton_dense`: the same with dense elimination and partial pivoting.
            `chord`: constant inverse of the design position, started at a quadratic extrapolation.
        tolerance
            Largest component of the last step of an iteration (rad or m), 1e-12 by default.

        Raises
        ------
        UnreachableError
            If a height can't be reached.
        ConvergenceError
            If an iteration fails; time and reachable range are named.
        """
        check_inputs(maneuver, self.definition)
        self.start(start)
        times = output_times(times, maneuver, repeats=True)
        return self.solve_path(
            times,
            maneuver.at(times),
            "newton" if solver is None else solver,
            NEWTON_TOLERANCE if tolerance is None else tolerance,
        )

    def solve_path(
        self,
        times: np.ndarray,
        inputs: np.ndarray,
        solver: str = "newton",
        tolerance: float = NEWTON_TOLERANCE,
    ) -> Trajectory:
        """Full-order solution for inputs (samples, number of inputs); see `simulate`."""
        check_positive("tolerance", tolerance)
        inputs = np.ascontiguousarray(inputs, dtype=float)
        if inputs.shape != (len(times), len(self.inputs)) or not len(inputs):
            raise InputError(
                f"inputs have shape {inputs.shape}, not ({len(times)}, {len(self.inputs)}) with "
                f"at least one sample"
            )
        self.check_reach(times, inputs)
        n = len(self.coordinates)
        solution = newton_loops.Solution(np.full((len(inputs), n), np.nan), new_counts())
        iteration = newton_loops.Iteration(tolerance, ITERATION_LIMIT, LARGEST_INCREMENT)
        how: Any
        if solver in ("newton", "newton_dense"):
            loop, how = self.loop("newton_path"), int(solver == "newton_dense")
        elif solver != "chord":
            raise unknown("solver", solver, SOLVERS)
        else:
            inverse = np.linalg.inv(self.jacobian(self.design, np.zeros(len(self.inputs))))
            loop, how = self.loop("chord_path"), inverse.T.copy()
            solution.counts[newton_loops.JACOBIANS] = 1
        buffer = np.empty(2 * n + 3 * len(self.inputs) + n * (n + 1))
        arguments = (self.design, inputs, self.constants, how, iteration, solution, buffer)
        status, seconds = timed(loop.prepared(*arguments), solution.counts)
        path, counts = solution
        if status != newton_loops.CONVERGED:
            sample = int(counts[newton_loops.SAMPLE])
            low, high = self.reach(float(inputs[sample, 1]))
            raise ConvergenceError(
                f"{self.name}: {REASONS[status]} at t = {times[sample]:.6g} s, height "
                f"{inputs[sample, 0]:.4f} m ({solver}); the reachable range is "
                f"{low:.4f} to {high:.4f} m"
            )
        return self.trajectory(times, inputs, path, counts, seconds)

    def trajectory(
        self,
        times: np.ndarray,
        inputs: np.ndarray,
        path: np.ndarray,
        counts: np.ndarray,
        seconds: float,
        failure: tuple[int, int] | None = None,
    ) -> Trajectory:
        """Trajectory of a path of coordinates; `failure` is (status, sample) of a stopped loop."""
        status, message = "ok", ""
        if failure is not None:
            status = "diverged"
            message = f"{REASONS[failure[0]]} at t = {times[failure[1]]:.6g} s"
        return Trajectory(
            times,
            inputs,
            path,
            np.empty((len(path), 0)),
            self.outputs_at(path, inputs),
            {name: int(count) for name, count in zip(ALGEBRAIC_COUNTS, counts, strict=False)},
            seconds,
            status,
            message,
        )

    def loop(self, name: str, *further: str) -> Loop:
        """A compiled loop with the model's kernels inlined.

        Parameters
        ----------
        name
            Of the entry, in the last of the modules.
        further
            Modules behind those of the full-order loops.
        """
        n, parts = len(self.coordinates), self.equations.sources["tangent_parts"].sizes[-1]
        sizes = {"N": n, "INPUTS": len(self.inputs), "ENTRIES": parts - n}
        texts = {key: kernel.text for key, kernel in self.equations.sources.items()}
        inlined = {key: texts[key] for key in INLINED_KERNELS}
        modules = (*KINEMATIC_LOOPS, *further)
        return loops(modules, (name,), inlined, sizes)[name]

    def check_reach(self, times: np.ndarray, inputs: np.ndarray) -> None:
        """Raise if a height is out of reach or an input isn't finite.

        Raises
        ------
        InputError
            If an input isn't finite.
        UnreachableError
            If a height is out of reach.
        """
        bad = np.argwhere(~np.isfinite(inputs))
        if len(bad):
            sample, column = bad[0]
            raise InputError(
                f"input {self.inputs[column]} is not finite at t = {times[sample]:.6g} s"
            )
        heights, racks = inputs[:, 0], inputs[:, 1]
        known = np.unique(racks)
        if len(known) > RACKS_OF_REACH:
            known = np.linspace(known[0], known[-1], RACKS_OF_REACH)
        limits = np.array([self.reach(float(rack)) for rack in known])
        # Between two racks the tighter limits count: as functions of the rack they can jump.
        after = np.searchsorted(known, racks)
        before = np.where(known[after] == racks, after, after - 1)
        low = np.maximum(limits[after, 0], limits[before, 0])
        high = np.minimum(limits[after, 1], limits[before, 1])
        outside = np.flatnonzero((heights < low) | (heights > high))
        if len(outside):
            sample = outside[0]
            raise UnreachableError(
                f"{self.name}: height {heights[sample]:.5g} m at t = {times[sample]:.6g} s is out "
                f"of reach (from {heights.min():.4g} to {heights.max():.4g} m are asked for); the "
                f"reachable range is {low[sample]:.4f} to {high[sample]:.4f} m "
                f"(rack at {racks[sample]:g} m)"
            )


def new_counts() -> np.ndarray:
    """Counts of a loop, and behind them the sample at which it stops."""
    return np.zeros(newton_loops.SAMPLE + 1, dtype=np.int64)
