"""What reduction is worth in design: hard points of a suspension, and whose doing a car's roll is.

Hard points: six coordinates of the double wishbone may move by 10 mm, so that the wheel keeps its
direction over its travel and leans by 0.35 rad for a metre.  Nonlinear least squares by SciPy, in
full order and by a path map that is made anew for each design, over one history of travel and over
sixteen: from about as many on the map pays.  Making the model of a design, 4 ms, is counted in
neither.  Sobol indices of first order: how much of the variance of a car's peak roll and peak yaw
rate in a lane change each of four parameters has alone, if each may differ by a tenth.
"""

import time
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import sobol_indices, uniform

import vehiclemor as vm

SUSPENSION, CAR = "double_wishbone", "independent_suspension_vehicle"
POINTS = (
    *("tie_rod_inner.y", "tie_rod_inner.z", "tie_rod_outer.z"),
    *("upper_arm_front_pivot.z", "upper_arm_rear_pivot.z", "upper_ball_joint.z"),
)
# In m: largest change of a coordinate and step of differences.  Toe and camber in rad for a metre.
LARGEST, STEP, TARGETS = 0.01, 1e-5, np.array([0.0, 0.35])
BOX = ("front_stiffness", "rear_stiffness", "sprung_mass", "sprung_height")


def histories(number: int) -> list[vm.Signal]:
    """Bumps and rebounds for 4 s, the first with the largest travel of 80 mm."""
    times, sizes = np.linspace(0.0, 4.0, 81), np.linspace(0.08, 0.04, number)
    waves = np.sin(np.pi * times) * sizes[:, None]
    return [vm.Signal.from_samples(times, wave, "cubic", inputs="z") for wave in waves]


class Designer:
    """Toe and camber beside their targets as a function of the design, and what it has cost."""

    def __init__(self, method: str, number: int) -> None:
        self.method, self.signals, self.made, self.seconds = method, histories(number), 0, 0.0
        model = vm.model(SUSPENSION)
        parts, values = [name.split(".") for name in POINTS], model.parameters.values()
        self.today = np.array([values[point]["xyz".index(axis)] for point, axis in parts])
        self.columns = [model.outputs.index(name) for name in ("toe", "camber")]
        self.how = {"training": self.signals[:1], "degree": 8, "cells": 1}
        if method == "full_order":
            self.how = {}

    def off(self, change: np.ndarray) -> np.ndarray:
        """How far toe and camber (2 samples of all histories,) are from their targets, in rad."""
        moved = dict(zip(POINTS, (self.today + change).tolist(), strict=True))
        model, began = vm.model(SUSPENSION, parameters=moved), time.thread_time()
        reduced = vm.reduce(model, self.method, **self.how)
        runs = [reduced.simulate(signal) for signal in self.signals]
        self.made, self.seconds = self.made + 1, self.seconds + time.thread_time() - began
        off = [run.outputs[:, self.columns] - run.inputs[:, :1] * TARGETS for run in runs]
        return np.concatenate(off).T.ravel()

    def slopes(self, change: np.ndarray) -> np.ndarray:
        """Their derivatives by the design, by central differences."""
        sides = [self.off(change + h) - self.off(change - h) for h in STEP * np.eye(len(POINTS))]
        return np.transpose(sides) / (2.0 * STEP)


def hard_points(method: str, number: int) -> np.ndarray:
    """Print and return the best changes; seconds are those of reduction and runs."""
    own, today = Designer(method, number), np.zeros(len(POINTS))
    how: Any = {"jac": own.slopes, "bounds": (-LARGEST, LARGEST), "x_scale": LARGEST}
    found = least_squares(own.off, today, **how)
    toe, camber = np.abs(found.fun.reshape(2, -1)).max(axis=1)
    print(f"{method}, {number} histories: {own.made} designs, {own.seconds:.3f} s, off by", end=" ")
    print(f"{toe:.4f} rad of toe, {camber:.4f} of camber:", np.round(1e3 * found.x, 3), "mm")
    return found.x


def whose_doing(number: int = 256) -> None:
    """Print indices of first order."""
    car = vm.model(CAR)
    values = [car.parameters.values()[name] for name in BOX]

    def peaks(parameters: np.ndarray) -> np.ndarray:
        sets: dict[str, np.ndarray] = dict(zip(BOX, parameters, strict=True))
        signals = [vm.maneuver("lane_change")] * parameters.shape[1]
        runs = vm.simulate_many(car, signals, parameters=sets, outputs=["roll", "yaw_rate"])
        return np.abs(runs["values"].transpose("output", "run", "time").values).max(axis=2)

    began, spread = time.process_time(), [uniform(0.9 * v, 0.2 * v) for v in values]
    found = sobol_indices(func=peaks, n=number, dists=spread, rng=np.random.default_rng(0))
    print(f"{number * (len(BOX) + 2)} cars: {time.process_time() - began:.1f} s")
    for name, row in zip(("roll", "yaw rate"), found.first_order, strict=True):
        print(f"  peak {name}:", dict(zip(BOX, np.round(row, 2).tolist(), strict=True)))


if __name__ == "__main__":
    for count in (1, 16):
        for way in ("full_order", "path_map"):
            hard_points(way, count)
    whose_doing()
