"""Dynamic models (kinds `ode` and `dae`) ready to run: compiled kernels with one parameter set."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vehiclemor.arguments import loop_array, number
from vehiclemor.exceptions import ConvergenceError, InputError
from vehiclemor.inputs.checks import checked_maneuver, cut_short
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.multibody.definition import STATE_KINDS
from vehiclemor.registry import choice
from vehiclemor.simulation.checks import LOCKED, left_validity, stopped, wheel_remarks
from vehiclemor.simulation.control_periods import ControlPeriods, whole_space
from vehiclemor.simulation.evaluation import By
from vehiclemor.simulation.integrators.catalogue import LOOP_SOURCES, frozen, integrator
from vehiclemor.simulation.integrators.step_kernels import partners
from vehiclemor.simulation.linear_model import LinearModel
from vehiclemor.simulation.loop_arguments import Output
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.recording import Recorder, Recording
from vehiclemor.simulation.system import System
from vehiclemor.simulation.trajectory import (
    DYNAMIC_COUNTS,
    WITHOUT_COMPLAINT,
    Names,
    Start,
    Trajectory,
    output_names,
)
from vehiclemor.simulation.workspaces import Run, Solver

# What derivatives are of -> function of the equations.
RESULTS = {"rhs": "derivative", "outputs": "outputs"}


@dataclass(frozen=True, eq=False)
class DynamicModel(Model):
    """Compiled first-order equations dx/dt = f(x, u), x = (coordinates, speeds, further states).

    Near is a model of similar parameters, whose operators and workspaces serve this one too.
    """

    # Full-order runs are solved like this that others are measured against.
    loops, reference = LOOP_SOURCES, ("dopri5", 1e-8)
    near: DynamicModel | None = None

    def _numbers(self, states: Iterable[str]) -> np.ndarray:
        """Places of some states among all."""
        all_states = self.definition.states
        return np.array([all_states.index(state) for state in states], dtype=np.int64)

    @cached_property
    def active(self) -> np.ndarray:
        """Numbers of the states that the right-hand side depends on: all but cyclic ones."""
        cyclic = self.definition.cyclic
        return self._numbers(state for state in self.definition.states if state not in cyclic)

    @cached_property
    def error_scale(self) -> np.ndarray:
        """Magnitude of each state (2 n,) below which errors are measured absolutely."""
        scale = self.definition.error_scale
        return np.array([scale.get(state, 1.0) for state in self.definition.states])

    @cached_property
    def planar(self) -> np.ndarray:
        """Numbers of the two positions on the road and the heading; empty for other systems."""
        return self._numbers(self.definition.planar)

    @cached_property
    def rotating(self) -> np.ndarray:
        """Numbers of the heading angle and of the pairs of states that turn with it.

        Empty where the states are components in the vehicle.
        """
        pairs = self.definition.heading_pairs
        # The heading comes after the two positions; it matters where states turn with it.
        heading = self.definition.planar[2:] if pairs else ()
        return self._numbers([*heading, *(state for pair in pairs for state in pair)])

    @cached_property
    def system(self) -> System:
        """The model as the compiled loops take it; its Jacobian freezes at straight running."""
        if self.near is not None:
            return self.near.system.with_constants(self.constants)
        return System(
            self.kernels,
            self.constants,
            len(self.inputs),
            self.start(),
            self.error_scale,
            self.active,
            self.rotating,
            partners=partners(self.definition.states),
            reference_inputs=self.inputs_at_rest,
        )

    def rhs(self, x: Any, u: Any) -> np.ndarray:
        """Right-hand side f(x, u) (2 n,); `InputError` if a value or the result isn't finite."""
        result = self.evaluated("derivative", x, u)
        if not np.isfinite(result).all():
            raise InputError(f"the derivative of {self.name} is not finite at this state")
        return result

    def rhs_at(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """State derivatives (samples, 2 n) along a path of states and inputs."""
        return self.values_at("derivative", states, inputs, finite=True)

    def jacobian(
        self, state: Any, u: Any, with_respect_to: By = "state", of: str = "rhs"
    ) -> np.ndarray:
        """Analytic derivatives of `rhs` or `outputs`, see `Model.jacobian`."""
        return self.jacobian_of(RESULTS[choice("of", of, RESULTS)], state, u, with_respect_to)

    def linearise(self, state: Start | None = None, inputs: Any = None) -> LinearModel:
        """Linear model at a state or start, the first by default, and inputs, 0 by default."""
        x = self.start(state)
        u = self._inputs(self.inputs_at_rest if inputs is None else inputs)
        point = x, u, self.rhs(x, u), self.outputs_at(x[None], u[None])[0]
        return LinearModel.of(self, self.definition.states, point)

    def mass_matrix(self, x: Any) -> np.ndarray:
        """Mass matrix (n, n) of the second derivatives of the coordinates, without inputs."""
        return self.evaluated("second_order", x, self.inputs_at_rest)[:, :-1]

    def descriptor(self, x: Any, u: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """M (n, n), F (n,), C (c, n), gamma (c,) of the equations before they are solved.

        M q'' - C^T lambda = F and C q'' = gamma; F are applied less inertial forces, C q'' = gamma
        the stabilised constraints.
        """
        n = len(self.coordinates)
        rows = self.evaluated("descriptor", x, u)
        return rows[:n, :n], rows[:n, n], rows[n:, :n], rows[n:, n]

    def violations(self, x: Any, u: Any) -> tuple[np.ndarray, np.ndarray]:
        """Constraints (c,) and their rates (c,) at the state x and inputs u; zero if they hold."""
        pairs = self.evaluated("violations", x, u)
        return pairs[:, 0], pairs[:, 1]

    def speeds_of_rates(self, x: Any) -> np.ndarray:
        """Speeds (n,) where x (2 n,) holds the rates of the coordinates instead."""
        return self.evaluated("speeds", x, self.inputs_at_rest)

    def simulate(
        self,
        maneuver: Excitation,
        start: Start | None = None,
        times: np.ndarray | None = None,
        solver: str | None = None,
        tolerance: float | None = None,
        outputs: Names = None,
        longest_step: float | None = None,
        begin: float = 0.0,
    ) -> Trajectory:
        """Full-order trajectory, see `Model.simulate`."""
        solver = self.reference[0] if solver is None else solver
        tolerance = self.reference[1] if tolerance is None else tolerance
        integrator(solver)
        begin = begin if type(begin) is float else number("begin", begin)
        how = Solver(solver, tolerance, times, longest_step, begin)
        names = None if outputs is None else output_names(outputs)
        model, space = self.driven_by(maneuver), whole_space(len(self.definition.states))
        # Its equilibrium is solved with its own equations.
        trajectory = model.integrate(maneuver, model.start(start), space, how, names)
        if trajectory.status not in WITHOUT_COMPLAINT:
            raise ConvergenceError(f"{self.name}: {trajectory.message}", trajectory)
        return trajectory

    def integrate(
        self,
        maneuver: Excitation,
        state: np.ndarray,
        windows: ControlPeriods,
        how: Solver,
        outputs: tuple[str, ...] | None = None,
    ) -> Trajectory:
        """Trajectory of the full or a projected system from a state; it records a divergence.

        The windows tell the formulation and its subspaces; outputs are computed as they are named.
        """
        maneuver = checked_maneuver(maneuver, self.definition)
        if windows.formulation == "coordinates":
            self.require("second_order", "speeds")
        run = self.system.run(maneuver, state, windows, how, 0.0)
        inputs = maneuver.recorded_inputs[1] if how.complete else run.output.sample_inputs
        trajectory = self.recorded(maneuver, run, inputs, run.output.states, outputs=outputs)
        run.give_back()
        if LOCKED in trajectory.remark and frozen(how.name):
            remark = f"{trajectory.remark}; {how.name} errs there, its Jacobian is frozen"
            return Trajectory.of(**trajectory.__dict__ | {"remark": remark})
        return trajectory

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
        states, inputs = loop_array(states), loop_array(inputs)
        run = Run(Output.of(times, states, np.asarray(counts), inputs), seconds, failure)
        return self.recorded(None, run, inputs, states)

    def recorded(
        self,
        maneuver: Excitation | None,
        run: Run,
        inputs: np.ndarray,
        states: np.ndarray,
        outputs: tuple[str, ...] | None = None,
    ) -> Trajectory:
        """Trajectory of a run whose path has been brought to the model's states.

        Inputs are those at the output times (samples, inputs); states stand where the run is
        recorded, those of the model and what may follow them.  Where outputs are named, these alone
        are computed; else all can be read.
        """
        recorder, times, n = self.recorder, run.output.samples, len(self.definition.states)
        rows, samples = run.rows, run.output.point_of_sample
        whole = states, run.inputs, samples
        points = whole[0][:rows], whole[1][:rows], samples
        first = recorder.first_outside(whole, rows, run.cached_loops)
        limited, message, end = len(recorder.limited), run.failure, len(times)
        left = min(first[:limited], default=end)
        status, reached = "diverged" if message else "ok", end
        if message:
            # From the failure on there are no numbers, which says nothing of limits.
            reached = int(np.isfinite(Recording(recorder, points).state_history[:, 0]).sum())
            first = [end if sample == reached else sample for sample in first]
        if left < reached:
            name = recorder.limited[first.index(left)]
            ended = Recording(recorder, points).columns((name, *self.definition.standstill))[left]
            if stopped(self.definition, name, ended[1:]):
                # At rest the slip is so stiff that a solver may fail there.
                status, message = "stopped", f"the vehicle stops at t = {times[left]:.4g} s"
            elif not message:
                message = left_validity(self.definition, name, ended[0], times[left])
                status = "diverged"
        remarks = wheel_remarks(self.definition, first[limited:], times)
        if maneuver is not None:
            remarks.append(cut_short(maneuver))
        fields = {
            "times": times,
            "inputs": inputs,
            "counts": dict(zip(DYNAMIC_COUNTS, run.output.counts.tolist(), strict=True)),
            "seconds": run.seconds,
            "status": status,
            "message": message,
            "remark": "; ".join(filter(None, remarks)),
            "names": self.outputs,
            "model": self,
            "maneuver": "" if maneuver is None else maneuver.name,
        }
        if outputs not in (None, self.outputs) and not message:
            histories = recorder.histories(outputs, whole, rows, run.cached_loops)
            fields |= {"names": outputs, **dict.fromkeys(STATE_KINDS, inputs[:, :0])}
            return Trajectory.of(**fields, outputs=histories)
        copies = points[0][:, :n].copy(), points[1].copy(), samples.copy()
        recording = Recording(recorder, copies)
        if left < end and (status == "stopped" or not run.failure):
            # What follows means nothing.
            recording.end = left
        trajectory = Trajectory.of(**fields, recording=recording)
        return trajectory if outputs is None else trajectory.chosen(outputs)

    def histories_at(
        self, names: tuple[str, ...], states: np.ndarray, inputs: np.ndarray
    ) -> np.ndarray:
        """Outputs, coordinates or speeds (samples, names) along a path of states and inputs."""
        return Recording(self.recorder, (states, inputs, np.empty((0, 2)))).columns(names)

    @cached_property
    def recorder(self) -> Recorder:
        """Makes outputs of its runs; loops over them may serve models with the same equations."""
        return Recorder(self) if self.near is None else self.near.recorder.of(self)
