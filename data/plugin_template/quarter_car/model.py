"""A quarter car: body and wheel, one above the other, over a road.

Heights are measured from equilibrium, so that weight and static load cancel.
"""

from pathlib import Path

import numpy as np
import sympy as sp

from vehiclemor.plugin import Declared, ModelDefinition, Quantity, Tape, assemble

# Name -> unit and bounds.  Values, with their sources, stand in parameters.toml.
MASS = Declared("kg", above=0.0, at_most=1e5)
STIFFNESS = Declared("N/m", above=0.0, at_most=1e9)
PARAMETERS = {
    "sprung_mass": MASS,
    "unsprung_mass": MASS,
    "stiffness": STIFFNESS,
    "damping": Declared("N s/m", at_least=0.0, at_most=1e8),
    "tire_stiffness": STIFFNESS,
    "drop_height": Declared("m", above=0.0, at_most=1.0),
}


def derive():
    """Equations of motion, called once: from then on the compiled kernels come from the cache."""
    # A state x is the coordinates and then as many speeds; u are the inputs, p the parameters, all
    # in the order in which they are declared.
    z_s, z_u, v_s, v_u = x = sp.symbols("z_s z_u v_s v_u", real=True)
    (road,) = u = sp.symbols("road,", real=True)
    m_s, m_u, k, c, k_t, _ = p = sp.symbols([f"p_{name}" for name in PARAMETERS], real=True)
    # What is used twice is named on a tape, so that it is computed once.
    tape = Tape()
    strut = tape.let(k * (z_u - z_s) + c * (v_u - v_s))
    tire = tape.let(k_t * (road - z_u))
    body, wheel = tape.let(strut / m_s), tape.let((tire - strut) / m_u)
    # Name -> results, row by row, and their shape.  Without the last two the model runs too, but
    # isn't reduced in its coordinates.
    functions = {
        "derivative": ([v_s, v_u, body, wheel], (4,)),
        "outputs": ([body, z_u - z_s, tire], (3,)),
        # M and F of M q'' = F, side by side.
        "second_order": ([m_s, 0, strut, 0, m_u, tire - strut], (2, 3)),
        # Speeds, where x holds the rates of the coordinates instead.
        "speeds": ([v_s, v_u], (2,)),
    }
    return assemble(tape, {"x": x, "u": u}, p, functions)


def starts(values):
    """Initial states by name, the default first."""
    return {
        "equilibrium": np.zeros(4),
        "dropped": values["drop_height"] * np.array([1.0, 1.0, 0.0, 0.0]),
    }


DEFINITION = ModelDefinition(
    name="quarter_car",
    # Ordinary differential equations; dae: with constraints; ae: a mechanism without masses.
    kind="ode",
    summary="quarter car, 2 degrees of freedom",
    maneuver="quarter_car_road",
    # Name, unit, meaning.
    coordinates=(Quantity("z_s", "m", "body height"), Quantity("z_u", "m", "wheel height")),
    speeds=(Quantity("v_s", "m/s", "body speed"), Quantity("v_u", "m/s", "wheel speed")),
    inputs=(Quantity("road", "m", "height of the road"),),
    outputs=(
        Quantity("body_acceleration", "m/s^2", "vertical acceleration of the body"),
        Quantity("suspension_travel", "m", "travel of the wheel, compression positive"),
        Quantity("tire_force", "N", "vertical force on the tire beyond its static load"),
    ),
    parameters=PARAMETERS,
    parameter_file=Path(__file__).with_name("parameters.toml"),
    derive=derive,
    starts=starts,
)
