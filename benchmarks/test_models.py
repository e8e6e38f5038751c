"""Speed of the models: derivation, kernels, solvers, methods on the nominal run, batches, a study.

Timings are reported, never gated.  Counts, operation counts and errors stand beside them.  Other
tools are compared in `peers/`.
"""

from functools import cache
from typing import Any

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.validation import validated
from vehiclemor.registry import component
from vehiclemor.simulation.control_periods import whole_space
from vehiclemor.simulation.loop_arguments import FINISHED
from vehiclemor.simulation.system import Solver
from vehiclemor.study.run import run_studies
from vehiclemor.symbolic.program import Program

SUSPENSION = "double_wishbone"
SMALL, LARGE = VEHICLES = ("independent_suspension_vehicle", "high_fidelity_vehicle")
CALLS = 10_000
# Runs of a batch.
BATCH = 1024
# Kernels of a vehicle: what solves, and what assembles and leaves the solving to others.
KERNELS = [(SMALL, "derivative"), (LARGE, "derivative"), (LARGE, "descriptor")]
FULL = {
    "explicit 1e-6": ("dopri5", 1e-6),
    "explicit 1e-3": ("dopri5", 1e-3),
    "RODAS4 1e-4": ("rodas4", 1e-4),
    "ETDRK4, one Jacobian": ("etdrk4", 2e-3),
}
POD_3, FIXED = ("pod", "recommended", {"rank": 3}), ("fixed_basis", "recommended", {"rank": 3})
METHODS = {
    SUSPENSION: {
        "pod r=4": ("pod", "recommended", {"rank": 4}),
        "pod literal r=3": ("pod", "literal", {"rank": 3}),
        "pod literal r=6": ("pod", "literal", {"rank": 6}),
    },
    SMALL: {
        "pod state r=3": ("pod", "recommended", {"rank": 3, "formulation": "state"}),
        "pod literal r=3": ("pod", "literal", {"rank": 3}),
    },
    LARGE: {
        "pod r=1": ("pod", "recommended", {"rank": 1}),
        "pod coordinates r=3": ("pod", "recommended", {"rank": 3, "formulation": "coordinates"}),
        "pod literal r=1": ("pod", "literal", {"rank": 1}),
    },
}
ALL = {"pod r=3": POD_3, "fixed basis r=3": FIXED, "replay": ("replay", "recommended", {})}
CASES = [(name, label) for name, own in METHODS.items() for label in [*ALL, *own]]


@cache
def nominal(name: str) -> tuple[Any, Any, Any]:
    """A model, compiled and parametrised, its maneuver, and the full run."""
    model: Any = vm.model(name)
    maneuver = vm.maneuver(model.definition.maneuver)
    return model, maneuver, model.simulate(maneuver)


def largest_errors(benchmark, model, run, reference):
    """Largest errors of the tabled outputs, noted beside the time."""
    error = np.abs(run.outputs - reference.outputs).max(axis=0)
    found = {name: error[model.outputs.index(name)] for name in model.definition.tabled_outputs}
    benchmark.extra_info |= {f"largest_error_{name}": value for name, value in found.items()}
    return found


@pytest.mark.parametrize("name", METHODS)
def test_derivation(benchmark, name):
    """Symbolic derivation with elimination, common subexpressions and hoisting."""
    benchmark.group = "symbolics"
    program = benchmark.pedantic(component("model", name).derive, rounds=3)
    assert isinstance(program, Program)


@pytest.mark.parametrize("kernel", ["residual", "residual_jacobian", "newton_step", "outputs"])
def test_kernel_from_python(benchmark, kernel):
    """One call of a kernel of the suspension, the call from Python included."""
    benchmark.group = "kernels (with the call from Python)"
    model, _, _ = nominal(SUSPENSION)
    result = np.empty(model.equations.shapes[kernel])
    q, u = model.solve([0.05, 0.0]), np.array([0.05, 0.0])
    benchmark(model.equations.call, kernel, q, u, model.constants, result)
    benchmark.extra_info["operations"] = model.operation_counts[kernel]["total"]
    assert np.isfinite(result).all()


