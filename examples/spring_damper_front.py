"""Springs and dampers of a car for a lane change at three speeds: two objectives and their front.

The designer wants little roll, and a yaw rate that is soon at rest when the steering is.  Stiff
springs roll less; how the axles share the stiffness in roll decides how the car swings afterwards.
A point of the front is the least yaw rate that is left with a roll of no more than so much, found
by SLSQP of SciPy.
"""

import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

import vehiclemor as vm
from vehiclemor.online.rom import ReducedOrderModel as Car

MODEL = "independent_suspension_vehicle"
DESIGN = ("front_stiffness", "rear_stiffness", "front_damping", "rear_damping")
# Of each, as a part of today's.
LOWEST, HIGHEST = 0.75, 1.25
# In m/s; the steering is that of the paper's lane change, from 1 to 3.5 s.
SPEEDS = (20.0, 25.0, 30.0)
STEERED, DURATION = 3.5, 6.5
# Largest peak roll in rad at the points of the front.
ROLLS = (0.092, 0.096, 0.1, 0.104, 0.107)
# Of central differences, as a part of today's value; of derivatives that are integrated.
STEP, TOLERANCE = 0.01, 1e-6
PEAK = vm.objective("peak_roll")


class Point(NamedTuple):
    """A point of the front.

    Attributes
    ----------
    roll
        Largest peak roll (rad) that was allowed.
    design
        Parameters as parts of today's (4,).
    values
        Peak roll (rad) and root mean square of the yaw rate after the steering (rad/s), both
        means over the speeds.
    multiplier
        Of the roll: by how much the second objective falls with the first.
    """

    roll: float
    design: np.ndarray
    values: np.ndarray
    multiplier: float


def lane_change() -> vm.Signal:
    """Steering of the package's lane change, as long as it matters here."""
    given = vm.simulate(MODEL)["inputs"].sel(time=slice(0.0, DURATION + 1e-6))
    return vm.Signal.from_samples(given["time"].values, given.values, "cubic")


class Designer:
    """Both objectives of a car as functions of the design, and what they have cost.

    Parameters
    ----------
    car
        Made by `vm.reduce`, full or reduced.
    exact
        Whether derivatives are those of the equations; otherwise they are central differences.
    """

    def __init__(self, car: Car, exact: bool = False) -> None:
        self.car, self.exact, self.signal = car, exact, lane_change()
        own = vm.model(MODEL).parameters.values()
        self.today = np.array([own[name] for name in DESIGN])
        self.starts = [vm.model(MODEL, parameters={"initial_speed": v}).start() for v in SPEEDS]
        self.columns = [car.output_names.index(name) for name in ("roll", "yaw_rate")]
        self.cars = self.runs = self.untrusted = 0
        self.known: dict[bytes, np.ndarray] = {}

    def made(self, design: np.ndarray) -> Car:
        """The car of a design."""
        self.cars += 1
        values = (design * self.today).tolist()
        return self.car.for_parameters(dict(zip(DESIGN, values, strict=True)))

    def values(self, design: np.ndarray) -> np.ndarray:
        """Objectives (2,)."""
        key = design.tobytes()
        if key not in self.known:
            car, found = self.made(design), []
            for start in self.starts:
                run = car.simulate(self.signal, start)
                self.runs, self.untrusted = self.runs + 1, self.untrusted + (run.status != "ok")
                found.append([own for own, _ in measured(run.time, run.outputs[:, self.columns])])
            self.known[key] = np.mean(found, axis=0)
        return self.known[key]

    def slopes(self, design: np.ndarray) -> np.ndarray:
        """Derivatives (2, 4) of the objectives."""
        if not self.exact:
            steps = STEP * np.eye(len(design))
            sides = [self.values(design + h) - self.values(design - h) for h in steps]
            return np.transpose(sides) / (2.0 * STEP)
        car, found = self.made(design), []
        for start in self.starts:
            how = {"parameters": DESIGN, "start": start, "tolerance": TOLERANCE}
            run = vm.sensitivities(car, self.signal, **how)
            self.runs += 1
            seen = run["outputs"].values[:, self.columns], run["d_output"].values
            both = zip(measured(run["time"].values, seen[0]), self.columns, strict=True)
            found.append([weights @ seen[1][:, :, column] for (_, weights), column in both])
        return np.mean(found, axis=0) * self.today


def measured(time: np.ndarray, histories: np.ndarray) -> list[tuple[float, np.ndarray]]:
    """Peak roll and what is left of the yaw rate, each with its weights (samples,).

    Parameters
    ----------
    histories
        Roll and yaw rate (samples, 2).
    """
    peak = PEAK.measured(time, [histories[:, 0]])
    after = np.where(time >= STEERED, histories[:, 1], 0.0)
    size, number = float(np.linalg.norm(after)), np.count_nonzero(time >= STEERED)
    return [(peak.value, peak.weights[0]), (size / number**0.5, after / (size * number**0.5))]


def front(designer: Designer, rolls: Sequence[float] = ROLLS) -> list[Point]:
    """Points of the front; each search begins at the point before, the first at today's car."""
    today = np.ones(len(DESIGN))
    scale, found = designer.values(today)[1], []
    for roll in rolls:
        best = minimize(
            lambda x: designer.values(x)[1] / scale,
            found[-1].design if found else today,
            jac=lambda x: designer.slopes(x)[1] / scale,
            bounds=[(LOWEST, HIGHEST)] * len(DESIGN),
            constraints={
                "type": "ineq",
                "fun": lambda x, roll=roll: 1.0 - designer.values(x)[0] / roll,
                "jac": lambda x, roll=roll: -designer.slopes(x)[0] / roll,
            },
            method="SLSQP",
            options={"ftol": 1e-6, "maxiter": 15},
        )
        found.append(Point(roll, best.x, designer.values(best.x), multiplier(designer, best.x)))
    return found


def multiplier(designer: Designer, design: np.ndarray) -> float:
    """Least-squares multiplier of the roll, by the parameters that are not at a bound."""
    free = (design > LOWEST + 1e-6) & (design < HIGHEST - 1e-6)
    roll, yaw = designer.slopes(design)[:, free]
    return float(-(roll @ yaw) / (roll @ roll)) if free.any() else np.nan


def cars() -> dict[str, Designer]:
    """The car in full order, with both kinds of derivatives."""
    full = vm.reduce(MODEL, "full_order", solver="ros34pw2", tolerance=1e-4)
    return {
        "full order, differences": Designer(full),
        "full order, exact derivatives": Designer(full, exact=True),
    }


def main() -> None:
    """Print the fronts."""
    for name, designer in cars().items():
        began = time.process_time()
        points, spent = front(designer), time.process_time() - began
        print(f"{name}: {designer.cars} cars, {designer.runs} runs, {spent:.1f} s")
        for point in points:
            parts = " ".join(f"{part:.3f}" for part in point.design)
            print(f"  roll {point.values[0]:.4f} rad, left {point.values[1]:.5f} rad/s: {parts}")


if __name__ == "__main__":
    main()
