"""Parameters that the vehicles share."""

import numpy as np

from vehiclemor.exceptions import GeometryError

# Share by which a published moment of inertia may break the triangle inequality.
ROUNDED = 0.01
# How the start `dropped` differs from straight running.
DROP = ("drop_height", "drop_pitch")


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
