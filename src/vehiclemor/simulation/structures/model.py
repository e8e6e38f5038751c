"""Structural models (kind `structural`) ready to run, and the step sizes of their runs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np

from vehiclemor.arguments import number, within
from vehiclemor.exceptions import ConvergenceError, GeometryError, InputError, blamed
from vehiclemor.inputs.checks import checked_maneuver
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.multibody.definition import Structure
from vehiclemor.registry import choice
from vehiclemor.simulation.checks import checked_inputs, left_validity, limits_of, wheel_remarks
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.run_timer import timed
from vehiclemor.simulation.structures import time_loops as compiled
from vehiclemor.simulation.structures.system import (
    STRUCTURAL_LOOPS,
    PortLaw,
    StructuralSystem,
    factored,
)
from vehiclemor.simulation.trajectory import (
    STRUCTURAL_COUNTS,
    Names,
    Start,
    Trajectory,
    output_names,
)

SOLVER = "generalised_alpha"
# Step sizes in s that are tried, and how long (s) a run is repeated to estimate its error.
LONGEST_STEP, SHORTEST_STEP = 4e-3, 6.25e-5
FIRST_STEP = 1e-3
TRIED = 0.75
# Largest errors of outputs, as part of their ranges: of full-order references, and by default.
TIGHT, USUAL = 1e-3, 3e-3
TOLERANCES = 1e-13, 0.1
REASONS = {
    compiled.NOT_FINITE: "a coordinate is not finite",
    compiled.NO_CONVERGENCE: "no convergence of the port forces",
}
# Runs whose step sizes are cached.
MOST_RUNS = 512
# Time (s) between output times beyond which errors are estimated between them.
LONGEST_SPACING = 0.02
# Part of the largest range of an output of the same unit that is rounding; and of the largest
# entry of a matrix by which it may differ from its transpose.
ROUNDING, SYMMETRIC = 1e-6, 1e-9
# Changes of port forces (N) below which the iteration for the static state ends.
STATIC_TOLERANCE, STATIC_ITERATIONS = 1e-6, 100


def first_samples(
    system: StructuralSystem,
    maneuver: Excitation,
    every: int,
    samples: int,
    begin: int = 0,
    recorded: bool = False,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """The first samples of a run with so many steps between output times.

    One that begins at a later sample does so at rest, and its inputs are what is beyond their
    first.
    """
    last = begin + samples - 1
    inputs = inputs_at_steps(maneuver, every)[begin * every : last * every + 1]
    if begin:
        inputs = inputs - inputs[0]
    state = np.zeros((3, system.structure.size))
    return system.integrate(state, inputs, spacing_of(maneuver) / every, every, recorded)


def steps_between(
    system: StructuralSystem, maneuver: Excitation, tolerance: float, alike: np.ndarray
) -> tuple[int, str]:
    """Steps between output times of this accuracy, and a remark if no step is short enough.

    A part of a run, in which its inputs change most, is repeated with half the step, as long as
    outputs differ by more than the tolerance times their range; the method is of second order.
    """
    spacing = spacing_of(maneuver)
    if spacing > LONGEST_SPACING:
        # A few output times don't show the motion between them.
        inner = int(np.ceil(spacing / LONGEST_SPACING))
        every, remark = steps_between(system, maneuver.subdivided(inner), tolerance, alike)
        return inner * every, remark
    every = max(round(spacing / FIRST_STEP), 1)
    least, most = (max(round(spacing / h), 1) for h in (LONGEST_STEP, SHORTEST_STEP))
    samples = min(round(TRIED / spacing) + 1, maneuver.samples)
    begin = window_of_largest_input_change(maneuver, samples)
    coarse = first_samples(system, maneuver, every, samples, begin)[0]
    while True:
        fine = first_samples(system, maneuver, 2 * every, samples, begin)[0]
        # Their difference is three quarters of the coarse one's error.
        error = 4.0 / 3.0 * relative_error(coarse, fine, alike)
        if not error > tolerance or every >= most:
            break
        every, coarse = min(2 * every, most), fine
    # Errors grow with the square of the step.
    while every > least and not every % 2 and 5.0 * error < tolerance:
        every, error = every // 2, 4.0 * error
    remark = ""
    if error > tolerance:
        left = f"an error of {error:.1e} of an output's range"
        remark = f"steps of {spacing / every:.3g} s leave {left}"
    return every, remark


def spacing_of(maneuver: Excitation) -> float:
    """Time in s between output times."""
    return maneuver.duration / max(maneuver.samples - 1, 1)


@lru_cache(maxsize=16)
def inputs_at_steps(maneuver: Excitation, every: int) -> np.ndarray:
    """Inputs (steps + 1, inputs) of a maneuver with so many steps between output times."""
    times = np.linspace(0.0, maneuver.duration, (maneuver.samples - 1) * every + 1)
    inputs = checked_inputs(maneuver.at(times), times, maneuver.inputs)
    inputs.flags.writeable = False
    return inputs


def window_of_largest_input_change(maneuver: Excitation, samples: int) -> int:
    """First of so many samples in which the inputs of a maneuver change most."""
    changes = np.diff(inputs_at_steps(maneuver, 1), axis=0) ** 2
    totals = changes.sum(axis=0)
    changing = totals > 0.0
    shares = (changes[:, changing] / totals[changing]).sum(axis=1)
    sums = np.append(0.0, np.cumsum(shares))
    return int(np.argmax(sums[samples - 1 :] - sums[: len(sums) - samples + 1]))


def relative_error(one: np.ndarray, other: np.ndarray, alike: np.ndarray | None = None) -> float:
    """Largest RMS difference of outputs (samples, outputs) as part of their ranges.

    Those that move by less than a millionth of what others of the same unit (`alike`) do, such as
    roll on a road that is alike on both sides, move by rounding alone.
    """
    size = np.ptp(other, axis=0)
    alike = np.arange(len(size)) if alike is None else alike
    largest = np.array([size[alike == unit].max() for unit in alike])
    moving = size > ROUNDING * largest
    difference = np.sqrt(np.mean((one - other) ** 2, axis=0))
    return float((difference[moving] / size[moving]).max(initial=0.0))


def wrong_matrices(structure: Structure, ports: int, outputs: int) -> str:
    """Why the matrices of a structure are wrong; empty if they are right."""
    n = structure.size
    shapes = {"mass": (n, n), "stiffness": (n, n), "ports": (n, ports)}
    shapes |= {"dampers": (n, structure.dampers.shape[1])}
    matrices: dict[str, Any] = {name: getattr(structure, name) for name in shapes}
    named = ("outputs of q", "of q'", "of q''", "of the port forces")
    matrices |= dict(zip(named, structure.outputs, strict=True))
    shapes |= dict(zip(named, [(outputs, n)] * 3 + [(outputs, ports)], strict=True))
    for name, matrix in matrices.items():
        if matrix.shape != shapes[name]:
            return f"{name} has shape {matrix.shape}, not {shapes[name]}"
        if not np.isfinite(matrix.tocsc().data).all():
            return f"{name} has an entry that is not finite"
    for name in ("mass", "stiffness"):
        matrix = matrices[name]
        if abs(matrix - matrix.T).max() > SYMMETRIC * abs(matrix).max():
            return f"{name} is not symmetric"
    return ""


@dataclass(frozen=True, eq=False)
class StructuralModel(Model):
    """A structure whose ports have a compiled law; it starts from its static state alone."""

    loops, reference = STRUCTURAL_LOOPS, (SOLVER, TIGHT)

    def __post_init__(self) -> None:
        """Wrong matrices raise now; `GeometryError` where it can't stand."""
        super().__post_init__()
        _ = self.system

    @cached_property
    def system(self) -> StructuralSystem:
        """The matrices about the static state; `InputError` if the declaration makes none."""
        name = self.name
        with blamed(f"model {name!r}: structure", self.definition.structure):
            structure = self.definition.structure(self.parameters.values())
            wrong = wrong_matrices(structure, len(self.definition.ports), len(self.outputs))
        if wrong:
            raise InputError(f"model {name!r}: structure: {wrong}")
        return StructuralSystem(structure, self._static_law(structure))

    @cached_property
    def _alike(self) -> np.ndarray:
        """Numbers (outputs,) of the units of the outputs."""
        units = [quantity.unit for quantity in self.definition.outputs]
        return np.array([units.index(unit) for unit in units])

    @property
    def size(self) -> int:
        """Number of coordinates n."""
        return self.system.structure.size

    def _static_law(self, structure: Structure) -> PortLaw:
        """The law about the state in which the structure stands on a flat road.

        Newton's method in the port forces; `GeometryError` if it can't stand.
        """
        p, nothing = structure.ports.shape[1], np.zeros(len(self.inputs))
        law = PortLaw(self.equations, self.constants, np.zeros((2, p)))
        # Springs at all ports hold those that carry nothing at first.
        stiffness = np.full(p, 1e5)
        factor = factored(structure.with_port_springs(stiffness), "MMD_AT_PLUS_A")
        ports = structure.ports.toarray()
        compliance = ports.T @ factor.solve(ports)
        free = ports.T @ factor.solve(structure.load)
        w = free.copy()
        for _ in range(STATIC_ITERATIONS):
            force, slope, _ = law.at(w, np.zeros(p), nothing).T
            residual = free + compliance @ (force + stiffness * w) - w
            jacobian = np.eye(p) - compliance * (slope + stiffness)
            step = np.linalg.solve(jacobian, residual)
            # Springs harden, and a tire that has lifted off gives no slope.
            w += step * min(1.0, 0.05 / max(np.abs(step).max(), 1e-12))
            if np.abs(stiffness * step).max() < STATIC_TOLERANCE:
                force = law.at(w, np.zeros(p), nothing)[:, 0]
                return PortLaw(law.kernels, law.constants, np.array([w, force]))
        raise GeometryError(f"{self.name} finds no static state: it can't stand")

    def simulate(
        self,
        maneuver: Excitation,
        start: Start | None = None,
        times: np.ndarray | None = None,
        solver: str | None = None,
        tolerance: float | None = None,
        outputs: Names = None,
    ) -> Trajectory:
        """Full-order trajectory at the output times, or at some of them, see `Model.simulate`."""
        choice("solver", SOLVER if solver is None else solver, (SOLVER,))
        tolerance = TIGHT if tolerance is None else tolerance
        within("tolerance", number("tolerance", tolerance), TOLERANCES)
        self.start(start)
        run = self.run(maneuver, None, tolerance, outputs)
        if run.status != "ok":
            raise ConvergenceError(f"{self.name}: {run.message}", run)
        return run if times is None else run.chosen(times=times)

    def run(
        self,
        maneuver: Excitation,
        system: StructuralSystem | None = None,
        tolerance: float = USUAL,
        outputs: Names = None,
        recorded: bool = False,
        step: float = 0.0,
    ) -> Trajectory:
        """A run of the full structure, or of a reduced one; it records a divergence.

        If recorded, the trajectory has all n coordinates.  With a step in s, the tolerance does not
        count.
        """
        maneuver = checked_maneuver(maneuver, self.definition)
        names = None if outputs is None else output_names(outputs)
        system = system or self.system
        (every, remark), choosing = timed(lambda: self._steps(system, maneuver, tolerance, step))
        run = partial(first_samples, system, maneuver, every, maneuver.samples, recorded=recorded)
        (histories, states, counts, reason), seconds = timed(run)
        times, inputs = maneuver.recorded_inputs
        failure = ""
        if reason:
            reached = int(np.isfinite(histories[:, 0]).sum())
            failure = f"{REASONS[reason]} at t = {times[min(reached, len(times) - 1)]:.4g} s"
        limited, watched, ranges = limits_of(self.definition)
        columns = histories[:, [self.outputs.index(name) for name in watched]]
        outside = ~((columns >= ranges[:, 0]) & (columns <= ranges[:, 1])) & np.isfinite(columns)
        first = np.where(outside.any(axis=0), outside.argmax(axis=0), len(times)).tolist()
        left = min(first[: len(limited)], default=len(times))
        if left < len(times):
            name = limited[first.index(left)]
            failure = left_validity(
                self.definition, name, columns[left, first.index(left)], times[left]
            )
            histories[left:] = np.nan
        remarks = wheel_remarks(self.definition, first[len(limited) :], times)
        further: dict[str, Any] = {"remark": "; ".join(filter(None, (*remarks, remark)))}
        if recorded:
            further["coordinates"] = states
        results = times, inputs, histories, counts, choosing + seconds, failure
        trajectory = self.trajectory(*results, **further)
        return trajectory if names is None else trajectory.chosen(names)

    def _steps(
        self, system: StructuralSystem, maneuver: Excitation, tolerance: float, step: float
    ) -> tuple[int, str]:
        """Steps between output times by a step in s or, if it is 0, a tolerance; and a remark."""
        if step:
            return max(round(spacing_of(maneuver) / step), 1), ""
        key, known = (maneuver, tolerance), system.steps_of_runs
        if key not in known:
            if len(known) >= MOST_RUNS:
                known.clear()
            known[key] = steps_between(system, maneuver, tolerance, self._alike)
        return known[key]

    def trajectory(
        self,
        times: np.ndarray,
        inputs: np.ndarray,
        outputs: np.ndarray,
        counts: np.ndarray,
        seconds: float,
        failure: str = "",
        **further: Any,
    ) -> Trajectory:
        """Trajectory of histories of outputs (samples, outputs); it has diverged if it failed."""
        fields = {
            "times": times,
            "inputs": inputs,
            "coordinates": inputs[:, :0],
            "speeds": inputs[:, :0],
            "outputs": outputs,
            "counts": dict(zip(STRUCTURAL_COUNTS, counts.tolist(), strict=True)),
            "seconds": seconds,
            "status": "diverged" if failure else "ok",
            "message": failure,
            "names": self.outputs,
            "model": self,
        }
        return Trajectory.of(**fields | further)
