"""CasADi: CVODES with a sparse analytic Jacobian, by its virtual machine and by generated C."""

import tempfile
from functools import cache, partial
from typing import Any

import casadi as ca
import numpy as np
from clock import Case, Curve, decades, library, pulse, smooth_parts

import vehiclemor as vm


@cache
def rates(name: str, compiled: bool) -> ca.Function:
    """f(z, u) of states in their error scale, since CVODES takes one absolute tolerance here."""
    model = vm.model(name)
    scale, values = model.error_scale, model.parameter_values
    z, u = ca.SX.sym("z", len(scale)), ca.SX.sym("u", len(model.inputs))
    dx = vm.export(model, "casadi")(z * scale, u, values)[0]
    function = ca.Function("rates", [z, u], [dx / scale], ["z", "u"], ["dz"])
    return translated(function) if compiled else function


def translated(function: ca.Function) -> ca.Function:
    """The function and its Jacobian in C, by the compiler of this machine."""
    with tempfile.TemporaryDirectory() as folder:
        generator = ca.CodeGenerator("peer.c")
        generator.add(function)
        generator.add(function.jacobian())
        generator.generate(f"{folder}/")
        return ca.external("rates", library(folder, "-O2", f"{folder}/peer.c"))


def run(case: Case) -> dict[str, Curve]:
    """Runs that deliver the states."""
    scale, rest = case.model.error_scale, np.zeros(len(case.model.inputs))

    def make(tolerance: float, compiled: bool) -> Any:
        function = rates(case.model.name, compiled)
        # Compiled functions are called; the virtual machine is faster over one flat list.
        kind = ca.MX if compiled else ca.SX
        t, z, size = kind.sym("t"), kind.sym("z", len(scale)), kind.sym("size")
        steered = ca.vertcat(*pulse(t, ca, case.racked, size))
        how = {"reltol": tolerance, "abstol": tolerance, "max_num_steps": 100_000}
        (times, spans), parts = smooth_parts(case.maneuver), {}
        for first, last, moves in spans:
            ode = {"t": t, "x": z, "p": size, "ode": function(z, steered if moves else rest)}
            grid = times[first : last + 1]
            parts[grid[0]] = ca.integrator("part", "cvodes", ode, grid[0], grid[1:], how)

        def part(state: np.ndarray, times: np.ndarray, _: bool) -> np.ndarray:
            found = parts[times[0]](x0=state / scale, p=1.0)["xf"].full().T * scale
            return np.vstack([state, found])

        return lambda: case.by_parts(part)

    read, tight = (lambda states: states[:, case.lateral]), (1e-2, 1e-9)
    return {
        "CasADi CVODES": Curve(partial(make, compiled=False), decades(*tight, 2), read),
        "CasADi CVODES, C code": Curve(partial(make, compiled=True), decades(*tight, 4), read),
    }


def steps(case: Case) -> dict[str, Curve]:
    """Integrators over 10 ms: CVODES, and Runge-Kutta of order 4 by its length of steps."""
    scale, function = case.model.error_scale, rates(case.model.name, compiled=True)
    z, u = ca.MX.sym("z", len(scale)), ca.MX.sym("u", len(case.model.inputs))
    ode, start = {"x": z, "p": u, "ode": function(z, u)}, case.start / scale

    def make(tolerance: float, method: str) -> Any:
        how: dict[str, Any] = {"reltol": tolerance, "abstol": tolerance}
        if method == "rk":
            how = {"number_of_finite_elements": round(0.01 / tolerance)}
        advance = ca.integrator("step", method, ode, 0.0, 0.01, how)
        return lambda: case.loop(lambda x, u, _: advance(x0=x, p=u)["xf"], start, case.more)

    cvodes, runge_kutta = partial(make, method="cvodes"), partial(make, method="rk")
    read = lambda found: found * scale[case.lateral]  # noqa: E731
    lengths = [0.01 / count for count in (4, 6, 8, 10, 14, 20, 40)]
    return {
        "CasADi CVODES, C code": Curve(cvodes, decades(1e-2, 1e-8, 2), read),
        "CasADi Runge-Kutta 4, C code": Curve(runge_kutta, lengths, read),
    }


def closures(case: Case) -> tuple[ca.SX, ca.SX, list[ca.SX], list[ca.SX]]:
    """Unknowns, inputs, residual and outputs of the double wishbone, written anew from its points.

    The unknowns are those of the model, in their order, so that iterations start alike.
    """
    points = {k: ca.DM(np.array(v)) for k, v in case.model.parameters.values().items()}
    q, u = ca.SX.sym("q", 8), ca.SX.sym("u", 2)

    def turned(arm: str, angle: ca.SX, place: ca.DM) -> ca.SX:
        rear = points[f"{arm}_arm_rear_pivot"]
        axis, lever = points[f"{arm}_arm_front_pivot"] - rear, place - rear
        axis /= ca.norm_2(axis)
        along = axis * ca.dot(axis, lever)
        across = ca.cross(axis, lever)
        return rear + along + ca.cos(angle) * (lever - along) + ca.sin(angle) * across

    def rotation(axis: int, angle: ca.SX) -> ca.SX:
        found, (i, j) = ca.SX.eye(3), ((axis + 1) % 3, (axis + 2) % 3)
        found[i, i] = found[j, j] = ca.cos(angle)
        found[j, i], found[i, j] = ca.sin(angle), -ca.sin(angle)
        return found

    carrier = rotation(2, q[0]) @ rotation(1, q[1]) @ rotation(0, q[2])
    ball = points["upper_ball_joint"]
    upper = turned("upper", q[3], ball)
    carried = {k: upper + carrier @ (p - ball) for k, p in points.items()}
    inner, rod = points["tie_rod_inner"], points["tie_rod_outer"] - points["tie_rod_inner"]
    direction = rotation(2, q[5]) @ rotation(0, q[6]) @ ca.DM([0.0, 1.0, 0.0])
    end = inner + ca.vertcat(0.0, q[7], 0.0) + direction * ca.norm_2(rod)
    arm = turned("lower", q[4], points["lower_ball_joint"])
    centre = carried["wheel_centre"] - points["wheel_centre"]
    closed = [carried["lower_ball_joint"] - arm, carried["tie_rod_outer"] - end]
    axle = carrier[:, 1]
    angles = [ca.atan2(-axle[0], axle[1]), ca.asin(axle[2])]
    return q, u, [*closed, centre[2] - u[0], q[7] - u[1]], [centre[:2], q[1], *angles, q[7]]


def mechanism(case: Case) -> dict[str, Curve]:
    """Newton's method at each sample from the one before, all in one call."""
    inputs = case.maneuver.at(case.maneuver.times).T

    def make(tolerance: float) -> Any:
        q, u, residual, outputs = closures(case)
        problem = ca.Function("closed", [q, u], [ca.vertcat(*residual)])
        solved = ca.rootfinder("solved", "fast_newton", problem, {"abstol": tolerance})
        path = solved.mapaccum(inputs.shape[1])
        read = ca.Function("read", [q, u], [ca.vertcat(*outputs)]).map(inputs.shape[1])
        return lambda: read(path(case.model.start(), inputs), inputs).full().T

    return {"CasADi Newton": Curve(make, decades(1e-4, 1e-13, 1), delivers="outputs")}
