"""Speed of the high-fidelity vehicle: derivation, kernels, integrators, methods, other libraries.

The 10 s lane change.  Timings are reported, never gated; counts and errors stand beside them.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sksundae.cvode import CVODE

from vehiclemor.inputs.polynomials import signal_of
from vehiclemor.inputs.steering import rack_lane_change
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.validation import validated
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.simulation.control_periods import whole_space
from vehiclemor.simulation.integrators.catalogue import rhs_loop
from vehiclemor.simulation.integrators.loop import scratch_end
from vehiclemor.simulation.integrators.structures import FINISHED, Place
from vehiclemor.simulation.system import Solver
from vehiclemor.symbolic.program import Program

CALLS = 10_000
FULL = {
    "explicit 1e-6": ("dopri5", 1e-6),
    "explicit 1e-3": ("dopri5", 1e-3),
    "RODAS4 1e-4": ("rodas4", 1e-4),
    "ROS34PW2 7e-4, one Jacobian": ("ros34pw2", 7e-4),
}
METHODS = {
    "pod r=1": ("pod", "recommended", {"rank": 1}),
    "pod r=3": ("pod", "recommended", {"rank": 3}),
    "pod coordinates r=3": ("pod", "recommended", {"rank": 3, "formulation": "coordinates"}),
    "pod literal r=1": ("pod", "literal", {"rank": 1}),
    "fixed basis r=3": ("fixed_basis", "recommended", {"rank": 3}),
    "replay": ("replay", "recommended", {}),
}
# Kernels whose costs are compared: what solves, and what assembles and leaves the solving to
# others (mass matrix, forces, constraint Jacobian, right side).
KERNELS = ("derivative", "descriptor")
STARTS = ("equilibrium", "dropped")
# Longest step (s) of methods that would step over the pulse.
LONGEST = 0.1


@pytest.fixture(scope="module")
def model():
    """The model, compiled and parametrised."""
    return build("high_fidelity_vehicle")


@pytest.fixture(scope="module")
def references(model):
    """Reference trajectory from each start."""
    return {start: model.simulate(rack_lane_change, start) for start in STARTS}


def report_errors(benchmark, model, outputs, reference):
    """Largest errors of lateral position, lateral and vertical speed beside the time."""
    error = np.abs(outputs - reference.outputs).max(axis=0)
    for name in ("lateral_position", "lateral_speed", "vertical_speed", "position_drift"):
        benchmark.extra_info[f"largest_error_{name}"] = error[model.outputs.index(name)]
    return error


def test_derivation(benchmark):
    """Symbolic derivation with elimination, common subexpressions and hoisting."""
    benchmark.group = "symbolics"
    program = benchmark.pedantic(component("model", "high_fidelity_vehicle").derive, rounds=2)
    assert isinstance(program, Program)


@pytest.mark.parametrize("kernel", KERNELS)
def test_kernel(benchmark, model, kernel):
    """Calls of one kernel from compiled code; a thousandth of it is ns a call."""
    benchmark.group = f"kernels, {CALLS} calls in a compiled loop"
    states = np.tile(model.start("dropped"), (CALLS, 1))
    inputs = np.full((CALLS, 3), 1e-3)
    size = int(np.prod(model.equations.shapes[kernel]))
    result = benchmark(model.system.values_at, kernel, states, inputs, size)
    benchmark.extra_info["operations"] = model.operation_counts[kernel]["total"]
    assert np.isfinite(result).all()


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("label", FULL)
def test_full_order(benchmark, model, references, label, start):
    """The lane change: the compiled loop alone."""
    benchmark.group = f"full order, 10 s, {start}"
    solver, tolerance = FULL[label]
    run = model.simulate(rack_lane_change, start, None, solver, tolerance)
    whole = whole_space(2 * len(model.coordinates))
    how = Solver(solver, tolerance, rack_lane_change.times)
    space = model.system.workspace(rack_lane_change, whole, how)
    space.start[:] = model.start(start)

    def whole_run():
        # The loop stops at a number of calls, which its counts add up.
        space.output.counts[:] = 0
        return space.call()

    assert benchmark(whole_run) == FINISHED
    benchmark.extra_info |= run.counts
    error = report_errors(benchmark, model, run.outputs, references[start])
    assert error[model.outputs.index("lateral_position")] < 0.05
    assert error[model.outputs.index("lateral_speed")] < 0.02


def spans(model):
    """Ends of the smooth spans of the inputs with their output times, and the system on each.

    Every library calls the same compiled function: inputs from their polynomials, then the kernel.
    """
    ready, times = signal_of(rack_lane_change), rack_lane_change.times
    edges, n = ready.bundle.edges, 2 * len(model.coordinates)
    equations, subspaces = model.system.called("full", ""), whole_space(n).subspaces
    loop, buffer = rhs_loop("full"), np.empty(scratch_end(n, len(model.inputs)))
    for segment in range(len(edges) - 1):
        a, b = edges[segment : segment + 2]
        last = b == rack_lane_change.duration
        wanted = times[(times >= a) & ((times <= b) if last else (times < b))]

        def slope(t, x, dx, segment=segment):
            loop(x, equations, ready, subspaces, Place(float(t), segment, 0), buffer, dx)

        yield a, b, wanted, slope


def with_scipy(model, start, method, tolerance):
    """States at the output times by SciPy, restarted at break points; calls of the derivative."""
    x, path, calls = model.start(start), [], 0
    for a, b, wanted, slope in spans(model):

        def derivative(t, x, slope=slope):
            dx = np.empty(len(x))
            slope(t, np.require(x, float, ("C", "A", "W")), dx)
            return dx

        points = np.unique([*wanted, b])
        solution = solve_ivp(
            derivative,
            (a, b),
            x,
            method,
            t_eval=points,
            rtol=tolerance,
            atol=tolerance,
            max_step=LONGEST,
        )
        assert solution.success
        path.append(solution.y.T[: len(wanted)])
        x, calls = np.ascontiguousarray(solution.y[:, -1]), calls + solution.nfev
    return np.concatenate(path), calls


def with_sundials(model, start, method, tolerance):
    """The same by SUNDIALS CVODE; calls for its difference Jacobians are counted too."""
    x, path, calls = model.start(start), [], [0]
    for a, b, wanted, slope in spans(model):

        def derivative(t, x, dx):
            calls[0] += 1
            slope(t, x, dx)  # noqa: B023 - called within this turn of the loop alone

        solver = CVODE(derivative, method=method, rtol=tolerance, atol=tolerance, max_step=LONGEST)
        points = np.unique([a, *wanted, b])
        solution = solver.solve(points, x)
        assert solution.success
        path.append(solution.y[np.isin(points, wanted)])
        x = np.array(solution.y[-1])
    return np.concatenate(path), calls[0]


OTHERS = {
    "SciPy RK45 1e-6": (with_scipy, "RK45", 1e-6),
    "SciPy LSODA 1e-6": (with_scipy, "LSODA", 1e-6),
    "SciPy LSODA 1e-3": (with_scipy, "LSODA", 1e-3),
    "SUNDIALS CVODE BDF 1e-6": (with_sundials, "BDF", 1e-6),
    "SUNDIALS CVODE BDF 3e-5": (with_sundials, "BDF", 3e-5),
}


@pytest.mark.parametrize("label", OTHERS)
def test_other_libraries(benchmark, model, references, label):
    """The same equations and run, called back from Python by other libraries' integrators."""
    benchmark.group = "full order, 10 s, equilibrium"
    integrate, method, tolerance = OTHERS[label]
    states, calls = benchmark.pedantic(
        integrate, (model, "equilibrium", method, tolerance), rounds=3, warmup_rounds=1
    )
    benchmark.extra_info["rhs_calls"] = calls
    reference = references["equilibrium"]
    outputs = model.outputs_at(states, reference.inputs)
    error = report_errors(benchmark, model, outputs, reference)
    assert error[model.outputs.index("lateral_position")] < 0.05


def delivered(reduced, maneuver, start):
    """A run with all histories, which are made when they are read."""
    run = reduced.simulate(maneuver, start)
    assert run.outputs is not None
    return run


@pytest.mark.parametrize("label", METHODS)
def test_method(benchmark, model, references, label):
    """The same run with a reduced model, fitted beforehand, outputs and all."""
    benchmark.group = "methods, 10 s, with the outputs"
    name, preset, chosen = METHODS[label]
    method = component("method", name)
    settings = validated(method, model.kind, chosen, preset)
    start = "equilibrium"
    runs = [TrainingRun(model, rack_lane_change, start)]
    reduced = method.fit(model, runs, settings)
    run = benchmark(delivered, reduced, rack_lane_change, start)
    benchmark.extra_info |= run.counts
    benchmark.extra_info |= {
        "offline_seconds": reduced.offline.seconds,
        "seconds_in_loop": run.seconds,
    }
    assert run.status == "ok"
    assert run.outputs.shape == references[start].outputs.shape
