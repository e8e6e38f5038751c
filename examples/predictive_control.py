"""A car steers around an obstacle by model-predictive control, its future told by a reduced model.

Ten times in half a second the controller chooses the steering of the next second and a half
(nonlinear least squares by SciPy), from the rates of the reduced model and their analytic
derivatives.  The car that it steers is the full model.
"""

import time

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

import vehiclemor as vm
from vehiclemor.reduction.reduced_model import ReducedOrderModel as Car

MODEL = "independent_suspension_vehicle"
# The steering is held for a period in s; so many periods are looked ahead.
PERIOD, HORIZON = 0.05, 30
# Largest steering angle in rad.
LIMIT = 0.1
# Centre of the obstacle and half axes in m of the ellipse that the car's centre keeps out of.
OBSTACLE, CLEARANCE = np.array([50.0, -0.3]), np.array([9.0, 2.5])
PLACE = ("longitudinal_position", "lateral_position", "yaw")
# Weights of lateral position (1/m), heading (1/rad), depth in the ellipse, steering (1/rad), and
# its change from period to period (1/rad).
ASIDE, ASKEW, INSIDE, STEERED, TURNED = 0.1, 1.0, 30.0, 2.0, 20.0


def predicted(
    car: Car, state: np.ndarray, steering: np.ndarray, steps: int
) -> tuple[np.ndarray, np.ndarray]:
    """States (periods, n) at ends of periods, derivatives (periods, n, periods) by the steering.

    The classical Runge-Kutta method, so many steps in each period, and its own exact derivatives.
    """
    states, slopes = [], []
    h, slope = PERIOD / steps, np.zeros((len(state), len(steering)))
    for k in range(len(steering)):
        u = steering[k : k + 1]
        for _ in range(steps):
            x, dx, mean, dmean = state, slope, 0.0, 0.0
            for weight, part in ((1.0, 0.5), (2.0, 0.5), (2.0, 1.0), (1.0, 0.0)):
                rates, changes = car.rhs(x, u), car.jacobian(x, u) @ dx
                changes[:, k] += car.jacobian(x, u, "inputs")[:, 0]
                mean, dmean = mean + weight / 6.0 * rates, dmean + weight / 6.0 * changes
                x, dx = state + part * h * rates, slope + part * h * changes
            state, slope = state + h * mean, slope + h * dmean
        states.append(state)
        slopes.append(slope)
    return np.array(states), np.array(slopes)


class Controller:
    """Chooses the steering of the next periods; begins with what it chose a period before.

    Fast motion needs short steps: the wheels of the full car four in a period.
    """

    def __init__(self, car: Car, steps: int = 1) -> None:
        self.car, self.steps = car, steps
        self.place = [car.states.index(name) for name in ("X", "Y", "psi")]
        self.steering = np.zeros(HORIZON)

    def costs(
        self, state: np.ndarray, before: float, steering: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """What is squared and added up (costs,), and its derivatives (costs, periods)."""
        states, slopes = predicted(self.car, state, steering, self.steps)
        place, moved = states[:, self.place], slopes[:, self.place]
        off = (place[:, :2] - OBSTACLE) / CLEARANCE
        depth = np.maximum(1.0 - (off**2).sum(axis=1), 0.0)
        inwards = -2.0 * (depth > 0.0)[:, None] * off / CLEARANCE
        change = np.eye(HORIZON) - np.eye(HORIZON, k=-1)
        first = before * np.eye(HORIZON)[0]
        values = [
            ASIDE * place[:, 1],
            ASKEW * place[:, 2],
            INSIDE * depth,
            STEERED * steering,
            TURNED * (change @ steering - first),
        ]
        derivatives = [
            ASIDE * moved[:, 1],
            ASKEW * moved[:, 2],
            INSIDE * (inwards[:, :, None] * moved[:, :2]).sum(axis=1),
            STEERED * np.eye(HORIZON),
            TURNED * change,
        ]
        return np.concatenate(values), np.concatenate(derivatives)

    def plan(self, state: np.ndarray, before: float) -> OptimizeResult:
        """The best steering from a state on, `before` the steering until now."""
        known: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

        def both(steering: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            key = steering.tobytes()
            if key not in known:
                known[key] = self.costs(state, before, steering)
            return known[key]

        guess = np.append(self.steering[1:], self.steering[-1])
        found = least_squares(
            lambda steering: both(steering)[0],
            np.clip(guess, -0.99 * LIMIT, 0.99 * LIMIT),
            lambda steering: both(steering)[1],  # type: ignore[arg-type]
            bounds=(-LIMIT, LIMIT),
            ftol=1e-4,
            xtol=1e-4,
            max_nfev=20,
        )
        self.steering = found.x
        return found


def drive(controller: Controller, plant: Car, duration: float = 5.0) -> dict[str, np.ndarray]:
    """A controller at the wheel of a car: places (samples, 3), steering, costs of the planning."""
    start = plant.model.start()
    state, steering = plant.state(start), np.zeros(1)
    seen = [plant.output_names.index(name) for name in PLACE]
    told: dict[str, list] = {"place": [], "steering": [], "evaluations": [], "ms": []}
    for _ in range(round(duration / PERIOD)):
        told["place"].append(plant.outputs(state, steering)[seen])
        own = controller.car.state(plant.full_state(state, steering), steering)
        began = time.thread_time()
        plan = controller.plan(own, steering.item())
        told["ms"].append(1e3 * (time.thread_time() - began))
        told["evaluations"].append(plan.nfev)
        steering = plan.x[:1]
        told["steering"].append(steering.item())
        state = plant.step(state, steering, PERIOD)
    return {name: np.array(values) for name, values in told.items()}


def clearance(places: np.ndarray) -> float:
    """Smallest distance from the obstacle's centre in half axes of the ellipse; 1 touches it."""
    return float(np.linalg.norm((places[:, :2] - OBSTACLE) / CLEARANCE, axis=1).min())


def main() -> None:
    """Steer the full car and the reduced one by the reduced one, and the full car by itself."""
    reduced, full = vm.rom(MODEL), vm.reduce(MODEL, "full_order")
    runs = {
        "reduced model steers full car": drive(Controller(reduced), full),
        "reduced model steers reduced car": drive(Controller(reduced), reduced),
        "full model steers full car": drive(Controller(full, 4), full),
    }
    first = next(iter(runs.values()))["place"]
    for name, run in runs.items():
        apart = np.abs(run["place"] - first).max(axis=0)
        print(
            f"{name}: {np.median(run['ms']):.1f} ms for a plan of {run['evaluations'].mean():.1f} "
            f"predictions, {clearance(run['place']):.3f} half axes clear; from the first run "
            f"{apart[0]:.3f} m, {apart[1]:.3f} m, {apart[2]:.4f} rad"
        )


if __name__ == "__main__":
    main()
