"""All integrators by name, and what each needs beside its code."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from vehiclemor.codegen.loops import Loop, Ready, loops, ready
from vehiclemor.codegen.operations import Kernel
from vehiclemor.progress import first_use
from vehiclemor.registry import choice
from vehiclemor.simulation.integrators import dopri5, etdrk4, explicit_pair, rodas4
from vehiclemor.simulation.integrators.loop import scratch_end
from vehiclemor.simulation.integrators.step_kernels import Frame, exponential_step
from vehiclemor.simulation.loop_arguments import Control

# Step sizes (s) for which operators are stored.  Where a step and the nearest of them differ more,
# its error grows and steps are rejected.
STEP_SIZES = 2.0 ** (0.125 * np.arange(-128, 25))
# Formulation -> kernels that it calls; a step kernel may come besides.
FORMULATIONS = {
    "full": ("derivative",),
    "state": ("derivative",),
    "coordinates": ("derivative", "second_order", "speeds"),
}
# Integers of scratch space beside one for each state.
FLAGS = 1
# A run that needs more evaluations of its right-hand side than this for a second goes nowhere.
MOST_CALLS = 100_000


@dataclass(frozen=True)
class Integrator:
    """One integrator, and what the time loop must know of it."""

    summary: str  # One line.
    modules: tuple[str, ...]  # With its compiled functions, see `contract`; later ones go first.
    order: int  # Power of the step size with which the error at the end of a run falls.
    control: Control  # Its step-size control.
    # Scratch space: vectors and matrices of the system's dimension, single numbers, inputs.
    rows: int
    squares: int = 0
    numbers: int = 0
    inputs: int = 0
    cubic: bool = True  # Whether its dense output is a cubic in each step.
    tableau: np.ndarray = field(default_factory=lambda: np.zeros((1, 1)))  # Its coefficients.
    # Makes the step kernel from the frame and the number of inputs, where it has one.
    step_kernel: Callable[[Frame, int], Kernel] | None = None
    # Makes what is stored of a frozen Jacobian: transposed operators (step sizes, tables, n, n) of
    # a diagonal block.  None for a method with fresh Jacobians or without any.
    tables: Callable[[np.ndarray], np.ndarray] | None = None


INTEGRATORS = {
    "dopri5": Integrator(
        "Dormand-Prince 5(4), explicit",
        ("explicit_pair", "dopri5"),
        5,
        Control(0.17, 0.17, 0.04, 1e-4, shrink_least=0.2, grow=10.0, halve_last=0.0),
        rows=explicit_pair.scratch_rows(dopri5.TABLE),
        cubic=False,
        tableau=dopri5.TABLE,
    ),
    "rodas4": Integrator(
        "Rosenbrock method of order 4, fresh Jacobians",
        ("rodas4",),
        4,
        Control(1.0 / 4.0, 1.0 / 4.0),
        rows=rodas4.ROWS,
        squares=rodas4.SQUARES,
        tableau=rodas4.tableau(),
    ),
    "etdrk4": Integrator(
        "exponential method of order 4, one Jacobian for all runs",
        ("etdrk4",),
        4,
        Control(
            0.175,
            0.25,
            0.1,
            memory_floor=float(np.exp(-9.0)),
            shrink_least=0.2,
            grow=4.0,
            shortest_first=float(STEP_SIZES[0]),
        ),
        rows=len(etdrk4.ARGUMENTS) + etdrk4.ROWS,
        numbers=len(etdrk4.NUMBERS) + etdrk4.MEMORY,
        inputs=etdrk4.STAGE_INPUTS,
        step_kernel=exponential_step,
        tables=partial(etdrk4.exponential_tables, step_sizes=STEP_SIZES),
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
    control = integrator(name).control
    limits = {"tolerance": tolerance, "longest": longest, "most_calls": float(MOST_CALLS)}
    return ready(control._replace(**limits))


def time_loop(name: str, formulation: str) -> Loop:
    """The compiled time loop of an integrator and a formulation."""
    # What a formulation doesn't define is as of the full system, or of the state.
    defaults = ("full", "state") if formulation == "coordinates" else ("full",)
    formulations = dict.fromkeys((*defaults, formulation))
    modules = (
        "simulation.loop_arguments",
        "inputs.polynomial_loops",
        "simulation.integrators.contract",
        "simulation.integrators.dense_solves",
        *(f"simulation.formulations.{form}" for form in formulations),
        *(f"simulation.integrators.{module}" for module in integrator(name).modules),
        "simulation.integrators.loop",
    )
    with first_use(f"the time loop of {name}"):
        return loops(modules, ("integrate",))["integrate"]


def scratch_size(
    chosen: Integrator, n: int, dim: int, inputs: int, step: Kernel | None = None
) -> int:
    """Floats of scratch space for n states, the largest reduced dimension and so many inputs.

    A step kernel works in its result.
    """
    of_method = chosen.rows * dim + chosen.squares * dim * dim + chosen.numbers
    of_step = step.shape[0] if step else 0
    return scratch_end(n, inputs) + of_method + chosen.inputs * inputs + of_step


# All source that a run follows from: of integrators their tables and step-size control too.
LOOP_SOURCES = (
    "inputs.polynomial_loops",
    "simulation.loop_arguments",
    *(f"simulation.formulations.{name}" for name in FORMULATIONS),
    *(f"simulation.integrators.{path.stem}" for path in sorted(Path(__file__).parent.glob("*.py"))),
    "simulation.path_loops",
)
