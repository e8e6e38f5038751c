"""Co-simulation: a steering column that SciPy integrates, and a car model that is stepped.

The two exchange at a communication step: the column tells the steering angle, the car tells how its
front tires turn the column back.  Between two exchanges the column extrapolates this torque, so the
error of the coupling falls with the square of the communication step.
"""

import numpy as np
from scipy.integrate import solve_ivp

import vehiclemor as vm
from vehiclemor.reduction.reduced_model import ReducedOrderModel as Car

# Of the column, seen at the wheels: inertia (kg m^2), damping (N m s/rad), and the trail (m) at
# which the tires' side force turns it back.
INERTIA, DAMPING, TRAIL = 5.0, 190.0, 0.03
FRONT = ("Fy_FL", "Fy_FR")


def hand(t: float) -> float:
    """Torque of the hands (N m): to the left, to the right, and off."""
    return 80.0 * np.sin(np.pi * t) ** 3 if t < 2.0 else 0.0


def column(t: float, y: np.ndarray, aligning: np.ndarray) -> list[float]:
    """Rates of angle and speed; the aligning torque is a straight line in time."""
    torque = hand(t) - np.polyval(aligning, t) - DAMPING * y[1]
    return [y[1], torque / INERTIA]


def drive(car: Car, communication_step: float, duration: float = 3.0) -> np.ndarray:
    """Outputs (samples, outputs) of the car, and behind them the steering angle."""
    front = [car.output_names.index(name) for name in FRONT]
    state, turned, before = car.state(), np.zeros(2), 0.0
    rows = [np.append(car.outputs(state, turned[:1]), 0.0)]
    for k in range(round(duration / communication_step)):
        t, now = k * communication_step, TRAIL * rows[-1][front].sum()
        slope = (now - before) / communication_step
        aligning = np.array([slope, now - slope * t])
        span = (t, t + communication_step)
        solved = solve_ivp(column, span, turned, args=(aligning,), rtol=1e-7, atol=1e-9).y[:, -1]
        state = car.step(state, turned[:1], communication_step, next_inputs=solved[:1])
        turned, before = solved, now
        rows.append(np.append(car.outputs(state, turned[:1]), turned[0]))
    return np.array(rows)


def main() -> None:
    """Print the coupling's error by communication step, and how far the reduced car is off."""
    reduced = vm.rom("independent_suspension_vehicle")
    full = vm.reduce(reduced.model, "full_order")
    column, finest = full.output_names.index("lateral_position"), 2.5e-3
    finely = drive(full, finest)
    for step in (0.02, 0.01, 0.005):
        off = np.abs(drive(full, step) - finely[:: round(step / finest)]).max(axis=0)
        print(f"every {1e3 * step:.0f} ms: {off[column]:.1e} m, {off[-1]:.1e} rad of steering")
    off = np.abs(drive(reduced, 0.01) - drive(full, 0.01)).max(axis=0)
    print(f"the reduced car, every 10 ms: {off[column]:.1e} m, {off[-1]:.1e} rad of steering")


if __name__ == "__main__":
    main()
