"""Speed of the 14-DOF vehicle: derivation, kernels, integrators, methods on the 25 s lane change.

Timings are reported, never gated.  Counts and operation counts stand beside them.
"""

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor.inputs.steering import lane_change
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.validation import validated
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.simulation.control_periods import whole_space
from vehiclemor.simulation.integrators.structures import FINISHED
from vehiclemor.simulation.system import Solver
from vehiclemor.symbolic.program import Program

CALLS = 10_000
# Runs of a batch.
BATCH = 1024
FULL = {
    "explicit 1e-6": ("dopri5", 1e-6),
    "explicit 1e-3": ("dopri5", 1e-3),
    "RODAS4 1e-4": ("rodas4", 1e-4),
    "ROS34PW2 2e-3, one Jacobian": ("ros34pw2", 2e-3),
}
METHODS = {
    "pod r=3": ("pod", "recommended", {"rank": 3}),
    "pod state r=3": ("pod", "recommended", {"rank": 3, "formulation": "state"}),
    "pod literal r=3": ("pod", "literal", {"rank": 3}),
    "fixed basis r=3": ("fixed_basis", "recommended", {"rank": 3}),
    "replay": ("replay", "recommended", {}),
}


@pytest.fixture(scope="module")
def model():
    """The model, compiled and parametrised."""
    return build("independent_suspension_vehicle")


@pytest.fixture(scope="module")
def reference(model):
    """Reference trajectory from the equilibrium."""
    return model.simulate(lane_change)


def test_derivation(benchmark):
    """Symbolic derivation with elimination, common subexpressions and hoisting."""
    benchmark.group = "symbolics"
    program = benchmark.pedantic(
        component("model", "independent_suspension_vehicle").derive, rounds=3
    )
    assert isinstance(program, Program)


@pytest.mark.parametrize("start", ["equilibrium", "dropped"])
def test_right_hand_side(benchmark, model, start):
    """State derivatives at 10 000 states in a compiled loop; a thousandth of it is ns a call."""
    benchmark.group = f"right-hand side, {CALLS} calls in a compiled loop"
    states = np.tile(model.start(start), (CALLS, 1))
    inputs = np.full((CALLS, 1), 0.01)
    result = benchmark(model.rhs_at, states, inputs)
    benchmark.extra_info["operations"] = model.operation_counts["derivative"]["total"]
    assert np.isfinite(result).all()


@pytest.mark.parametrize("label", FULL)
def test_full_order(benchmark, model, reference, label):
    """The 25 s lane change from the equilibrium: the compiled loop alone."""
    benchmark.group = "full order, 25 s, compiled loop"
    solver, tolerance = FULL[label]
    run = model.simulate(lane_change, None, None, solver, tolerance)
    whole = whole_space(2 * len(model.coordinates))
    how = Solver(solver, tolerance, lane_change.times)
    space = model.system.workspace(lane_change, whole, how)
    space.start[:] = model.start()

    def whole_run():
        # The loop stops at a number of calls, which its counts add up.
        space.output.counts[:] = 0
        return space.call()

    assert benchmark(whole_run) == FINISHED
    error = np.abs(run.outputs - reference.outputs).max(axis=0)
    lateral, yaw = (model.outputs.index(name) for name in ("lateral_position", "yaw"))
    benchmark.extra_info |= run.counts
    benchmark.extra_info |= {"largest_error_Y": error[lateral], "largest_error_yaw": error[yaw]}
    assert error[lateral] < 0.05
    assert error[yaw] < 3e-4


def delivered(reduced, maneuver, start):
    """A run with all histories, which are made when they are read."""
    run = reduced.simulate(maneuver, start)
    assert run.outputs is not None
    return run


@pytest.mark.parametrize("label", METHODS)
def test_method(benchmark, model, reference, label):
    """The same run with a reduced model, fitted beforehand, outputs and all."""
    benchmark.group = "methods, 25 s, with the outputs"
    name, preset, chosen = METHODS[label]
    method = component("method", name)
    settings = validated(method, model.kind, chosen, preset)
    start = model.starts[0]
    reduced = method.fit(model, [TrainingRun(model, lane_change, start)], settings)
    run = benchmark(delivered, reduced, lane_change, start)
    benchmark.extra_info |= run.counts
    benchmark.extra_info |= {
        "offline_seconds": reduced.offline.seconds,
        "seconds_in_loop": run.seconds,
    }
    assert run.status == "ok"
    assert run.outputs.shape == reference.outputs.shape


@pytest.mark.parametrize("jobs", [1, 2])
@pytest.mark.parametrize("which", ["reduced", "full"])
def test_batch(benchmark, model, which, jobs):
    """Ten-second maneuvers with inputs of their own, three outputs at 10 Hz; all of the call."""
    benchmark.group = f"{BATCH} maneuvers of 10 s, whole call"
    car = vm.rom(model.name)
    if which == "full":
        car = vm.reduce(model, "full_order", solver="ros34pw2", tolerance=2e-3)
    times, rng = np.linspace(0.0, 10.0, 501), np.random.default_rng(1)
    rate = rng.uniform(0.5, 4.0, (BATCH, 1))
    signals = vm.many_signals(times, 0.01 * np.tanh(times) * np.sin(rate * times), "cubic")
    kept = {"outputs": ["lateral_position", "yaw", "Fz_FL"], "times": times[::5]}
    found = benchmark(vm.simulate_many, car, signals, jobs=jobs, **kept)
    benchmark.extra_info["seconds in compiled loops"] = found.seconds.sum().item()
    assert found.status.isin(["ok", "untrusted"]).all()
