"""First-order systems dx/dt = f(x, u) as the compiled loop takes them, full and reduced alike."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np

from vehiclemor.arguments import loop_array
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.loops import Prepared, Ready, ready
from vehiclemor.codegen.operations import LANES, Kernel
from vehiclemor.exceptions import InputError
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.checks import check_positive, output_times
from vehiclemor.simulation.control_periods import ControlPeriods
from vehiclemor.simulation.evaluation import address_of, at_samples
from vehiclemor.simulation.integrators import catalogue
from vehiclemor.simulation.integrators.step_kernels import Frame, mirror_blocks, signs
from vehiclemor.simulation.loop_arguments import (
    NOT_FINITE,
    SINGULAR,
    STEP_TOO_SMALL,
    TOO_MANY_CALLS,
    Equations,
    Memory,
    Method,
    Output,
)
from vehiclemor.simulation.run_timer import timed
from vehiclemor.simulation.trajectory import DYNAMIC_COUNTS
from vehiclemor.simulation.workspaces import Pool, Run, Solver, Workspace

# Below it there is only rounding.
SMALLEST_TOLERANCE = 1e-13
REASONS = {
    TOO_MANY_CALLS: f"more than {catalogue.MOST_CALLS} evaluations of the right-hand side in 1 s",
    NOT_FINITE: "a state is not finite",
    SINGULAR: "the matrix of a linear system is singular",
    STEP_TOO_SMALL: "the step size has become too small",
}


@dataclass(frozen=True, eq=False)
class System(ShortRepr):
    """A first-order system whose right-hand side is machine code."""

    # `derivative` and, where the system has them, `outputs`, `second_order`, `speeds`; their
    # hoisted constants; number of inputs.
    kernels: Kernels
    constants: np.ndarray
    inputs: int
    reference: np.ndarray  # State (dim,) at which the Jacobian is frozen.
    # Magnitude of each state (dim,) below which errors are measured absolutely.
    error_scale: np.ndarray
    active: np.ndarray  # Numbers of the states that the right-hand side depends on.
    # Numbers of the heading and of the pairs of states that turn with it; may be empty.
    rotating: np.ndarray
    # Number of the state that each becomes in the mirror image; empty where there is none.
    partners: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    # Inputs at which the Jacobian is frozen; zeros where none are given.
    reference_inputs: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        """Refuse kernels that reach beyond what loops give them: they don't look."""
        dim, n, half = len(self.reference), len(self.constants), len(self.reference) // 2
        results = {"derivative": dim, "speeds": half, "second_order": half * (half + 1)}
        for name, source in self.kernels.sources.items():
            if source.arguments[0] == "_x":
                given = (dim, self.inputs, n)
                source.check(*given, *([results[name]] if name in results else ()))

    def with_constants(self, constants: np.ndarray) -> System:
        """The system of other constants; operators, packed arguments and workspaces serve both."""
        # All that follows from the Jacobian is computed by this one, before it is shared.
        _ = self.frame, self.frozen_jacobian, self._ready, self._pool
        other = object.__new__(System)
        vars(other).update(vars(self), constants=constants, _address=constants.ctypes.data)
        return other

    def jacobian(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """df/dx (dim, dim) by central differences; columns of inactive states are zero."""
        result, sides, u = np.zeros((len(x), len(x))), np.empty((2, len(x))), loop_array(u)
        for column in self.active:
            change = 6e-6 * max(abs(x[column]), 1.0)
            for side, moved in zip(sides, (change, -change), strict=True):
                shifted = np.array(x, dtype=float)
                shifted[column] += moved
                self.kernels.call("derivative", shifted, u, self.constants, side)
            result[:, column] = (sides[0] - sides[1]) / (2.0 * change)
        return result

    def values_at(self, kernel: str, path: np.ndarray, inputs: np.ndarray, size: int) -> np.ndarray:
        """Results (samples, size) of a kernel along a path of states and inputs."""
        sizes = len(self.reference), self.inputs, size
        return at_samples(self.kernels, kernel, self.constants, (path, inputs), sizes)

    @cached_property
    def frozen_jacobian(self) -> np.ndarray:
        """Jacobian (dim, dim) at the reference state and inputs."""
        inputs = self.reference_inputs if len(self.reference_inputs) else np.zeros(self.inputs)
        return self.jacobian(self.reference, inputs)

    @cached_property
    def _ready(self) -> dict[tuple, Ready]:
        # Filled when an integrator is first used.
        return {}

    @cached_property
    def frame(self) -> Frame:
        """Coordinates of the stored operators."""
        blocks = (tuple(((i, 1.0),) for i in range(len(self.reference))),)
        if len(self.partners):
            sign = signs(self.frozen_jacobian, self.partners)
            if sign is not None:
                blocks = mirror_blocks(self.partners, sign)
        columns = tuple(
            tuple(k for k, row in enumerate(block) if row[0][0] in self.active) for block in blocks
        )
        return Frame(blocks, columns, tuple(self.rotating.tolist()))

    def method(self, solver: str, active: np.ndarray) -> Ready:
        """What an integrator needs beside its code, cached."""
        key = solver, active.tobytes()
        if key not in self._ready:
            chosen, operators = catalogue.integrator(solver), np.zeros((1, 1, 1))
            if chosen.tables:
                blocks = self.frame.diagonal(self.frozen_jacobian)
                operators = self.frame.packed([chosen.tables(block) for block in blocks])
            method = Method(chosen.tableau, catalogue.STEP_SIZES, operators, active)
            self._ready[key] = ready(method)
        return self._ready[key]

    def called(self, formulation: str, solver: str = "") -> Ready:
        """The kernels that a run calls, a solver's step kernel too, cached."""
        key = formulation, solver
        if key not in self._ready:
            kernel = self._step_kernel(solver) if solver else None
            step = address_of(Kernels([kernel]), kernel.name) if kernel else 0
            called = catalogue.FORMULATIONS[formulation]
            addresses = [
                address_of(self.kernels, name) if name in called else 0
                for name in ("derivative", "second_order", "speeds")
            ]
            kernels = np.array([*addresses, step], dtype=np.int64)
            self._ready[key] = ready(Equations(kernels, self.constants, self.error_scale))
        return self._ready[key]

    def _step_kernel(self, solver: str) -> Kernel | None:
        """The step kernel of a solver of the full system, where it has one."""
        make = catalogue.integrator(solver).step_kernel
        return make(self.frame, self.inputs) if make else None

    def run(
        self,
        maneuver: Excitation,
        state: np.ndarray,
        windows: ControlPeriods,
        solver: Solver,
        record_all_until: float = np.inf,
    ) -> Run:
        """Integrate from a state (n,) over a maneuver; `InputError` if a value or name is wrong.

        From `record_all_until` s on the run may be recorded at points, see `loop_arguments.Output`.
        """
        check_positive("tolerance", solver.tolerance, SMALLEST_TOLERANCE)
        if solver.longest_step is not None:
            check_positive("longest_step", solver.longest_step)
        pool, kind = Pool(), None
        if solver.complete:
            # Complete maneuvers with the same output times share a workspace.
            length = maneuver.duration, maneuver.samples
            pool, kind = self._pool, (length, id(windows), solver, record_all_until)
        arguments = maneuver, windows, solver, record_all_until
        space = pool.taken(kind, lambda: self.workspace(*arguments))
        if space.signal is not maneuver.packed_pieces:
            spans = _spans(maneuver, windows, space.output.samples)
            space.take(maneuver.packed_pieces, spans, maneuver.recorded_inputs[1])
        self._set_constants(space.call)
        start, output = space.memory.start, space.output
        assert len(state) == len(start), f"{len(state)} states, not {len(start)}"
        start[:] = state
        output.counts.fill(0)
        status, seconds = timed(space.call)
        failure = f"{REASONS[status]} at t = {space.memory.buffer[0]:.6g} s" if status else ""
        give_back = partial(pool.give_back, kind, space)
        return Run(output, seconds, failure, space.cached_loops, give_back)

    @cached_property
    def _pool(self) -> Pool[Workspace]:
        return Pool()

    def workspace(
        self,
        maneuver: Excitation,
        windows: ControlPeriods,
        solver: Solver,
        record_all_until: float = np.inf,
    ) -> Workspace:
        """Arrays of a run over a maneuver, its start still to be written; see `run`."""
        times = output_times(solver.times, maneuver, begin=solver.begin)
        spans = _spans(maneuver, windows, times, solver.begin)
        path = np.empty((len(times), len(self.error_scale)))
        counts = np.zeros(len(DYNAMIC_COUNTS), dtype=np.int64)
        inputs = maneuver.recorded_inputs[1] if solver.complete else maneuver.at(times)
        few = solver.complete and catalogue.integrator(solver.name).cubic and len(times) >= LANES
        if not few or record_all_until >= times[-1]:
            record_all_until = np.inf
        output = Output.of(times, path, counts, inputs.copy(), record_all_until)
        return self.packed(windows, solver, maneuver.packed_pieces, spans, output)

    def packed(
        self, windows: ControlPeriods, solver: Solver, signal: Ready, spans: Ready, output: Output
    ) -> Workspace:
        """The time loop with all its arguments, see `integrators/loop.integrate`."""
        name, chosen = solver.name, catalogue.integrator(solver.name)
        full = windows.formulation == "full"
        if catalogue.frozen(name) and not full:
            raise InputError(f"{name} freezes the full model's Jacobian: not for a reduced model")
        dim, n = int(windows.ranks.max()), len(self.error_scale)
        formulation = windows.formulation
        longest = float(solver.longest_step or np.inf)
        step = self._step_kernel(name) if full else None
        memory = Memory(
            start=np.empty(n),
            buffer=np.empty(catalogue.scratch_size(chosen, n, dim, self.inputs, step)),
            integers=np.empty(dim + catalogue.FLAGS, dtype=np.int64),
        )
        call = catalogue.time_loop(name, formulation).prepared(
            self.called(formulation, name if full else ""),
            signal,
            spans,
            windows.subspaces,
            self.method(name, self.active if full else np.arange(dim)),
            catalogue.control_of(name, float(solver.tolerance), longest),
            output,
            memory,
        )
        self._set_constants(call)
        return Workspace(call, memory, output, windows, signal)

    def _set_constants(self, call: Prepared) -> None:
        """Have a loop read the constants of this system."""
        call.words[call.address("equations.constants")] = self._address

    @cached_property
    def _address(self) -> int:
        return self.constants.ctypes.data


def _spans(
    maneuver: Excitation, windows: ControlPeriods, times: np.ndarray, begin: float = 0.0
) -> Ready:
    """Parts of a run over a maneuver, with these output times."""
    end = float(times[-1]) if len(times) else maneuver.duration
    return windows.spans(maneuver.packed_pieces.bundle.edges, end, begin)
