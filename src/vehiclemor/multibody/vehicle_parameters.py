"""Parameters that the vehicles share, with their units and bounds."""

import numpy as np

from vehiclemor.exceptions import GeometryError
from vehiclemor.parameters import Declared

GRAVITY = Declared("m/s^2", above=0.0, at_most=100.0)
LENGTH = Declared("m", above=0.0, at_most=20.0)
MASS = Declared("kg", at_least=1e-3, at_most=1e5)
INERTIA = Declared("kg m^2", above=0.0, at_most=1e6)
STIFFNESS = Declared("N/m", above=0.0, at_most=1e9)
DAMPING = Declared("N s/m", at_least=0.0, at_most=1e8)
LOAD = Declared("N", at_least=1.0, at_most=1e7)
# Those of measured tires are below 100.
TIRE_COEFFICIENT = Declared("1", at_least=-1e3, at_most=1e3)
# Below it slip is regularised.
SLIP_SPEED = Declared("m/s", above=0.0, at_most=10.0)
TIRE = {"tire_radius": LENGTH, "tire_stiffness": STIFFNESS, "tire_damping": DAMPING}
# Share by which a published moment of inertia may break the triangle inequality.
ROUNDED = 0.01
# How the start `dropped` differs from straight running.
DROP = {
    "drop_height": Declared("m", at_least=-0.05, at_most=1.0),
    "drop_pitch": Declared("rad", at_least=-0.5, at_most=0.5),
}


def initial_speed(slowest: float) -> Declared:
    """Speed in m/s from which a vehicle starts."""
    return Declared("m/s", at_least=slowest, at_most=150.0)


def check_moments(name: str, moments: np.ndarray) -> None:
    """Raise `GeometryError` if no body has these principal moments of inertia (3,) in kg m^2.

    The largest is at most the sum of the others, but for rounding: published moments of flat and
    thin bodies are rounded.
    """
    smallest, middle, largest = np.sort(moments)
    if smallest <= 0.0 or largest > (smallest + middle) * (1.0 + ROUNDED):
        raise GeometryError(
            f"{name}: no body has the principal moments of inertia {smallest:.4g}, "
            f"{middle:.4g}, {largest:.4g} kg m^2 (the largest is at most the sum of the others)"
        )
