"""
A driver around a closed course
===============================

The full car drives a lap of a closed course with steering, throttle and brake: a hundred decisions
a second, much faster than real time.
"""

import time

import matplotlib.pyplot as plt
import numpy as np

import vehiclemor as vm

MODEL, WHEELS = "independent_suspension_vehicle", ("FL", "FR", "RL", "RR")
PERIOD = 0.01
# Largest lateral acceleration of the plan, of braking and of driving (m/s^2); fastest (m/s).
ASIDE, BRAKING, DRIVING, FASTEST = 4.0, 3.0, 1.5, 25.0
# Of the car: mass (kg), wheel radius and wheelbase (m), understeer gradient (rad s^2/m), front
# share of the brakes.
MASS, RADIUS, WHEELBASE, UNDERSTEER, FRONT = 1093.3, 0.327, 2.58, 0.0005, 0.66
# The driver looks so far ahead (s, m), and corrects the speed at this rate (1/s).
AHEAD, NEAREST, HASTE = 0.5, 6.0, 1.0


# %%
# The course is a closed curve. Its curvature limits the speed; going round it twice backwards and
# forwards gives a speed that brakes and throttle can follow.
def course(points=2000):
    angle = np.linspace(0.0, 2.0 * np.pi, points, endpoint=False)
    z = (120.0 + 30.0 * np.cos(2.0 * angle) + 14.0 * np.sin(5.0 * angle)) * np.exp(1j * angle)
    step = np.roll(z, -1) - z
    length = np.abs(step)
    bend = np.angle(step / np.roll(step, 1)) / length
    speed = np.minimum(np.sqrt(ASIDE / np.maximum(np.abs(bend), 1e-6)), FASTEST)
    for k in range(2 * points):
        i = k % points
        speed[i] = min(speed[i], np.sqrt(speed[i - 1] ** 2 + 2.0 * DRIVING * length[i - 1]))
        i = (-1 - k) % points
        speed[i - 1] = min(speed[i - 1], np.sqrt(speed[i] ** 2 + 2.0 * BRAKING * length[i - 1]))
    # It begins at the origin, along the x axis, as the car does.
    z = (z - z[0]) * np.exp(-1j * np.angle(step[0]))
    return z, np.append(0.0, np.cumsum(length)), speed


# %%
# The driver steers to a point ahead on the course (pure pursuit, with the understeer of the car),
# and asks for the acceleration of the plan and what the speed lacks.
class Driver:
    def __init__(self, z, distance, speed):
        self.z, self.distance, self.speed, self.passed = z, distance, speed, 0

    def inputs(self, x, y, yaw, v):
        while self.distance_to(self.passed + 1, x, y) < self.distance_to(self.passed, x, y):
            self.passed += 1
        lap, (at, planned) = self.distance[-1], self.plan(self.passed)
        far = (at + AHEAD * v + NEAREST) % lap
        aim = np.interp(far, self.distance, np.append(self.z, self.z[0]))
        off = (aim - (x + 1j * y)) * np.exp(-1j * yaw)
        curvature = 2.0 * off.imag / abs(off) ** 2
        steering = (WHEELBASE + UNDERSTEER * v**2) * curvature
        _, later = self.plan(self.passed + 10)
        ahead = (self.distance[10] - self.distance[0]) or 1.0
        asked = (later**2 - planned**2) / (2.0 * ahead) + HASTE * (planned - v)
        torque = MASS * RADIUS * np.clip(asked, -1.5 * BRAKING, 1.5 * DRIVING)
        drive, brake = max(torque, 0.0), max(-torque, 0.0)
        front, rear = 0.5 * FRONT * brake, 0.5 * (1.0 - FRONT) * brake
        return np.array([steering, 0.5 * drive, 0.5 * drive, front, front, rear, rear])

    def distance_to(self, point, x, y):
        return abs(self.z[point % len(self.z)] - (x + 1j * y))

    def plan(self, point):
        return self.distance[point % len(self.z)], self.speed[point % len(self.z)]


# %%
# A model has the inputs that its runs drive: here steering, drive on the rear axle and all brakes.
# ``step`` holds them for 10 ms.
INPUTS = ("drive_torque_RL", "drive_torque_RR", *(f"brake_torque_{wheel}" for wheel in WHEELS))
SEEN = ("longitudinal_position", "lateral_position", "yaw", "longitudinal_speed")


def lap():
    z, distance, speed = course()
    car = vm.model(MODEL, {"initial_speed": speed[0]}).driving(INPUTS)
    plant, driver = vm.reduce(car, "full_order", tolerance=1e-5), Driver(z, distance, speed)
    seen = [plant.output_names.index(name) for name in SEEN]
    state, u, record, seconds = plant.state(), np.zeros(7), [], 0.0
    while driver.passed < len(z):
        x, y, yaw, v = plant.outputs(state, u)[seen]
        u = driver.inputs(x, y, yaw, v)
        record.append([x, y, v, *u])
        began = time.process_time()
        state = plant.step(state, u, PERIOD)
        seconds += time.process_time() - began
    return z, speed, car, np.array(record), seconds


# %%
# The recorded inputs are a signal: the same lap again in one call, and its film.
def film(car, record, file):
    t = PERIOD * np.arange(len(record))
    inputs = ["delta", *INPUTS]
    again = vm.Signal.from_samples(t, record[:, 3:], "zero", inputs=inputs, output_step=0.04)
    return vm.animate(car.simulate(again), labels=["full order"], duration=6.0, out=file)


if __name__ == "__main__":
    z, speed, car, record, seconds = lap()
    driven = PERIOD * len(record)
    print(f"a lap of {driven:.0f} s in {seconds:.2f} s of computing: {driven / seconds:.0f} times")
    near = np.abs(record[:, :1] + 1j * record[:, 1:2] - z).argmin(axis=1)
    off = np.abs(record[:, 0] + 1j * record[:, 1] - z[near])
    print(f"off the course by at most {off.max():.2f} m at up to {record[:, 2].max():.1f} m/s")
    figure, axes = plt.subplots(1, 2, figsize=(6.7, 3.2))
    axes[0].plot(z.real, z.imag, color="0.8", linewidth=5, label="course")
    axes[0].plot(record[:, 0], record[:, 1], label="car")
    axes[0].set(xlabel="X (m)", ylabel="Y (m)", aspect="equal")
    axes[0].legend()
    t = PERIOD * np.arange(len(record))
    axes[1].plot(t, speed[near], color="0.7", linewidth=3, label="plan")
    axes[1].plot(t, record[:, 2], label="car")
    axes[1].set(xlabel="time (s)", ylabel="speed (m/s)")
    axes[1].legend()
    figure.tight_layout()
    print(f"written: {film(car, record, 'course.gif')}")
    plt.show()
