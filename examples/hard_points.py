"""
Hard points by optimisation
===========================

Six coordinates of the suspension may move by 10 mm, so that the wheel keeps its direction over its
travel and leans by 0.35 rad for a metre of travel. SciPy searches; a path map replaces the model.
"""

# %%
# Each design needs a new map. It pays when one design is tried on many travels.
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import least_squares

import vehiclemor as vm

POINTS = ("tie_rod_inner.y", "tie_rod_inner.z", "tie_rod_outer.z")
POINTS += ("upper_arm_front_pivot.z", "upper_arm_rear_pivot.z", "upper_ball_joint.z")
# Largest change of a coordinate and step of the differences in m.
LARGEST, STEP = 0.01, 1e-5
t = np.linspace(0.0, 4.0, 81)
TRAVEL = [
    vm.Signal.from_samples(t, size * np.sin(np.pi * t), "cubic", inputs="z")
    for size in (0.08, 0.04)
]
VALUES = vm.model("double_wishbone").parameters.values()
TODAY = np.array([VALUES[name[:-2]]["xyz".index(name[-1])] for name in POINTS])


# %%
# Differences from the wanted toe and camber, in rad, over all travels.
def runs(change, method):
    moved = dict(zip(POINTS, (TODAY + change).tolist(), strict=True))
    model = vm.model("double_wishbone", parameters=moved)
    how = {} if method == "full_order" else {"training": TRAVEL[:1], "degree": 8, "cells": 1}
    reduced = vm.reduce(model, method, **how)
    return [reduced.simulate(travel, outputs=["toe", "camber"]) for travel in TRAVEL]


def off(change, method="path_map"):
    wanted = np.array([0.0, 0.35])
    errors = [run.outputs - run.inputs[:, :1] * wanted for run in runs(change, method)]
    return np.concatenate(errors).T.ravel()


def slopes(change, method="path_map"):
    sides = [off(change + h, method) - off(change - h, method) for h in STEP * np.eye(len(POINTS))]
    return np.transpose(sides) / (2.0 * STEP)


def hard_points(method="path_map"):
    bounds, start = (-LARGEST, LARGEST), np.zeros(len(POINTS))
    how = {"jac": slopes, "bounds": bounds, "x_scale": LARGEST, "args": (method,)}
    return least_squares(off, start, **how).x


# %%
# The optimum, in mm, and the curves before and after.
if __name__ == "__main__":
    best = hard_points()
    for name, change in zip(POINTS, best, strict=True):
        print(f"{name:24} {1e3 * change:+7.3f} mm")
    figure, axes = plt.subplots(1, 2, sharey=True, figsize=(6.7, 3.6))
    for change, label in ((np.zeros(len(POINTS)), "before"), (best, "after")):
        run = runs(change, "full_order")[0]
        for axis, name in zip(axes, ("toe", "camber"), strict=True):
            axis.plot(run[name], 1e3 * run.inputs[:, 0], label=label)
            axis.set_xlabel(f"{name} (rad)")
    axes[1].plot(0.35 * run.inputs[:, 0], 1e3 * run.inputs[:, 0], ":", label="wanted")
    axes[0].set_ylabel("wheel travel (mm)")
    axes[1].legend()
    plt.show()