@pytest.mark.parametrize(("name", "kernel"), KERNELS)
def test_kernel(benchmark, name, kernel):
    """Calls of one kernel from compiled code; a ten thousandth of it is the time of a call."""
    benchmark.group = f"kernels, {CALLS} calls in a compiled loop"
    model, _, _ = nominal(name)
    states = np.tile(model.start("dropped"), (CALLS, 1))
    inputs = np.full((CALLS, len(model.inputs)), 1e-3)
    size = int(np.prod(model.equations.shapes[kernel]))
    result = benchmark(model.system.values_at, kernel, states, inputs, size)
    benchmark.extra_info["operations"] = model.operation_counts[kernel]["total"]
    assert np.isfinite(result).all()


@pytest.mark.parametrize(("solver", "tolerance"), [("newton", 1e-12), ("newton_lanes", 1e-6)])
def test_suspension(benchmark, solver, tolerance):
    """The nominal run of the suspension, 1001 time points."""
    benchmark.group = "full order, 1001 time points"
    model, maneuver, full = nominal(SUSPENSION)
    inputs = maneuver.at(maneuver.times)
    trajectory = benchmark(model.solve_path, maneuver.times, inputs, solver, tolerance)
    benchmark.extra_info |= trajectory.counts
    assert np.abs(trajectory.coordinates - full.coordinates).max() < 1e-6


@pytest.mark.parametrize("label", FULL)
@pytest.mark.parametrize("name", VEHICLES)
def test_vehicle(benchmark, name, label):
    """The lane change of a vehicle: the compiled loop alone."""
    benchmark.group = f"full order, {name}, compiled loop"
    model, maneuver, reference = nominal(name)
    solver, tolerance = FULL[label]
    run = model.simulate(maneuver, None, None, solver, tolerance)
    whole = whole_space(2 * len(model.coordinates))
    space = model.system.workspace(maneuver, whole, Solver(solver, tolerance, maneuver.times))
    space.memory.start[:] = model.start()

    def whole_run():
        # The loop stops at a number of calls, which its counts add up.
        space.output.counts[:] = 0
        return space.call()

    assert benchmark(whole_run) == FINISHED
    benchmark.extra_info |= run.counts
    assert largest_errors(benchmark, model, run, reference)["lateral_position"] < 0.05


@pytest.mark.parametrize(("name", "label"), CASES)
def test_method(benchmark, name, label):
    """The nominal run with a reduced model, fitted beforehand, outputs and all."""
    benchmark.group = f"methods, {name}, with the outputs"
    model, maneuver, full = nominal(name)
    key, preset, chosen = (ALL | METHODS[name])[label]
    method, start = component("method", key), model.starts[0]
    settings = validated(method, model.kind, chosen, preset)
    reduced = method.fit(model, [TrainingRun(model, maneuver, start)], settings)

    def delivered():
        run = reduced.simulate(maneuver, start)
        # Histories are made when they are read.
        assert run.outputs is not None
        return run

    run = benchmark(delivered)
    benchmark.extra_info |= run.counts
    benchmark.extra_info |= {"offline_seconds": reduced.offline.seconds, "seconds": run.seconds}
    assert run.status == "ok"
    assert run.outputs.shape == full.outputs.shape


@pytest.mark.parametrize("jobs", [1, 2])
@pytest.mark.parametrize("which", ["reduced", "full"])
def test_batch(benchmark, which, jobs):
    """Ten-second maneuvers with inputs of their own, three outputs at 10 Hz; all of the call."""
    benchmark.group = f"{BATCH} maneuvers of 10 s, whole call"
    car = vm.rom(SMALL)
    if which == "full":
        car = vm.reduce(SMALL, "full_order", preset="strongest")
    times, rng = np.linspace(0.0, 10.0, 501), np.random.default_rng(1)
    rate = rng.uniform(0.5, 4.0, (BATCH, 1))
    signals = vm.many_signals(times, 0.01 * np.tanh(times) * np.sin(rate * times), "cubic")
    kept = {"outputs": ["lateral_position", "yaw", "Fz_FL"], "times": times[::5]}
    found = benchmark(vm.simulate_many, car, signals, jobs=jobs, **kept)
    benchmark.extra_info["seconds in compiled loops"] = found.seconds.sum().item()
    assert found.status.isin(["ok", "untrusted"]).all()


def test_small_study(benchmark, tmp_path):
    """Cells of figures 6 and 7, computed, stored and combined; a fresh folder each time."""
    benchmark.group = "study"
    folders = (tmp_path / str(number) for number in range(100))

    def fresh():
        return ("figures-6-7", next(folders)), {}

    results = benchmark.pedantic(run_studies, setup=fresh, rounds=3)
    assert (results["figures-6-7"]["status"] == "ok").all()
