"""Kinematic models (kind `ae`) ready to run: compiled kernels with one parameter set."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import Any

import numpy as np

from vehiclemor.codegen.emit import operation_counts, reference_source
from vehiclemor.errors import ConvergenceError, InputError, UnreachableError
from vehiclemor.maneuvers import Maneuver
from vehiclemor.models.equations import AlgebraicEquations
from vehiclemor.parameters import ParameterSet
from vehiclemor.registry import unknown
from vehiclemor.simulation import newton_loops
from vehiclemor.simulation.checks import check_inputs, checked_array
from vehiclemor.simulation.clock import timed
from vehiclemor.simulation.reach import reachable_range
from vehiclemor.simulation.trajectory import ALGEBRAIC_COUNTS, Start, Trajectory

# Input increment (m) above which a step of the input is cut into substeps.  Beside a fold, Newton's
# method jumps to the other branch from farther away than this.
LARGEST_INCREMENT = 5e-3
NEWTON_TOLERANCE = 1e-12
ITERATION_LIMIT = 50
SOLVERS = ("newton", "newton_dense", "chord")
# A mechanism without forces has no equilibrium to find: the name stands for its design position,
# so that studies can name the same start for every kind of model.
STARTS = ("equilibrium",)
# Rack displacements at which the limits of travel are found; between them the tighter ones count.
RACKS_OF_REACH = 9
REASONS = {
    newton_loops.TOO_MANY_ITERATIONS: f"no convergence in {ITERATION_LIMIT} iterations",
    newton_loops.NOT_FINITE: "a coordinate is not finite",
    newton_loops.SINGULAR: "the matrix of a linear system is singular",
}


@dataclass(frozen=True, eq=False)
class AlgebraicModel:
    """Compiled residual equations Phi(q; u) = 0 of one mechanism.

    Attributes
    ----------
    name, summary, kind
        Registered name, one line, and `ae`.
    equations
        Named quantities and symbolic program.
    parameters
        Validated parameter set.
    kernels
        Linked module of compiled kernels and loops.
    kernel_hash
        Hash of the kernels' source and of the compiler's versions.
    constants
        Hoisted constants of the parameter set.
    design
        Coordinates (n,) at the design position, where all inputs are zero.
    travel_limit
        Travel in m up to which the limits of reach are looked for.
    """

    name: str
    summary: str
    kind: str
    equations: AlgebraicEquations
    parameters: ParameterSet
    kernels: ModuleType
    kernel_hash: str
    constants: np.ndarray
    design: np.ndarray
    travel_limit: float

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return tuple(quantity.name for quantity in self.equations.coordinates)

    @property
    def speeds(self) -> tuple[str, ...]:
        """Names of the speeds: none, the equations are algebraic."""
        return ()

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return tuple(quantity.name for quantity in self.equations.inputs)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(quantity.name for quantity in self.equations.outputs)

    @property
    def starts(self) -> tuple[str, ...]:
        """Names of the initial conditions: where the iteration starts."""
        return STARTS

    @property
    def counts(self) -> Mapping[str, str]:
        """What the solvers count: name -> meaning."""
        return ALGEBRAIC_COUNTS

    @property
    def evaluations(self) -> str:
        """Name of the count of evaluations of the equations."""
        return "residual_evaluations"

    @cached_property
    def operation_counts(self) -> dict[str, dict[str, int]]:
        """Operations of each generated function, by kind and in total."""
        return operation_counts(reference_source(self.equations.program))

    def start(self, name: Start = STARTS[0]) -> np.ndarray:
        """Coordinates (n,) from which a simulation starts its first iteration."""
        if isinstance(name, np.ndarray):
            return self._coordinates(name).copy()
        if name not in STARTS:
            raise InputError(f"unknown start {name!r}; {self.name} has {', '.join(STARTS)}")
        return self.design.copy()

    def residual(self, q: Any, u: Any) -> np.ndarray:
        """Residual Phi(q; u), shape (n,)."""
        q, u = self._coordinates(q), self._inputs(u)
        result = np.empty(len(q))
        self.kernels.residual(q, u, self.constants, self._work(), result)
        return result

    def jacobian(self, q: Any, u: Any) -> np.ndarray:
        """Analytic Jacobian of the residual with respect to q, shape (n, n)."""
        q, u = self._coordinates(q), self._inputs(u)
        result = np.empty((len(q), len(q) + 1))
        self.kernels.residual_jacobian(q, u, self.constants, self._work(), result)
        return result[:, :-1].copy()

    def newton_step(self, q: Any, u: Any) -> np.ndarray:
        """Newton step Phi_q^-1 Phi by straight-line elimination, shape (n,)."""
        q, u = self._coordinates(q), self._inputs(u)
        result = np.empty(len(q))
        self.kernels.newton_step(q, u, self.constants, self._work(), result)
        return result

    def outputs_at(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Outputs (samples, number of outputs) along a path of coordinates and inputs."""
        result = np.empty((len(states), len(self.outputs)))
        self.kernels.output_path(
            np.ascontiguousarray(states), np.ascontiguousarray(inputs), self.constants, result
        )
        return result

    def joints_at(self, q: Any) -> dict[str, np.ndarray]:
        """Positions (3,) in m of the moving joints, for drawing."""
        result = np.empty(self.equations.program.functions["joints"].shape)
        q, u = self._coordinates(q), np.zeros(len(self.inputs))
        self.kernels.joints(q, u, self.constants, self._work(), result)
        return dict(zip(self.equations.joints, result, strict=True))

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
            known[rack] = reachable_range(self, rack, self.travel_limit)
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
        check_inputs(maneuver, self.name, self.inputs)
        self.start(STARTS[0] if start is None else start)
        times = maneuver.times if times is None else np.asarray(times, dtype=float)
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
        inputs = np.ascontiguousarray(inputs, dtype=float)
        self.check_reach(times, inputs)
        path = np.full((len(inputs), len(self.coordinates)), np.nan)
        counts = np.zeros(len(ALGEBRAIC_COUNTS), dtype=np.int64)
        u_start = np.zeros(len(self.inputs))
        settings = (tolerance, ITERATION_LIMIT, LARGEST_INCREMENT, path, counts)
        if solver in ("newton", "newton_dense"):
            dense = solver == "newton_dense"
            arguments = (self.design, u_start, inputs, self.constants, dense, *settings)
            loop = self.kernels.newton_path
        elif solver != "chord":
            raise unknown("solver", solver, SOLVERS)
        else:
            inverse_t = np.linalg.inv(self.jacobian(self.design, u_start)).T.copy()
            counts[2] = 1
            arguments = (self.design, u_start, inputs, self.constants, inverse_t, *settings)
            loop = self.kernels.chord_path
        (status, sample), seconds = timed(lambda: loop(*arguments), counts)
        if status != newton_loops.CONVERGED:
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
            {name: int(count) for name, count in zip(ALGEBRAIC_COUNTS, counts, strict=True)},
            seconds,
            status,
            message,
        )

    def residual_at(self, coordinates: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Residuals (samples, n) along a path of coordinates and inputs."""
        result = np.empty_like(coordinates)
        self.kernels.residual_path(
            np.ascontiguousarray(coordinates), np.ascontiguousarray(inputs), self.constants, result
        )
        return result

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

    def _work(self) -> np.ndarray:
        return np.empty(self.kernels.WORK)

    def _coordinates(self, q: Any) -> np.ndarray:
        return checked_array(q, len(self.coordinates), "q", self.name)

    def _inputs(self, u: Any) -> np.ndarray:
        return checked_array(u, len(self.inputs), "u", self.name)
