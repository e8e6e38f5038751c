"""Quarter car: body and wheel over a road (linear ODE); heights are measured from equilibrium."""

from pathlib import Path

import numpy as np
import sympy as sp

from vehiclemor.maneuver import Maneuver
from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.multibody.quantities import Quantity
from vehiclemor.multibody.vehicle_parameters import DAMPING, LENGTH, MASS, STIFFNESS
from vehiclemor.symbolic.program import assemble
from vehiclemor.symbolic.tape import Tape

PARAMETERS = {"sprung_mass": MASS, "unsprung_mass": MASS, "stiffness": STIFFNESS}
PARAMETERS |= {"damping": DAMPING, "tire_stiffness": STIFFNESS, "drop_height": LENGTH}
HEIGHTS = (Quantity("z_s", "m", "body height"), Quantity("z_u", "m", "wheel height"))
SPEEDS = (Quantity("v_s", "m/s", "body speed"), Quantity("v_u", "m/s", "wheel speed"))
ROAD = (Quantity("road", "m", "height of the road"),)
OUTPUTS = (
    Quantity("body_acceleration", "m/s^2", "vertical acceleration of the body"),
    Quantity("suspension_travel", "m", "travel of the wheel, compression positive"),
    Quantity("tire_force", "N", "vertical force on the tire beyond its static load"),
)
QUANTITIES = {"coordinates": HEIGHTS, "speeds": SPEEDS, "inputs": ROAD, "outputs": OUTPUTS}


def derive():
    z_s, z_u, v_s, v_u, road = x_u = sp.symbols("z_s z_u v_s v_u road", real=True)
    m_s, m_u, k, c, k_t, _ = p = sp.symbols([f"p_{name}" for name in PARAMETERS], real=True)
    tape = Tape()
    strut, tire = tape.let(k * (z_u - z_s) + c * (v_u - v_s)), tape.let(k_t * (road - z_u))
    body, wheel = tape.let(strut / m_s), tape.let((tire - strut) / m_u)
    functions = {
        "derivative": ([v_s, v_u, body, wheel], (4,)),
        "outputs": ([body, z_u - z_s, tire], (3,)),
        "second_order": ([m_s, sp.Integer(0), strut, sp.Integer(0), m_u, tire - strut], (2, 3)),
        "speeds": ([v_s, v_u], (2,)),
    }
    return assemble(tape, {"x": x_u[:4], "u": x_u[4:]}, p, functions)


def starts(p):
    return {"equilibrium": np.zeros(4), "dropped": p["drop_height"] * np.array([1.0, 1, 0, 0])}


def sine(times, frequency, amplitude):
    return 0.02 * amplitude * np.sin(2.0 * np.pi * 1.5 * frequency * times)[:, None]


SUMMARY = "road of 0.02 m x sin(2 pi 1.5 Hz t)"
sine_road = Maneuver("sine_road", SUMMARY, sine, ("road",), 5.0, 501, lambda _: ())
MODEL = {"name": "quarter_car", "kind": "ode", "summary": "quarter car, 2 degrees of freedom"}
MODEL |= {"maneuver": "sine_road", "parameter_file": Path(__file__).with_suffix(".toml")}
DEFINITION = ModelDefinition(
    **MODEL, **QUANTITIES, parameters=PARAMETERS, derive=derive, starts=starts
)
