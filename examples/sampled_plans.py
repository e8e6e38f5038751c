"""
A thousand plans a tick
=======================

A path-integral controller needs no derivatives: it tries a thousand steering signals by fixed steps
of ``vm.export(car, "rollouts")`` and steers by their mean, weighted by cost. The full car drives
around an obstacle.
"""

# %%
# A plan is 2 s of steering, linear between 20 knots; noise on the knots is added up, so that plans
# are smooth. Costs are lateral distance, depth in an ellipse and steering.
import time

import matplotlib.pyplot as plt
import numpy as np

import vehiclemor as vm

MODEL, PERIOD, KNOTS, PLANS = "independent_suspension_vehicle", 0.1, 20, 1000
OBSTACLE, CLEARANCE = np.array([50.0, -0.3]), np.array([9.0, 2.5])
SPREAD, LIMIT, TEMPERATURE = 0.003, 0.04, 0.2
SEEN = ["longitudinal_position", "lateral_position"]
TIMES = PERIOD * np.arange(KNOTS + 1)


def costs(places, steering):
    """Cost of each plan from its places (plans, times, 2)."""
    aside, turned = places[:, :, 1], np.diff(steering, axis=1)
    off = (((places - OBSTACLE) / CLEARANCE) ** 2).sum(axis=2)
    inside = np.maximum(1.0 - off, 0.0)
    return (0.05 * aside**2 + 50.0 * inside).sum(axis=1) + 2e3 * (turned**2).sum(axis=1)


# %%
# Each tick samples around the last plan, shifted by a period. A run that fails is not a number, and
# weighs nothing.
class Sampler:
    def __init__(self, car, step=0.05, integrator="rk4", seed=1):
        self.car, self.random = car, np.random.default_rng(seed)
        options = {"step": step, "integrator": integrator, "outputs": SEEN}
        self.rollouts = vm.export(car, "rollouts", **options)
        self.steering = np.zeros(KNOTS + 1)

    def plan(self, full_state, now):
        ahead = np.append(self.steering[1:], self.steering[-1])
        noise = SPREAD * self.random.normal(size=(PLANS, KNOTS)).cumsum(axis=1)
        tried = np.clip(ahead + np.insert(noise, 0, 0.0, axis=1), -LIMIT, LIMIT)
        tried[:, 0] = now
        places = self.rollouts(self.car.state(full_state, [now]), tried, PERIOD)
        cost = np.nan_to_num(costs(places, tried), nan=np.inf)
        weights = np.exp((cost.min() - cost) / TEMPERATURE)
        self.steering = weights @ tried / weights.sum()
        return self.steering


def drive(sampler, plant, duration=4.0):
    """Places of the full car, and CPU seconds of each tick."""
    state, now, places, seconds = plant.state(), 0.0, [], []
    at = [plant.output_names.index(name) for name in SEEN]
    for _ in range(round(duration / PERIOD)):
        began = time.process_time()
        plan = sampler.plan(plant.full_state(state, [now]), now)
        seconds.append(time.process_time() - began)
        state = plant.step(state, [now], PERIOD, next_inputs=plan[1:2])
        now = plan[1]
        places.append(plant.outputs(state, [now])[at])
    return np.array(places), np.array(seconds)


# %%
# Runge-Kutta steps of 50 ms suit the reduced car; the full one needs ``integrator="ros2"``.
if __name__ == "__main__":
    reduced = vm.rom(MODEL)
    places, seconds = drive(Sampler(reduced), vm.reduce(reduced.model, "full_order"))
    print(f"{1e3 * np.median(seconds):.1f} ms a tick on one core")
    clearance = np.sqrt((((places - OBSTACLE) / CLEARANCE) ** 2).sum(axis=1)).min()
    print(f"clearance {clearance:.2f}, where 1 touches the ellipse")
    around = np.linspace(0.0, 2.0 * np.pi, 200)
    ellipse = OBSTACLE + CLEARANCE * np.column_stack([np.cos(around), np.sin(around)])
    figure, axis = plt.subplots(figsize=(6.7, 3.0))
    axis.fill(*ellipse.T, color="0.85", label="keep out")
    axis.plot(*places.T, label="full car")
    axis.set(xlabel="longitudinal position (m)", ylabel="lateral position (m)")
    axis.legend()
    plt.show()
