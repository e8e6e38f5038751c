"""All integrators by name, and what each needs beside its code."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from vehiclemor.codegen.loops import Loop, Ready, loops, ready
from vehiclemor.errors import InputError
from vehiclemor.registry import unknown
from vehiclemor.simulation.integrators import exponential_functions, tableaus
from vehiclemor.simulation.integrators.structures import Control

# Step sizes (s) for which operators are stored.  Where a step and the nearest of them differ more,
# its error grows and steps are rejected.
STEP_GRID = 2.0 ** (0.125 * np.arange(-128, 25))
# A run that needs more evaluations of its right-hand side than this is going nowhere.
MOST_CALLS = 100_000
# Longest first step (s) after a break point of the inputs.
RESTART = 0.05


@dataclass(frozen=True)
class StepControl:
    """How step sizes follow the errors, see `structures.Control`."""

    exponent: float
    rejected_exponent: float
    memory_exponent: float = 0.0
    memory_start: float = 1.0
    memory_floor: float = 1e-4
    shrink_least: float = 0.1
    shrink: float = 0.2
    grow: float = 6.0
    halve_last: bool = True
    shortest_first: float = 0.0


@dataclass(frozen=True)
class Integrator:
    """One integrator, and what the time loop must know of it.

    Attributes
    ----------
    summary
        One line.
    order
        Power of the step size with which the error at the end of a run falls.
    control
        Its step-size control.
    modules
        Modules of its functions, those that it shares first.
    tableau
        Its coefficients.
    operators
        Makes what is stored of a frozen Jacobian (dim, dim) and the active states for every step
        size: (step sizes, rows, dim); none for a method with fresh Jacobians or without any.
    fused_modules
        Modules for systems with a kernel that takes whole steps.
    rows, squares, fused_squares
        Scratch space: vectors and matrices of the system's dimension.
    block_operators
        Makes operators of diagonal blocks alone, where a kernel that takes whole steps wants those.
    """

    summary: str
    order: int
    control: StepControl
    modules: tuple[str, ...]
    tableau: np.ndarray = field(default_factory=lambda: np.zeros((1, 1)))
    operators: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None
    fused_modules: tuple[str, ...] = ()
    rows: int = 24
    squares: int = 0
    fused_squares: int = 0
    block_operators: Callable[[np.ndarray, Sequence[Sequence[int]]], np.ndarray] | None = None


def inverses(jacobian: np.ndarray, active: np.ndarray) -> np.ndarray:
    """Transposed active columns (step sizes, active, dim) of (I - gamma h J)^-1."""
    from vehiclemor.simulation.integrators.ros34pw2 import GAMMA

    identity = np.eye(len(jacobian))
    found = [np.linalg.inv(identity - GAMMA * h * jacobian) for h in STEP_GRID]
    return np.ascontiguousarray([inverse.T[active] for inverse in found])


def matrix_functions(jacobian: np.ndarray, active: np.ndarray) -> np.ndarray:
    """Matrix functions (step sizes, 7 dim, dim) of the exponential method."""
    del active
    tables = exponential_functions.exponential_tables(jacobian, STEP_GRID)
    return np.ascontiguousarray(tables.reshape(len(STEP_GRID), -1, tables.shape[-1]))


def block_matrix_functions(jacobian: np.ndarray, blocks: Sequence[Sequence[int]]) -> np.ndarray:
    """The same of diagonal blocks alone, numbers of the states by block."""
    return exponential_functions.block_functions(jacobian, blocks, STEP_GRID)


INTEGRATORS = {
    "dopri5": Integrator(
        "Dormand-Prince 5(4), explicit",
        5,
        StepControl(0.17, 0.17, 0.04, 1e-4, shrink_least=0.2, grow=10.0, halve_last=False),
        ("dopri5",),
    ),
    "rodas4": Integrator(
        "Rosenbrock method of order 4, fresh Jacobians",
        4,
        StepControl(1.0 / 4.0, 1.0 / 4.0),
        ("cubic", "dense_solves", "rodas4"),
        tableaus.rodas4(),
        squares=2,
    ),
    "ros34pw2": Integrator(
        "W-method of order 3, one Jacobian for all runs",
        3,
        StepControl(1.0 / 3.0, 1.0 / 3.0),
        ("step_grid", "cubic", "ros34pw2"),
        tableaus.ros34pw2(),
        inverses,
        ("step_grid", "cubic", "fused_ros34pw2"),
        fused_squares=2,
    ),
    "etdrk4": Integrator(
        "exponential method of order 4, with the same",
        4,
        StepControl(
            0.175,
            0.25,
            0.1,
            memory_floor=float(np.exp(-9.0)),
            shrink_least=0.2,
            grow=4.0,
            shortest_first=float(STEP_GRID[0]),
        ),
        ("step_grid", "cubic", "etdrk4"),
        operators=matrix_functions,
        block_operators=block_matrix_functions,
        fused_modules=("step_grid", "cubic", "etdrk4", "fused_etdrk4"),
        rows=32,
        fused_squares=7,
    ),
}
# Older name of an integrator.
ALIASES = {"explicit": "dopri5"}


def integrator(name: str) -> Integrator:
    """An integrator by its name; `InputError` if there is none."""
    known = ALIASES.get(name, name)
    if known not in INTEGRATORS:
        raise unknown("solver", name, INTEGRATORS)
    return INTEGRATORS[known]


def frozen(name: str) -> bool:
    """Whether an integrator stores operators of one Jacobian for all runs."""
    return integrator(name).operators is not None


def check_formulation(name: str, full: bool) -> None:
    """Raise `InputError` if an integrator can't run a reduced system."""
    if frozen(name) and not full:
        raise InputError(f"{name} freezes the full model's Jacobian: not for a reduced model")


