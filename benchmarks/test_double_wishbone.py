"""Speed of the double-wishbone suspension: kernels, full order, methods, a small study.

Timings are reported, never gated.  Counts and operation counts stand beside them.
"""

import numpy as np
import pytest

from vehiclemor.inputs.suspension import sine_travel
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.validation import validated
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.study.run import run_studies
from vehiclemor.symbolic.program import Program

METHODS = {
    "pod r=3": ("pod", "recommended", {"rank": 3}),
    "pod literal r=3": ("pod", "literal", {"rank": 3}),
    "pod r=4": ("pod", "recommended", {"rank": 4}),
    "pod literal r=6": ("pod", "literal", {"rank": 6}),
    "fixed basis r=3": ("fixed_basis", "recommended", {"rank": 3}),
    "replay": ("replay", "recommended", {}),
}


@pytest.fixture(scope="module")
def model():
    """The model, compiled and parametrised."""
    return build("double_wishbone")


def test_derivation(benchmark):
    """Symbolic derivation with common subexpressions and hoisting."""
    benchmark.group = "symbolics"
    program = benchmark.pedantic(component("model", "double_wishbone").derive, rounds=3)
    assert isinstance(program, Program)


@pytest.mark.parametrize("kernel", ["residual", "residual_jacobian", "newton_step", "outputs"])
def test_kernel(benchmark, model, kernel):
    """One call of a kernel from Python, the call included."""
    benchmark.group = "kernels (with the call from Python)"
    result = np.empty(model.equations.shapes[kernel])
    q, u = model.solve([0.05, 0.0]), np.array([0.05, 0.0])
    benchmark(model.equations.kernels.call, kernel, q, u, model.constants, result)
    benchmark.extra_info["operations"] = model.operation_counts[kernel]["total"]
    assert np.isfinite(result).all()


@pytest.mark.parametrize("kernel", ["residual", "outputs"])
def test_kernel_in_loop(benchmark, model, kernel):
    """1001 calls of a kernel in a compiled loop."""
    benchmark.group = "kernels, 1001 calls in a compiled loop"
    trajectory = model.simulate(sine_travel)
    run = {"residual": model.residual_at, "outputs": model.outputs_at}[kernel]
    result = benchmark(run, trajectory.coordinates, trajectory.inputs)
    benchmark.extra_info["operations"] = model.operation_counts[kernel]["total"]
    assert np.isfinite(result).all()


@pytest.mark.parametrize(("solver", "tolerance"), [("newton", 1e-12), ("newton_lanes", 1e-6)])
def test_full_order(benchmark, model, solver, tolerance):
    """The nominal run of 1001 time points."""
    benchmark.group = "full order, 1001 time points"
    inputs = sine_travel.at(sine_travel.times)
    trajectory = benchmark(model.solve_path, sine_travel.times, inputs, solver, tolerance)
    benchmark.extra_info |= trajectory.counts
    assert np.abs(model.residual_at(trajectory.coordinates, inputs)).max() < 1e-6


@pytest.mark.parametrize("label", METHODS)
def test_method(benchmark, model, label):
    """The nominal run of 1001 time points with a reduced model, fitted beforehand."""
    benchmark.group = "methods, 1001 time points"
    name, preset, chosen = METHODS[label]
    method = component("method", name)
    settings = validated(method, model.kind, chosen, preset)
    start = model.starts[0]
    reduced = method.fit(model, [TrainingRun(model, sine_travel, start)], settings)
    trajectory = benchmark(reduced.simulate, sine_travel, start)
    benchmark.extra_info |= trajectory.counts
    benchmark.extra_info["offline_seconds"] = reduced.offline.seconds
    full = model.simulate(sine_travel)
    assert np.abs(trajectory.coordinates - full.coordinates).max() < 1e-3


def test_small_study(benchmark, tmp_path):
    """Cells of figures 6 and 7, computed, stored and combined; a fresh folder each time."""
    benchmark.group = "study"
    folders = (tmp_path / str(number) for number in range(100))

    def fresh():
        return ("figures-6-7", next(folders)), {}

    results = benchmark.pedantic(run_studies, setup=fresh, rounds=3)
    assert (results["figures-6-7"]["status"] == "ok").all()
