"""Plug-in model of three decoupled equations with known solutions, to try the integrators on.

A driven pendulum (nonlinear), the problem of Prothero and Robinson (stiff where `rate` is large),
and z' = growth z^2, which blows up at 1 / (growth z(0)).
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import sympy as sp

from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.multibody.quantities import Quantity
from vehiclemor.parameters import Declared
from vehiclemor.symbolic.program import Program, assemble
from vehiclemor.symbolic.tape import Tape

NAME = "standard_problems"
PARAMETERS = {name: Declared("1") for name in ("rate", "growth", "angle", "tracked", "exploding")}
ANGLE, TRACKED, ANGULAR_SPEED, EXPLODING = range(4)


def quantities(*names: str) -> tuple[Quantity, ...]:
    return tuple(Quantity(name, "1", name) for name in names)


COORDINATES, SPEEDS = quantities("angle", "tracked"), quantities("angular_speed", "exploding")
INPUTS = quantities("torque", "target", "target_rate")
ARCTANGENTS = quantities(*(f"arctangent_{state.name}" for state in (*COORDINATES, *SPEEDS)))
OUTPUTS = (*COORDINATES, *SPEEDS, *ARCTANGENTS)


def starts(p: Mapping[str, float]) -> dict[str, np.ndarray]:
    return {"only": np.array([p["angle"], p["tracked"], 0.0, p["exploding"]])}


def derive() -> Program:
    x = sp.symbols("angle tracked angular_speed exploding", real=True)
    torque, target, target_rate = u = sp.symbols("torque target target_rate", real=True)
    p = {name: sp.Symbol(f"p_{name}", real=True) for name in PARAMETERS}
    tape = Tape()
    derivative = [
        x[ANGULAR_SPEED],
        p["rate"] * (target - x[TRACKED]) + target_rate,
        torque - tape.let(sp.sin(x[ANGLE])),
        p["growth"] * x[EXPLODING] ** 2,
    ]
    zeros = [sp.Integer(0)] * 6
    functions = {
        "derivative": (derivative, (4,)),
        # Arctangents, so that the kernels contain the batch that evaluates them.
        "outputs": ([*x, *(tape.let(sp.atan(state)) for state in x)], (8,)),
        "second_order": (zeros, (2, 3)),
        "speeds": (list(x[2:]), (2,)),
    }
    return assemble(tape, {"x": x, "u": u}, list(p.values()), functions)


DEFINITION = ModelDefinition(
    name=NAME,
    kind="ode",
    summary="problems with known solutions",
    maneuver="straight_ahead",
    coordinates=COORDINATES,
    speeds=SPEEDS,
    inputs=INPUTS,
    outputs=OUTPUTS,
    parameters=PARAMETERS,
    parameter_file=Path(__file__).with_suffix(".toml"),
    derive=derive,
    starts=starts,
)


def driven(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
    """Inputs for which angle and tracked value are cos t."""
    del frequency, amplitude
    c, s = np.cos(times), np.sin(times)
    return np.column_stack([np.sin(c) - c, c, -s])


def maneuver(signal, duration: float, corners: tuple[float, ...] = ()) -> Maneuver:
    names = ("torque", "target", "target_rate")
    return Maneuver("test", "", signal, names, duration, 11, lambda _: corners)
