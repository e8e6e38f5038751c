"""
A driver at the wheel
=====================

One driver steers the full car and the reduced car through the double lane change of ISO 3888-1 at
80 km/h. The loop is closed: the driver answers the errors of the model.
"""

import matplotlib.pyplot as plt
import numpy as np

import vehiclemor as vm

# %%
# The track: where the way over and the way back begin and end, and its length and width, all in m.
OVER, BACK, LENGTH, OFFSET = (15.0, 45.0), (70.0, 95.0), 125.0, 3.5
# Preview time of the driver in s, frequency of the steering system in 1/s, speed in m/s.
PREVIEW, FREQUENCY, SPEED = 0.85, 30.0, 80.0 / 3.6
SEEN = ("longitudinal_position", "lateral_position", "yaw")


def lane(x):
    z = np.clip([(x - begin) / (end - begin) for begin, end in (OVER, BACK)], 0.0, 1.0)
    over, back = z**3 * (10.0 - 15.0 * z + 6.0 * z**2)
    return OFFSET * (over - back)


# %%
# The driver aims at a point ahead. The steering follows as a critically damped second-order system.
# ``step`` takes the inputs at both ends of a step and connects them by a straight line.
def steering_per_curvature(car, state):
    small, yaw = np.eye(len(car.inputs))[0] * 1e-4, car.output_names.index("yaw")
    bend = car.step(state, small, 3.0)
    turned = car.outputs(car.step(bend, small, 0.5), small)[yaw] - car.outputs(bend, small)[yaw]
    return small[0] * SPEED * 0.5 / turned


def drive(car, start, dt=0.01):
    gain, state = steering_per_curvature(car, car.state(start)), car.state(start)
    steering, rate, known, ahead = 0.0, 0.0, 0.0, PREVIEW * SPEED
    u = np.zeros(len(car.inputs))
    seen, outputs = [car.output_names.index(name) for name in SEEN], [car.outputs(state, u)]
    while outputs[-1][seen[0]] < LENGTH:
        x, y, yaw = outputs[-1][seen]
        aside = lane(x + ahead) - y - ahead * np.sin(yaw)
        pushed = FREQUENCY**2 * (gain * 2.0 * aside / ahead**2 - steering) - 2.0 * FREQUENCY * rate
        begins = (steering, rate, pushed)
        steering += dt * rate + 0.5 * dt**2 * pushed
        rate += dt * pushed
        # A model takes the steering alone, or its derivatives too.
        u, ends = (np.array(v[: len(u)]) for v in (begins, (steering, rate, pushed)))
        state = car.step(state, u, dt, next_inputs=ends)
        outputs.append(car.outputs(state, ends))
        known = max(known, car.trust(state, ends).indicator)
    return np.array(outputs), known


# %%
# The reduced car predicts from its 12 states where the full car has 28.
def compare(name):
    reduced = vm.rom(name)
    full = vm.reduce(reduced.model, "full_order")
    start = vm.model(name, parameters={"initial_speed": SPEED}).start()
    expected, _ = drive(full, start)
    predicted, known = drive(reduced, start)
    return expected, predicted, known, [full.output_names.index(name) for name in SEEN]


if __name__ == "__main__":
    full, reduced, known, (x, y, _) = compare("independent_suspension_vehicle")
    samples = min(len(full), len(reduced))
    off = 1e3 * np.abs(full[:samples, y] - reduced[:samples, y])
    print(f"sideways apart by at most {off.max():.1f} mm; trust indicator {known:.2f} of 1")
    figure, axes = plt.subplots(2, sharex=True, figsize=(6.7, 4.4))
    middle = [lane(distance) for distance in full[:, x]]
    axes[0].plot(full[:, x], middle, ":", label="middle of the lane")
    axes[0].plot(full[:, x], full[:, y], label="full car")
    axes[0].plot(reduced[:, x], reduced[:, y], "--", label="reduced car")
    axes[0].set_ylabel("lateral position (m)")
    axes[0].legend()
    axes[1].plot(full[:samples, x], off)
    axes[1].set(xlabel="longitudinal position (m)", ylabel="apart by (mm)")
    plt.show()
