"""Co-simulation: a steering column that SciPy integrates, and a car model that is stepped.

    python examples/steering_cosimulation.py

The two exchange at a communication step: the column tells the steering angle, the car tells how its
front tires turn the column back.  Between two exchanges the column extrapolates this torque, so the
error of the coupling falls with the square of the communication step.
"""

import numpy as np
from scipy.integrate import solve_ivp

# Of the column, seen at the wheels: inertia (kg m^2), damping (N m s/rad), and the trail (m) at
# which the tires' side force turns it back.
INERTIA, DAMPING, TRAIL = 5.0, 190.0, 0.03
FRONT = ("Fy_FL", "Fy_FR")


def hand(t: float) -> float:
    """Torque of the hands (N m): to the left, to the right, and off."""
    return 120.0 * np.sin(np.pi * t) ** 3 if t < 2.0 else 0.0


def column(t: float, y: np.ndarray, aligning: np.ndarray) -> list[float]:
    """Rates of angle and speed; the aligning torque is a straight line in time."""
    torque = hand(t) - np.polyval(aligning, t) - DAMPING * y[1]
    return [y[1], torque / INERTIA]


def drive(car, communication_step: float, duration: float = 4.0) -> np.ndarray:
    """Outputs (samples, outputs) of the car, and behind them the steering angle."""
    front = [car.output_names.index(name) for name in FRONT]
    state, turned, before = car.state(), np.zeros(2), 0.0
    rows = [np.append(car.outputs(state, turned[:1]), 0.0)]
    for k in range(round(duration / communication_step)):
        t, now = k * communication_step, TRAIL * rows[-1][front].sum()
        slope = (now - before) / communication_step
        aligning = np.array([slope, now - slope * t])
        span = (t, t + communication_step)
        solved = solve_ivp(column, span, turned, args=(aligning,), rtol=1e-8, atol=1e-10).y[:, -1]
        state = car.step(state, turned[:1], communication_step, next_inputs=solved[:1])
        turned, before = solved, now
        rows.append(np.append(car.outputs(state, turned[:1]), turned[0]))
    return np.array(rows)