@lru_cache(maxsize=64)
def control_of(name: str, tolerance: float, longest: float) -> Ready:
    """Limits and step-size control of a run."""
    own = integrator(name).control
    control = Control(
        tolerance,
        longest,
        own.shortest_first,
        RESTART,
        float(MOST_CALLS),
        own.exponent,
        own.memory_exponent,
        own.memory_start,
        own.memory_floor,
        own.rejected_exponent,
        own.shrink_least,
        own.shrink,
        own.grow,
        float(own.halve_last),
    )
    return ready(control)


def _problem_modules(formulation: str) -> tuple[str, ...]:
    return (
        "simulation.integrators.structures",
        "simulation.formulations.inputs",
        f"simulation.formulations.{formulation}",
    )


def rhs_loop(formulation: str) -> Loop:
    """Compiled right-hand side of a system at one time, see `loop.rhs_at`."""
    modules = (*_problem_modules(formulation), "simulation.integrators.loop")
    return loops(modules, ("rhs_at",))["rhs_at"]


def time_loop(chosen: Integrator, formulation: str, fused: bool) -> Loop:
    """The compiled time loop of an integrator and a formulation."""
    own = chosen.fused_modules if fused else chosen.modules
    modules = (
        *_problem_modules(formulation),
        *(f"simulation.integrators.{name}" for name in own),
        "simulation.integrators.loop",
    )
    return loops(modules, ("integrate",))["integrate"]


def problem_size(n: int, inputs: int) -> int:
    """Floats of scratch space that `loop.on_span` needs, for n states."""
    half = n // 2
    return 3 * n + inputs + 2 * half * (half + 1)


def scratch_size(chosen: Integrator, n: int, dim: int, inputs: int, fused: bool) -> int:
    """Floats of scratch space for n states, the largest reduced dimension and so many inputs."""
    squares = chosen.fused_squares if fused else chosen.squares
    return problem_size(n, inputs) + chosen.rows * dim + squares * dim * dim + 3 * inputs + 16


# All source that a run may be compiled from.
LOOP_SOURCES = (
    *(f"simulation.formulations.{name}" for name in ("inputs", "full", "state", "coordinates")),
    *(
        f"simulation.integrators.{name}"
        for own in INTEGRATORS.values()
        for name in dict.fromkeys((*own.modules, *own.fused_modules))
    ),
    "simulation.integrators.structures",
    "simulation.integrators.loop",
    "simulation.path_loops",
)
