"""All integrators by name, and what each needs beside its code."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache, partial

import numpy as np

from vehiclemor.codegen.loops import Loop, Ready, loops, ready
from vehiclemor.codegen.operations import Kernel
from vehiclemor.progress import first_use
from vehiclemor.registry import choice
from vehiclemor.simulation.formulations import FORMULATIONS
from vehiclemor.simulation.integrators import etdrk4, rodas4
from vehiclemor.simulation.integrators.loop import scratch_end
from vehiclemor.simulation.integrators.step_kernels import Frame, exponential_step
from vehiclemor.simulation.integrators.structures import Control

# Step sizes (s) for which operators are stored.  Where a step and the nearest of them differ more,
# its error grows and steps are rejected.
STEP_GRID = 2.0 ** (0.125 * np.arange(-128, 25))
# A run that needs more evaluations of its right-hand side than this for a second goes nowhere.
MOST_CALLS = 100_000


@dataclass(frozen=True)
class Integrator:
    """One integrator, the module of its name, and what the time loop must know of it."""

    summary: str  # One line.
    order: int  # Power of the step size with which the error at the end of a run falls.
    control: Control  # Its step-size control.
    cubic: bool = True  # Whether its dense output is the cubic of `shared`.
    tableau: np.ndarray = field(default_factory=lambda: np.zeros((1, 1)))  # Its coefficients.
    # Makes the kernel of a whole step from the frame and the number of inputs, where it has one.
    step_kernel: Callable[[Frame, int], Kernel] | None = None
    # Makes what is stored of a frozen Jacobian: transposed operators (step sizes, tables, n, n) of
    # a diagonal block.  None for a method with fresh Jacobians or without any.
    tables: Callable[[np.ndarray], np.ndarray] | None = None
    # Scratch space: vectors and matrices of the system's dimension, and single numbers.
    rows: int = 24
    squares: int = 0
    numbers: int = 16


INTEGRATORS = {
    "dopri5": Integrator(
        "Dormand-Prince 5(4), explicit",
        5,
        Control(0.17, 0.17, 0.04, 1e-4, shrink_least=0.2, grow=10.0, halve_last=0.0),
        cubic=False,
    ),
    "rodas4": Integrator(
        "Rosenbrock method of order 4, fresh Jacobians",
        4,
        Control(1.0 / 4.0, 1.0 / 4.0),
        tableau=rodas4.tableau(),
        squares=2,
    ),
    "etdrk4": Integrator(
        "exponential method of order 4, one Jacobian for all runs",
        4,
        Control(
            0.175,
            0.25,
            0.1,
            memory_floor=float(np.exp(-9.0)),
            shrink_least=0.2,
            grow=4.0,
            shortest_first=float(STEP_GRID[0]),
        ),
        step_kernel=exponential_step,
        tables=partial(etdrk4.exponential_tables, grid=STEP_GRID),
        rows=32,
    ),
}


def integrator(name: str) -> Integrator:
    """An integrator by its name; `InputError` if there is none."""
    return INTEGRATORS[choice("solver", name, INTEGRATORS)]


def frozen(name: str) -> bool:
    """Whether an integrator stores operators of one Jacobian for all runs."""
    return integrator(name).tables is not None


@lru_cache(maxsize=64)
def control_of(name: str, tolerance: float, longest: float) -> Ready:
    """Limits and step-size control of a run."""
    own = integrator(name).control
    return ready(own._replace(tolerance=tolerance, longest=longest, most_calls=float(MOST_CALLS)))


def time_loop(name: str, formulation: str) -> Loop:
    """The compiled time loop of an integrator and a formulation."""
    # What a formulation doesn't say is as of the full system, or of the state.
    known = ("full", "state") if formulation == "coordinates" else ("full",)
    modules = (
        "simulation.integrators.structures",
        "inputs.polynomial_loops",
        "simulation.integrators.dense_solves",
        *(f"simulation.formulations.{form}" for form in dict.fromkeys((*known, formulation))),
        *(f"simulation.integrators.{module}" for module in ("shared", name, "loop")),
    )
    with first_use(f"the time loop of {name}"):
        return loops(modules, ("integrate",))["integrate"]


def scratch_size(chosen: Integrator, n: int, dim: int, inputs: int) -> int:
    """Floats of scratch space for n states, the largest reduced dimension and so many inputs."""
    # Vectors of a kernel of whole steps are padded, block by block.
    row = dim + 8 if chosen.step_kernel else dim
    own = chosen.rows * row + chosen.squares * dim * dim + 3 * inputs + chosen.numbers
    return scratch_end(n, inputs) + own


# All source that a run may be compiled from.
SOURCES = "dense_solves", "shared", *INTEGRATORS, "structures", "loop"
LOOP_SOURCES = (
    "inputs.polynomial_loops",
    *(f"simulation.formulations.{name}" for name in FORMULATIONS),
    *(f"simulation.integrators.{name}" for name in SOURCES),
    "simulation.path_loops",
)
