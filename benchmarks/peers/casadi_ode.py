"""CasADi: CVODES with a sparse analytic Jacobian, by its virtual machine and by generated C."""

import subprocess
import tempfile
from functools import cache, partial
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from clock import COMPILER, Case, Curve, decades, pulse

import vehiclemor as vm

LABELS = {"CasADi CVODES": False, "CasADi CVODES, C code": True}


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
        command = [
            str(COMPILER),
            "-O2",
            "-march=native",
            "-fPIC",
            "-shared",
            "peer.c",
            "-o",
            "peer.so",
        ]
        subprocess.run(command, cwd=folder, check=True)  # noqa: S603
        return ca.external("rates", str(Path(folder, "peer.so")))


def run(case: Case) -> dict[str, Curve]:
    """Runs that deliver the states."""

    def make(tolerance: float, compiled: bool) -> Any:
        function, scale = rates(case.model.name, compiled), case.model.error_scale
        # Compiled functions are called; the virtual machine is faster over one flat list.
        kind = ca.MX if compiled else ca.SX
        t, z, size = kind.sym("t"), kind.sym("z", len(scale)), kind.sym("size")
        steered = ca.vertcat(*pulse(t, ca, len(case.model.inputs) > 1, size))
        # Without a steering wheel that moves, which CasADi can't know.
        rest = np.zeros(len(case.model.inputs))
        how = {"reltol": tolerance, "abstol": tolerance, "max_num_steps": 100_000}
        parts = {}
        for first, last, moves in case.spans():
            ode = {"t": t, "x": z, "p": size, "ode": function(z, steered if moves else rest)}
            grid = case.maneuver.times[first : last + 1]
            parts[grid[0]] = ca.integrator("part", "cvodes", ode, grid[0], grid[1:], how)

        def part(state: np.ndarray, times: np.ndarray, _: bool) -> np.ndarray:
            found = parts[times[0]](x0=state / scale, p=1.0)["xf"].full().T * scale
            return np.vstack([state, found])

        return lambda: case.by_parts(part)

    read = lambda states: states[:, case.lateral]  # noqa: E731
    return {
        label: Curve(partial(make, compiled=compiled), decades(1e-2, 1e-9, 2 + 2 * compiled), read)
        for label, compiled in LABELS.items()
        if COMPILER or not compiled
    }


def steps(case: Case) -> dict[str, Curve]:
    """Integrators over 10 ms: CVODES, and Runge-Kutta of order 4 by its number of steps."""

    def make(tolerance: float, name: str) -> Any:
        function, scale = rates(case.model.name, compiled=True), case.model.error_scale
        z, u = ca.MX.sym("z", len(scale)), ca.MX.sym("u", len(case.model.inputs))
        how: dict[str, Any] = {"reltol": tolerance, "abstol": tolerance}
        if name == "rk":
            how = {"number_of_finite_elements": round(0.01 / tolerance)}
        ode = {"x": z, "p": u, "ode": function(z, u)}
        advance = ca.integrator("step", name, ode, 0.0, 0.01, how)

        def loop() -> np.ndarray:
            state, found = case.start / scale, np.empty(len(case.reference))
            for k, held in enumerate(case.more["held"]):
                state = advance(x0=state, p=held)["xf"]
                found[k] = state[case.lateral] * scale[case.lateral]
            return found

        return loop

    lengths = [0.01 / count for count in (4, 6, 8, 10, 14, 20, 40)]
    return {
        "CasADi CVODES, C code": Curve(
            partial(make, name="cvodes"), decades(1e-2, 1e-6, 2), np.asarray
        ),
        "CasADi Runge-Kutta 4, C code": Curve(partial(make, name="rk"), lengths, np.asarray),
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
        how = {"abstol": tolerance}
        solved = ca.rootfinder("solved", "fast_newton", problem, how)
        path = solved.mapaccum(inputs.shape[1])
        read = ca.Function("read", [q, u], [ca.vertcat(*outputs)]).map(inputs.shape[1])
        return lambda: read(path(case.model.start(), inputs), inputs).full().T

    return {"CasADi Newton": Curve(make, decades(1e-4, 1e-13, 1), np.asarray, "outputs")}
