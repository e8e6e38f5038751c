"""
Predictive control around an obstacle
=====================================

A car at 72 km/h steers around an obstacle. Every 50 ms a controller chooses the steering of the
next second and a half by nonlinear least squares. The reduced model predicts; the full car drives.
"""

# %%
# A plan is 30 steering angles of 50 ms each, at most 0.1 rad. The car keeps out of an ellipse.
import time

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import least_squares

import vehiclemor as vm

MODEL, PERIOD, HORIZON, LIMIT = "independent_suspension_vehicle", 0.05, 30, 0.1
OBSTACLE, CLEARANCE = np.array([50.0, -0.3]), np.array([9.0, 2.5])
# Weights of lateral position (1/m), heading (1/rad), depth in the ellipse, steering (1/rad), and
# its change from period to period (1/rad).
ASIDE, ASKEW, INSIDE, STEERED, TURNED = 0.1, 1.0, 30.0, 2.0, 20.0


# %%
# The classical Runge-Kutta method predicts. ``jacobian`` gives exact derivatives by the steering.
def predicted(car, state, steering, steps):
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


# %%
# Each plan starts from the plan before. Fast modes need short steps: the full car four in a period.
class Controller:
    def __init__(self, car, steps=1):
        self.car, self.steps, self.steering = car, steps, np.zeros(HORIZON)
        self.pose = [car.states.index(name) for name in ("X", "Y", "psi")]

    def costs(self, state, before, steering):
        states, slopes = predicted(self.car, state, steering, self.steps)
        pose, moved = states[:, self.pose], slopes[:, self.pose]
        off = (pose[:, :2] - OBSTACLE) / CLEARANCE
        depth = np.maximum(1.0 - (off**2).sum(axis=1), 0.0)
        inwards = -2.0 * (depth > 0.0)[:, None] * off / CLEARANCE
        change = np.eye(HORIZON) - np.eye(HORIZON, k=-1)
        turned = change @ steering - before * np.eye(HORIZON)[0]
        values = (ASIDE * pose[:, 1], ASKEW * pose[:, 2], INSIDE * depth, STEERED * steering)
        derivatives = (
            ASIDE * moved[:, 1],
            ASKEW * moved[:, 2],
            INSIDE * (inwards[:, :, None] * moved[:, :2]).sum(axis=1),
            STEERED * np.eye(HORIZON),
        )
        return np.append(values, TURNED * turned), np.vstack([*derivatives, TURNED * change])

    def plan(self, state, before):
        known = {}

        def both(steering):
            key = steering.tobytes()
            if key not in known:
                known[key] = self.costs(state, before, steering)
            return known[key]

        guess = np.clip(np.append(self.steering[1:], self.steering[-1]), -0.099, 0.099)
        how = {"bounds": (-LIMIT, LIMIT), "ftol": 1e-4, "xtol": 1e-4, "max_nfev": 20}
        solution = least_squares(lambda u: both(u)[0], guess, lambda u: both(u)[1], **how)
        self.steering = solution.x
        return solution


# %%
# The loop: encode the measured state of the full car, plan, steer for one period.
def drive(controller, plant, duration=5.0):
    state, steering = plant.state(), np.zeros(1)
    names = ("longitudinal_position", "lateral_position", "yaw")
    seen = [plant.output_names.index(name) for name in names]
    record = {"path": [], "steering": [], "evaluations": [], "ms": []}
    for _ in range(round(duration / PERIOD)):
        record["path"].append(plant.outputs(state, steering)[seen])
        measured = controller.car.state(plant.full_state(state, steering), steering)
        began = time.thread_time()
        plan = controller.plan(measured, steering.item())
        record["ms"].append(1e3 * (time.thread_time() - began))
        record["evaluations"].append(plan.nfev)
        steering = plan.x[:1]
        record["steering"].append(steering.item())
        state = plant.step(state, steering, PERIOD)
    return {name: np.array(values) for name, values in record.items()}


def clearance(path):
    return float(np.linalg.norm((path[:, :2] - OBSTACLE) / CLEARANCE, axis=1).min())


# %%
# The car leaves its lane, passes the obstacle and comes back.
if __name__ == "__main__":
    reduced = vm.rom(MODEL)
    run = drive(Controller(reduced), vm.reduce(MODEL, "full_order"))
    print(f"{run['evaluations'].mean():.1f} predictions a plan")
    usual, longest = np.median(run["ms"]), run["ms"].max()
    print(f"{usual:.0f} ms a plan (median), {longest:.0f} at most, {1e3 * PERIOD:.0f} a period")
    print(f"clearance {clearance(run['path']):.2f}, where 1 touches the ellipse")
    figure, axes = plt.subplots(2, figsize=(6.7, 4.6))
    round_ = np.linspace(0.0, 2.0 * np.pi, 200)
    ellipse = OBSTACLE + CLEARANCE * np.column_stack([np.cos(round_), np.sin(round_)])
    axes[0].fill(*ellipse.T, color="0.85", label="keep out")
    axes[0].plot(*run["path"].T[:2], label="full car")
    axes[0].set(xlabel="longitudinal position (m)", ylabel="lateral position (m)")
    axes[0].legend()
    axes[1].step(PERIOD * np.arange(len(run["steering"])), 1e3 * run["steering"], where="post")
    axes[1].set(xlabel="time (s)", ylabel="steering (mrad)")
    plt.show()
