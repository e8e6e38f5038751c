"""Hard points of a suspension for toe and camber over wheel travel.

The sedan's suspension steers its wheels by 6 degrees between 80 mm of bump and of rebound.  Six
coordinates of its joints may move by 10 mm: the wheel shall keep its direction, so that a rough
road does not steer the car, and lean by 0.35 rad for a metre of travel, so that the outer wheel
stands more upright when the body rolls.  Nonlinear least squares by SciPy.
"""

import time

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

import vehiclemor as vm
from vehiclemor.online.rom import ReducedOrderModel as Car

MODEL = "double_wishbone"
DESIGN = (
    "tie_rod_inner.y",
    "tie_rod_inner.z",
    "tie_rod_outer.z",
    "upper_arm_front_pivot.z",
    "upper_arm_rear_pivot.z",
    "upper_ball_joint.z",
)
# In m: largest change of a coordinate, travel to both sides, step of differences.
LARGEST, TRAVEL, STEP = 0.01, 0.08, 1e-5
# Targets of toe and camber in rad for a metre of travel.
TARGETS = np.array([0.0, 0.35])


def travel() -> vm.Signal:
    """The wheel goes from full rebound to full bump within a second."""
    return vm.Signal.from_samples([0.0, 1.0], [-TRAVEL, TRAVEL], inputs="z")


class Designer:
    """Toe and camber beside their targets as functions of the design, and what they have cost.

    Parameters
    ----------
    car
        A suspension made by `vm.reduce`, full or reduced.
    exact
        Whether derivatives are those of the equations; otherwise they are differences.
    """

    def __init__(self, car: Car, exact: bool = False) -> None:
        self.car, self.exact, self.signal, self.cars = car, exact, travel(), 0
        values = vm.model(MODEL).parameters.values()
        points = [name.split(".") for name in DESIGN]
        self.today = np.array([values[point]["xyz".index(axis)] for point, axis in points])
        self.columns = [car.output_names.index(name) for name in ("toe", "camber")]

    def made(self, change: np.ndarray) -> Car:
        """The suspension of a design, given by changes (6,) in m."""
        self.cars += 1
        values = (self.today + change).tolist()
        return self.car.for_parameters(dict(zip(DESIGN, values, strict=True)))

    def off(self, change: np.ndarray) -> np.ndarray:
        """How far toe and camber (2 samples,) are from their targets, in rad."""
        run = self.made(change).simulate(self.signal)
        return (run.outputs[:, self.columns] - run.inputs[:, :1] * TARGETS).T.ravel()

    def slopes(self, change: np.ndarray) -> np.ndarray:
        """Their derivatives (2 samples, 6) by the design."""
        if not self.exact:
            steps = STEP * np.eye(len(change))
            sides = [self.off(change + h) - self.off(change - h) for h in steps]
            return np.transpose(sides) / (2.0 * STEP)
        run = vm.sensitivities(self.made(change), self.signal, parameters=DESIGN)
        moved = run["d_output"].sel(output=["toe", "camber"])
        return moved.transpose("output", "time", "parameter").values.reshape(-1, len(DESIGN))


def designed(designer: Designer) -> OptimizeResult:
    """The best changes within the bounds."""
    return least_squares(
        designer.off,
        np.zeros(len(DESIGN)),
        designer.slopes,  # type: ignore[arg-type]
        bounds=(-LARGEST, LARGEST),
        x_scale=LARGEST,
        ftol=1e-8,
        xtol=1e-8,
    )


def designers() -> dict[str, Designer]:
    """The suspension in full order, with both kinds of derivatives, and its path map."""
    full = vm.reduce(MODEL, "full_order")
    mapped = vm.reduce(MODEL, "path_map", training=[travel()], degree=8, cells=1)
    return {
        "full order, differences": Designer(full),
        "full order, exact derivatives": Designer(full, exact=True),
        "path map, differences": Designer(mapped),
    }


def main() -> None:
    """Print the designs."""
    for name, designer in designers().items():
        began = time.process_time()
        found, spent = designed(designer), time.process_time() - began
        off = found.fun.reshape(2, -1)
        print(f"{name}: {designer.cars} suspensions, {1e3 * spent:.0f} ms")
        print(
            f"  off by {np.abs(off[0]).max():.2e} rad of toe, {np.abs(off[1]).max():.2e} of camber"
        )
        print("  " + ", ".join(f"{n} {1e3 * x:+.3f}" for n, x in zip(DESIGN, found.x, strict=True)))


if __name__ == "__main__":
    main()
