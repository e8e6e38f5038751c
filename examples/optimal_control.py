"""
An optimal lane change
======================

IPOPT finds steering and braking of a lane change from 72 to 58 km/h: three seconds in periods of
50 ms. CasADi has the model's equations and their derivatives from ``vm.export``. Full and reduced
car give the same plan; the reduced one gives it sooner. It needs CasADi:
``pip install 'vehiclemor[casadi]'``.
"""

# %%
# Controls are steering (rad) and, of a car with brakes, the deceleration that they are to give
# (m/s^2). In each period their rates are constant. Costs are squares of lateral distance (1/m),
# heading, speed (s/m), controls and their rates, weighted.
import time

import casadi as ca
import matplotlib.pyplot as plt
import numpy as np

import vehiclemor as vm

MODEL, PERIOD, LANE, SPEED = "independent_suspension_vehicle", 0.05, 3.5, 16.0
ASIDE, ASKEW, FAST = 0.1, 1.0, 0.1
# Of steering and braking: weights of controls and rates, least and largest.
HELD, TURNED = np.array([2.0, 0.02]), np.array([1.0, 0.01])
LEAST, MOST = np.array([-0.1, 0.0]), np.array([0.1, 3.0])
# N m at each wheel for 1 m/s^2.
TORQUES = {"FL": 118.0, "FR": 118.0, "RL": 61.0, "RR": 61.0}
# Points of Radau's collocation of order 5, in parts of a period.
POINTS = [0.0, *ca.collocation_points(3, "radau")]
QUIET = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"}


# %%
# A model that brakes learns from random driving; it has torques and friction as inputs.
def braking_car():
    training = [f"random_drive:{seed}" for seed in range(40)]
    return vm.reduce(MODEL, "slow_manifold", training=training, terms=30, even_terms=20)


def shares(car):
    """Inputs as a sum: at rest (inputs, 1), and by each control (inputs, controls)."""
    rest = [[float(name.startswith("friction"))] for name in car.inputs]
    steered = [[float(name == "delta")] for name in car.inputs]
    braked = [[TORQUES[name[-2:]] if name.startswith("brake") else 0.0] for name in car.inputs]
    controls = np.hstack([steered, braked] if np.any(braked) else [steered])
    return np.array(rest), controls


# %%
# What holds in a period, from a state and steering to the next, is one of two: steps of the
# classical Runge-Kutta method, or collocation, which needs states in between and takes stiff
# equations in one piece.
def unknowns(states, controls, between):
    sizes = {"state": states, "control": controls, "rate": controls, "between": between}
    sizes |= {"next state": states}
    return [ca.SX.sym(name, size) for name, size in sizes.items()]


def shooting(rates, states, controls, steps):
    x, u, rate, _, _ = given = unknowns(states, controls, 0)
    h, end, start = PERIOD / steps, x, u
    for _ in range(steps):
        middle, last = start + h / 2 * rate, start + h * rate
        k1 = rates(end, start)
        k2 = rates(end + h / 2 * k1, middle)
        k3 = rates(end + h / 2 * k2, middle)
        k4 = rates(end + h * k3, last)
        end, start = end + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), last
    return ca.Function("period", given, [given[-1] - end])


def collocation(rates, states, controls):
    x, u, rate, between, following = given = unknowns(states, controls, 2 * states)
    values = ca.horzcat(x, ca.reshape(between, states, 2), following)
    slopes = values @ ca.DM(ca.collocation_coeff(POINTS[1:])[0])
    off = [
        slopes[:, j] - PERIOD * rates(values[:, j + 1], u + POINTS[j + 1] * PERIOD * rate)
        for j in range(3)
    ]
    return ca.Function("period", given, [ca.vertcat(*off)])


