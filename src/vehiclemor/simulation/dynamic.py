"""Dynamic models (kinds `ode` and `dae`) ready to run: compiled kernels with one parameter set."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from vehiclemor.codegen.derivation import Derivation
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.errors import ConvergenceError, InputError
from vehiclemor.maneuvers import Maneuver
from vehiclemor.parameters import ParameterSet
from vehiclemor.simulation.checks import (
    check_inputs,
    checked_array,
    cut_short,
    left_validity,
    lifted_wheels,
)
from vehiclemor.simulation.projection_windows import ProjectionWindows, whole_space
from vehiclemor.simulation.system import Run, Solver, System
from vehiclemor.simulation.trajectory import DYNAMIC_COUNTS, Start, Trajectory

# Tolerance of the full-order runs that others are measured against.
REFERENCE_TOLERANCE = 1e-9
NEEDED_FOR = {
    "second_order": "equations of motion can't be projected in the coordinates, nor weighed by "
    "energy",
    "speeds": "rates of the coordinates can't be turned into speeds",
    "descriptor": "there are no equations before elimination",
    "violations": "there are no constraints",
}


@dataclass(frozen=True, eq=False)
class DynamicModel:
    """Compiled first-order equations dx/dt = f(x, u), x = (coordinates, speeds).

    Attributes
    ----------
    name, summary, kind
        Registered name, one line, and `ode` or `dae`.
    equations
        Named quantities and what was derived.
    parameters
        Validated parameter set.
    kernels
        The model's kernels, compiled when they are first used.
    kernel_hash
        Hash of the source of kernels and loops, and of the compiler's versions.
    constants
        Hoisted constants of the parameter set.
    initial
        Start -> state (2 n,).
    active
        Numbers of the states that the right-hand side depends on, cyclic ones left out.
    error_scale
        Magnitude of each state (2 n,) below which errors are measured absolutely.
    validity
        Output -> (smallest, largest) value at which the model means anything.
    loads
        Outputs that are zero where a wheel has left the road.
    rotating
        Numbers of the heading angle and of the pairs of states that turn with it; empty where the
        states are components in the vehicle.
    planar
        Numbers of the two positions on the road and of the heading; empty for other systems.
    """

    name: str
    summary: str
    kind: str
    equations: Derivation
    parameters: ParameterSet
    kernels: Kernels
    kernel_hash: str
    constants: np.ndarray
    initial: Mapping[str, np.ndarray]
    active: np.ndarray
    error_scale: np.ndarray
    validity: Mapping[str, tuple[float, float]]
    loads: tuple[str, ...]
    rotating: np.ndarray
    planar: np.ndarray

    counts = DYNAMIC_COUNTS
    evaluations = "rhs_calls"

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return self._names["coordinates"]

    @property
    def speeds(self) -> tuple[str, ...]:
        """Names of the speeds."""
        return self._names["speeds"]

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self._names["inputs"]

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self._names["outputs"]

    @cached_property
    def _names(self) -> dict[str, tuple[str, ...]]:
        kinds = ("coordinates", "speeds", "inputs", "outputs")
        return {kind: tuple(q.name for q in getattr(self.equations, kind)) for kind in kinds}

    @property
    def starts(self) -> tuple[str, ...]:
        """Names of the initial conditions."""
        return tuple(self.initial)

    @cached_property
    def system(self) -> System:
        """The model as the compiled loops take it; its Jacobian freezes at straight running."""
        return System(
            self.kernels,
            self.constants,
            len(self.inputs),
            self.start(),
            self.error_scale,
            self.active,
            self.rotating,
        )

    def require(self, *functions: str) -> None:
        """Raise `InputError` if the model's equations lack one of these functions."""
        for name in functions:
            if name not in self.equations.shapes:
                raise InputError(f"{self.name} has no {name}: {NEEDED_FOR[name]}")

    @cached_property
    def operation_counts(self) -> dict[str, dict[str, int]]:
        """Operations of each generated function, by kind and in total."""
        return self.equations.operations

    def start(self, name: Start | None = None) -> np.ndarray:
        """First-order state (2 n,) of a named initial condition, or a copy of the state given.

        The first of `starts` by default.
        """
        if isinstance(name, np.ndarray):
            return checked_array(name, 2 * len(self.coordinates), "start", self.name).copy()
        name = name or self.starts[0]
        if name not in self.initial:
            raise InputError(f"unknown start {name!r}; {self.name} has {', '.join(self.starts)}")
        return self.initial[name].copy()

    def derivative(self, x: Any, u: Any) -> np.ndarray:
        """Time derivative (2 n,) of the state x at inputs u.

        Raises
        ------
        InputError
            If a value isn't finite, or if the derivative isn't.
        """
        result = self._call("derivative", x, u)
        if not np.isfinite(result).all():
            raise InputError(f"the derivative of {self.name} is not finite at this state")
        return result

    def outputs_at(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Outputs (samples, number of outputs) along a path of states and inputs."""
        return self.system.along("outputs", states, inputs, len(self.outputs))

    def derivatives_at(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """State derivatives (samples, 2 n) along a path of states and inputs."""
        return self.system.along("derivative", states, inputs, 2 * len(self.coordinates))

    def mass_matrix(self, x: Any, u: Any = None) -> np.ndarray:
        """Mass matrix (n, n) of the second derivatives of the coordinates; inputs 0 by default."""
        inputs = np.zeros(len(self.inputs)) if u is None else u
        return self._call("second_order", x, inputs)[:, :-1]

    def descriptor(self, x: Any, u: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """M (n, n), F (n,), C (c, n), gamma (c,) of the equations before they are solved.

        M q'' - C^T lambda = F and C q'' = gamma; F are applied less inertial forces, C q'' = gamma
        the stabilised constraints.
        """
        n = len(self.coordinates)
        rows = self._call("descriptor", x, u)
        return rows[:n, :n], rows[:n, n], rows[n:, :n], rows[n:, n]

    def violations(self, x: Any, u: Any) -> tuple[np.ndarray, np.ndarray]:
        """Constraints (c,) and their rates (c,) at the state x and inputs u; zero if they hold."""
        pairs = self._call("violations", x, u)
        return pairs[:, 0], pairs[:, 1]

    def speeds_of_rates(self, x: Any) -> np.ndarray:
        """Speeds (n,) where x (2 n,) holds the rates of the coordinates in their place."""
        return self._call("speeds", x, np.zeros(len(self.inputs)))

    def simulate(
        self,
        maneuver: Maneuver,
        start: Start | None = None,
        times: np.ndarray | None = None,
        solver: str | None = None,
        tolerance: float | None = None,
        longest_step: float | None = None,
    ) -> Trajectory:
        """Full-order trajectory at the given times (the maneuver's output times by default).

        Parameters
        ----------
        maneuver
            Its inputs are the model's.
        start
            Named initial condition, or a state (2 n,).
        times
            Increasing times (samples,) in s.
        solver
            `dopri5`: Dormand-Prince 5(4).  `rodas4`: Rosenbrock method of order 4, a fresh
            Jacobian in every step.  `ros34pw2`: W-method of order 3 with one Jacobian, that of
            straight running, for all steps and runs.  With the same `etdrk4`: exponential
            Runge-Kutta method of order 4, and `exponential_adams`: exponential Adams method of
            order up to 6.
        tolerance
            Largest local error of a state relative to its typical size plus its own.
        longest_step
            In s; unlimited by default.

        Raises
        ------
        InputError
            If an input isn't finite or a name is unknown.
        ConvergenceError
            If the integration fails or leaves the model's range of validity.
        """
        trajectory = self.integrate(
            maneuver,
            self.start(start),
            whole_space(2 * len(self.coordinates)),
            solver or "dopri5",
            REFERENCE_TOLERANCE if tolerance is None else tolerance,
            times,
            longest_step,
        )
        if trajectory.status != "ok":
            raise ConvergenceError(f"{self.name}: {trajectory.message}")
        return trajectory

    def integrate(
        self,
        maneuver: Maneuver,
        state: np.ndarray,
        windows: ProjectionWindows,
        solver: str,
        tolerance: float,
        times: np.ndarray | None = None,
        longest_step: float | None = None,
    ) -> Trajectory:
        """Trajectory of the full or a projected system; a divergence is recorded in it.

        Parameters
        ----------
        state
            Initial state (2 n,).
        windows
            Formulation of the system and its subspaces by window.
        """
        check_inputs(maneuver, self.name, self.inputs)
        if windows.formulation == "coordinates":
            self.require("second_order", "speeds")
        how = Solver(solver, tolerance, times, longest_step)
        run = self.system.run(maneuver, state, windows, how)
        return self.recorded(maneuver, run, maneuver.at(run.times), run.path)

    def recorded(
        self, maneuver: Maneuver, run: Run, inputs: np.ndarray, states: np.ndarray
    ) -> Trajectory:
        """Trajectory of a run whose path has been brought to states (samples, 2 n) of the model."""
        trajectory = self.trajectory(
            run.times, inputs, states, run.counts, run.seconds, run.failure
        )
        remarks = (trajectory.remark, cut_short(maneuver))
        return replace(trajectory, remark="; ".join(remark for remark in remarks if remark))

    def trajectory(
        self,
        times: np.ndarray,
        inputs: np.ndarray,
        states: np.ndarray,
        counts: np.ndarray,
        seconds: float,
        failure: str = "",
    ) -> Trajectory:
        """Trajectory of a path of states; it has diverged where the model means nothing."""
        outputs = self.outputs_at(states, inputs)
        message, sample = failure, len(times)
        if not failure:
            message, sample = left_validity(self.validity, self.outputs, times, outputs)
            # What follows means nothing.
            states[sample:], outputs[sample:] = np.nan, np.nan
        status = "diverged" if message else "ok"
        n = len(self.coordinates)
        return Trajectory(
            times,
            inputs,
            states[:, :n],
            states[:, n:],
            outputs,
            {name: int(count) for name, count in zip(DYNAMIC_COUNTS, counts, strict=True)},
            seconds,
            status,
            message,
            lifted_wheels(self.loads, self.outputs, times, outputs),
        )

    def _call(self, function: str, x: Any, u: Any) -> np.ndarray:
        self.require(function)
        x, u = checked_array(x, 2 * len(self.coordinates), "x", self.name), self._inputs(u)
        result = np.empty(self.equations.shapes[function])
        self.kernels.call(function, x, u, self.constants, result)
        return result

    def _inputs(self, u: Any) -> np.ndarray:
        return checked_array(np.atleast_1d(u), len(self.inputs), "u", self.name)
