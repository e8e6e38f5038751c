"""The multi-body vehicle of CommonRoad by SciPy's `odeint`: another vehicle, for scale."""

from collections.abc import Callable

import numpy as np
from scipy.integrate import odeint
from vehiclemodels.init_mb import init_mb
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb

SECONDS = 2.0


def context() -> dict[str, tuple[Callable[[], object], float, str]]:
    """Label -> call, simulated seconds, and what it is."""
    parameters = parameters_vehicle2()
    start = init_mb([0.0, 0.0, 0.0, 20.0, 0.0, 0.0, 0.0], parameters)
    times = np.linspace(0.0, SECONDS, 101)

    def motion(x: np.ndarray, t: float) -> list[float]:
        rate = 0.02 * np.cos(2.0 * np.pi * t)
        return vehicle_dynamics_mb(x, [rate, 0.0], parameters)

    what = "multi-body car of 29 states in Python, steered, odeint with its own tolerances"
    return {"CommonRoad multi-body": (lambda: odeint(motion, start, times), SECONDS, what)}