# %%
# All periods are one problem. Its unknowns are, by period, state, controls, rates and what is in
# between. Controls are limited; the first state is measured.
class Planner:
    def __init__(self, car, periods=60, steps=0):
        self.car, self.periods = car, periods
        self.rest, self.shares = shares(car)
        self.controls = m = self.shares.shape[1]
        outputs = ["lateral_position", "yaw", "longitudinal_speed"][: 1 + m]
        equations = vm.export(car, "casadi", outputs=outputs)
        n, values = equations.size1_in("x"), car.model.parameter_values
        values = ca.DM(values[: equations.size1_in("p")])

        def rates(x, u):
            return equations(x, ca.DM(self.rest) + ca.DM(self.shares) @ u, values)[0]

        period = shooting(rates, n, m, steps) if steps else collocation(rates, n, m)
        self.sizes = (n, m, m, period.size1_in(3))
        blocks = ca.MX.sym("blocks", sum(self.sizes), periods)
        last = ca.MX.sym("last", n + m)
        x, u, rate, between = ca.vertsplit(blocks, np.cumsum([0, *self.sizes]).tolist())
        next_x, next_u = ca.horzcat(x[:, 1:], last[:n]), ca.horzcat(u[:, 1:], last[n:])
        off = period.map(periods)(x, u, rate, between, next_x)
        turned = next_u - u - PERIOD * rate
        inputs = ca.repmat(ca.DM(self.rest), 1, periods) + ca.DM(self.shares) @ next_u
        aside, yaw, *speed = ca.vertsplit(equations.map(periods)(next_x, inputs, values)[1])
        terms = [ASIDE * (aside - LANE), ASKEW * yaw, *(FAST * (v - SPEED) for v in speed)]
        terms += [ca.diag(HELD[:m]) @ next_u, ca.diag(TURNED[:m]) @ rate]
        costs = sum(ca.sumsqr(term) for term in terms)
        self.problem = {"x": ca.veccat(blocks, last), "f": costs, "g": ca.veccat(off, turned)}
        self.solver, self.guess = ca.nlpsol("plan", "ipopt", self.problem, QUIET), None

    def inputs(self, controls):
        """Inputs of the car."""
        return self.rest[:, 0] + self.shares @ controls

    def packed(self, x, u, rate, between):
        blocks = np.vstack([x[:, :-1], u[:, :-1], rate, between])
        return np.concatenate([blocks.ravel(order="F"), x[:, -1], u[:, -1]])

    def unpacked(self, numbers):
        n, m = self.sizes[:2]
        blocks = numbers[: -n - m].reshape(self.periods, -1).T
        parts = np.vsplit(blocks, np.cumsum(self.sizes)[:-1])
        ends = numbers[-n - m :, None]
        return np.hstack([parts[0], ends[:n]]), np.hstack([parts[1], ends[n:]]), *parts[2:]

    def straight_on(self, state):
        """A run without steering and brakes."""
        x, m = [state], self.controls
        for _ in range(self.periods):
            x.append(self.car.step(x[-1], self.rest[:, 0], PERIOD))
        x = np.array(x).T
        between = np.vstack([x[:, :-1] + part * np.diff(x) for part in POINTS[1:3]])
        controls, rate = np.zeros((m, self.periods + 1)), np.zeros((m, self.periods))
        return self.packed(x, controls, rate, between[: self.sizes[3]])

    def start(self):
        """State of the car where the controls are at rest."""
        return self.car.state(inputs=self.rest[:, 0])

    def plan(self, state, controls=(0.0, 0.0)):
        """Controls (controls, periods + 1) at the ends of periods, and seconds of the solution."""
        guess = self.straight_on(state) if self.guess is None else self.guess
        (n, m), bounds = self.sizes[:2], []
        for sign, limit in ((-1.0, LEAST), (1.0, MOST)):
            x, u, rate, between = (
                np.full_like(part, sign * np.inf) for part in self.unpacked(guess)
            )
            u[:] = limit[:m, None]
            bounds.append(self.packed(x, u, rate, between))
            bounds[-1][: n + m] = np.append(state, controls[:m])
        least, most = bounds
        began = time.thread_time()
        found = self.solver(x0=guess, lbx=least, ubx=most, lbg=0.0, ubg=0.0)
        seconds = time.thread_time() - began
        assert self.solver.stats()["success"], self.solver.stats()["return_status"]
        solution = np.array(found["x"]).ravel()
        # The next plan starts from this one, a period later.
        shifted = [np.hstack([part[:, 1:], part[:, -1:]]) for part in self.unpacked(solution)]
        self.guess = self.packed(*shifted)
        return self.unpacked(solution)[1], seconds


# %%
# The loop at 20 Hz: encode the measured state of the full car, plan, act for one period.
def drive(planner, plant, duration=4.0):
    """Lateral position and speed of the plant at the ends of periods; seconds of the plans."""
    controls, seen, seconds = np.zeros(planner.controls), [], []
    state = plant.state(inputs=planner.inputs(controls))
    places = [plant.output_names.index(n) for n in ("lateral_position", "longitudinal_speed")]
    for _ in range(round(duration / PERIOD)):
        u = planner.inputs(controls)
        plan, took = planner.plan(planner.car.state(plant.full_state(state, u), u), controls)
        controls = plan[:, 1]
        following = planner.inputs(controls)
        state = plant.step(state, u, PERIOD, next_inputs=following)
        seen.append(plant.outputs(state, following)[places])
        seconds.append(took)
    return np.array(seen), np.array(seconds)


# %%
# Runge-Kutta steps of a whole period suit the reduced car. The full one needs collocation: five
# steps a period make it slower still.
if __name__ == "__main__":
    reduced = braking_car()
    full = vm.reduce(reduced.model, "full_order")
    figure, axes = plt.subplots(2, 2, figsize=(6.7, 4.6), sharex="row")
    for label, car, steps in (("reduced", reduced, 1), ("full", full, 0)):
        planner = Planner(car, steps=steps)
        (steering, braking), seconds = planner.plan(planner.start())
        print(f"{label}: {seconds:.2f} s, largest steering {1e3 * abs(steering).max():.2f} mrad")
        times, line = PERIOD * np.arange(61), "-" if steps else "--"
        axes[0, 0].plot(times, 1e3 * steering, line, label=label)
        axes[0, 1].plot(times, braking, line)
    seen, seconds = drive(Planner(reduced, periods=20, steps=1), full)
    print(f"loop: {1e3 * np.median(seconds):.0f} ms a plan, {1e3 * max(seconds):.0f} at most")
    names = "steering (mrad)", "braking (m/s^2)", "lateral position,\nloop (m)", "speed, loop (m/s)"
    for axis, column in zip(axes[1], seen.T, strict=True):
        axis.plot(PERIOD * np.arange(1, len(seen) + 1), column)
    for axis, name in zip(axes.flat, names, strict=True):
        axis.set(ylabel=name)
    axes[0, 0].legend()
    figure.supxlabel("time (s)")
    plt.show()
