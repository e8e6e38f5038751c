"""Plug-in model of a structure: masses in a chain that stands on a tire and on a hardening spring.

The chain is upright; its lowest mass has the tire, the one above a spring and a damper to the
ground, that move nothing along.  Other dampers, linear ones, are few of the structure's own.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import sympy as sp
from scipy.sparse import csc_array, diags_array

from vehiclemor.multibody.definition import ModelDefinition, Structure
from vehiclemor.multibody.quantities import Quantity
from vehiclemor.parameters import Declared
from vehiclemor.symbolic.program import Program, assemble
from vehiclemor.symbolic.tape import Tape

NAME = "standing_chain"
UNITS = {"stiffness": "N/m", "hardening": "N/m^3", "damping": "N s/m", "tire": "N/m"}
UNITS |= {"chain": "N/m", "rate": "N s/m", "damping_time": "s", "masses": "1", "payload": "kg"}
# Mass of the chain (kg), and gravity.
MASS, GRAVITY = 100.0, 9.81


def derive() -> Program:
    w, tire, rate, tire_rate = x = sp.symbols("w tire rate tire_rate", real=True)
    z, z_dot = u = sp.symbols("z z_dot", real=True)
    p = {name: sp.Symbol(f"p_{name}", real=True) for name in UNITS}
    tape = Tape()
    spring = -p["stiffness"] * w - p["hardening"] * w**3 - p["damping"] * rate
    pressed = tape.let(p["tire"] * (z - tire) + 1e-3 * p["tire"] * (z_dot - tire_rate))
    contact = tape.let(sp.Piecewise((1, pressed > 0), (0, True))) * p["tire"]
    laws = [spring, -p["stiffness"] - 3 * p["hardening"] * w**2, -p["damping"]]
    laws += [contact * pressed / p["tire"], -contact, -1e-3 * contact]
    return assemble(tape, {"x": [*x], "u": [*u]}, list(p.values()), {"port_forces": (laws, (2, 3))})


def structure(values: Mapping[str, float]) -> Structure:
    n = int(values["masses"])
    mass = np.full(n, MASS / n)
    mass[-1] += values["payload"]
    links = diags_array([-np.ones(n - 1), np.ones(n - 1)], offsets=[0, 1], shape=(n - 1, n))
    rates = np.zeros((n, 3))
    rates[-1, 0] = 1.0
    rates[[n // 2, n // 2 + 1, 3, n - 2], [1, 1, 2, 2]] = 1.0, -1.0, -1.0, 1.0
    ports = np.zeros((n, 2))
    ports[[1, 0], [0, 1]] = 1.0
    top = np.zeros((4, n))
    top[0, -1] = 1.0
    forces = np.zeros((4, 2))
    forces[3, 1] = 1.0
    return Structure(
        mass=csc_array(diags_array(mass)),
        stiffness=csc_array(values["chain"] * (n - 1) * links.T @ links),
        damping_time=values["damping_time"],
        dampers=csc_array(np.sqrt(values["rate"]) * rates),
        ports=csc_array(ports),
        load=-GRAVITY * mass,
        outputs=(*(csc_array(np.roll(top, k, axis=0)) for k in range(3)), csc_array(forces)),
    )


def quantities(**units: str) -> tuple[Quantity, ...]:
    return tuple(Quantity(name, unit, name) for name, unit in units.items())


DEFINITION = ModelDefinition(
    name=NAME,
    kind="structural",
    summary="a chain of masses on a tire",
    maneuver="road",
    coordinates=(),
    inputs=quantities(z="m", z_dot="m/s"),
    outputs=quantities(top="m", top_speed="m/s", top_acceleration="m/s^2", Fz_A="N"),
    ports=quantities(spring="m", tire="m"),
    structure=structure,
    online=("payload",),
    parameters={name: Declared(unit) for name, unit in UNITS.items()},
    parameter_file=Path(__file__).with_suffix(".toml"),
    derive=derive,
    validity={"top": (-0.2, 0.2), "z": (-0.3, 0.3)},
    loads=("Fz_A",),
)
