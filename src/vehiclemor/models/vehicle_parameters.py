"""Parameters that the vehicles share, with their units and bounds."""

from vehiclemor.parameters import Declared

GRAVITY = Declared("m/s^2", above=0.0, at_most=100.0)
LENGTH = Declared("m", above=0.0, at_most=20.0)
MASS = Declared("kg", above=0.0, at_most=1e5)
INERTIA = Declared("kg m^2", above=0.0, at_most=1e6)
STIFFNESS = Declared("N/m", above=0.0)
DAMPING = Declared("N s/m", at_least=0.0)
# Below it slip is regularised.
SLIP_SPEED = Declared("m/s", above=0.0, at_most=10.0)
TIRE = {"tire_radius": LENGTH, "tire_stiffness": STIFFNESS, "tire_damping": DAMPING}
# How the start `dropped` differs from straight running.
DROP = {
    "drop_height": Declared("m", at_least=-0.05, at_most=1.0),
    "drop_pitch": Declared("rad", at_least=-0.5, at_most=0.5),
}


def initial_speed(slowest: float) -> Declared:
    """Speed in m/s from which a vehicle starts."""
    return Declared("m/s", at_least=slowest, at_most=150.0)
