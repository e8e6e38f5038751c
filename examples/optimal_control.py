"""
An optimal lane change
======================

IPOPT finds the steering of a lane change at 72 km/h: three seconds in periods of 50 ms. CasADi has
the model's equations and their derivatives from ``vm.export``. Full and reduced car give the same
steering; the reduced one gives it sooner. It needs CasADi: ``pip install 'vehiclemor[casadi]'``.
"""

# %%
# In each period the rate of steering is constant. Costs are squares of lateral distance (1/m),
# heading, steering (1/rad) and its rate (s/rad), weighted.
import time

import casadi as ca
import matplotlib.pyplot as plt
import numpy as np

import vehiclemor as vm

MODEL, PERIOD, LANE, LIMIT = "independent_suspension_vehicle", 0.05, 3.5, 0.1
ASIDE, ASKEW, STEERED, TURNED = 0.1, 1.0, 2.0, 1.0
# Points of Radau's collocation of order 5, in parts of a period.
POINTS = [0.0, *ca.collocation_points(3, "radau")]
QUIET = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"}


# %%
# What holds in a period, from a state and steering to the next, is one of two: steps of the
# classical Runge-Kutta method, or collocation, which needs states in between and takes stiff
# equations in one piece.
def unknowns(states, between):
    sizes = {"state": states, "steering": 1, "rate": 1, "between": between, "next state": states}
    return [ca.SX.sym(name, size) for name, size in sizes.items()]


def shooting(rates, states, steps):
    x, u, rate, _, _ = given = unknowns(states, 0)
    h, end, start = PERIOD / steps, x, u
    for _ in range(steps):
        middle, last = start + h / 2 * rate, start + h * rate
        k1 = rates(end, start)
        k2 = rates(end + h / 2 * k1, middle)
        k3 = rates(end + h / 2 * k2, middle)
        k4 = rates(end + h * k3, last)
        end, start = end + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), last
    return ca.Function("period", given, [given[-1] - end])


def collocation(rates, states):
    x, u, rate, between, following = given = unknowns(states, 2 * states)
    values = ca.horzcat(x, ca.reshape(between, states, 2), following)
    slopes = values @ ca.DM(ca.collocation_coeff(POINTS[1:])[0])
    off = [
        slopes[:, j] - PERIOD * rates(values[:, j + 1], u + POINTS[j + 1] * PERIOD * rate)
        for j in range(3)
    ]
    return ca.Function("period", given, [ca.vertcat(*off)])


# %%
# All periods are one problem. Its unknowns are, by period, state, steering, rate and what is in
# between. Steering is limited; the first state is measured.
class Planner:
    def __init__(self, car, periods=60, steps=0):
        self.car, self.periods = car, periods
        equations = vm.export(car, "casadi", outputs=["lateral_position", "yaw"])
        n, values = equations.size1_in("x"), car.model.parameter_values
        values = ca.DM(values[: equations.size1_in("p")])

        def rates(x, u):
            return equations(x, u, values)[0]

        period = shooting(rates, n, steps) if steps else collocation(rates, n)
        self.sizes = (n, 1, 1, period.size1_in(3))
        blocks = ca.MX.sym("blocks", sum(self.sizes), periods)
        last = ca.MX.sym("last", n + 1)
        x, u, rate, between = ca.vertsplit(blocks, np.cumsum([0, *self.sizes]).tolist())
        next_x, next_u = ca.horzcat(x[:, 1:], last[:n]), ca.horzcat(u[:, 1:], last[n])
        off = period.map(periods)(x, u, rate, between, next_x)
        turned = next_u - u - PERIOD * rate
        aside, yaw = ca.vertsplit(equations.map(periods)(next_x, next_u, values)[1])
        terms = ((ASIDE, aside - LANE), (ASKEW, yaw), (STEERED, next_u), (TURNED, rate))
        costs = sum(weight**2 * ca.sumsqr(term) for weight, term in terms)
        problem = {"x": ca.veccat(blocks, last), "f": costs, "g": ca.veccat(off, turned)}
        self.solver, self.guess = ca.nlpsol("plan", "ipopt", problem, QUIET), None

    def packed(self, x, u, rate, between):
        blocks = np.vstack([x[:, :-1], u[:, :-1], rate, between])
        return np.concatenate([blocks.ravel(order="F"), x[:, -1], u[:, -1]])

    def unpacked(self, numbers):
        n = self.sizes[0]
        blocks = numbers[: -n - 1].reshape(self.periods, -1).T
        parts = np.vsplit(blocks, np.cumsum(self.sizes)[:-1])
        ends = numbers[-n - 1 :, None]
        return np.hstack([parts[0], ends[:n]]), np.hstack([parts[1], ends[n:]]), *parts[2:]

    def straight_on(self, state):
        """A run without steering."""
        x = [state]
        for _ in range(self.periods):
            x.append(self.car.step(x[-1], [0.0], PERIOD))
        x = np.array(x).T
        between = np.vstack([x[:, :-1] + part * np.diff(x) for part in POINTS[1:3]])
        steering, rate = np.zeros((1, self.periods + 1)), np.zeros((1, self.periods))
        return self.packed(x, steering, rate, between[: self.sizes[3]])

    def plan(self, state, steering=0.0):
        """Steering at the ends of the periods, and seconds of the solution."""
        guess = self.straight_on(state) if self.guess is None else self.guess
        n = self.sizes[0]
        x, u, rate, between = (np.full_like(part, np.inf) for part in self.unpacked(guess))
        u[:] = LIMIT
        most = self.packed(x, u, rate, between)
        least = -most
        for bound in (least, most):
            bound[: n + 1] = np.append(state, steering)
        began = time.thread_time()
        found = self.solver(x0=guess, lbx=least, ubx=most, lbg=0.0, ubg=0.0)
        seconds = time.thread_time() - began
        assert self.solver.stats()["success"], self.solver.stats()["return_status"]
        solution = np.array(found["x"]).ravel()
        # The next plan starts from this one, a period later.
        shifted = [np.hstack([part[:, 1:], part[:, -1:]]) for part in self.unpacked(solution)]
        self.guess = self.packed(*shifted)
        return self.unpacked(solution)[1].ravel(), seconds


# %%
# The loop at 20 Hz: encode the measured state of the full car, plan, steer for one period.
def drive(planner, plant, duration=4.0):
    state, steering, aside, seconds = plant.state(), 0.0, [], []
    place = plant.output_names.index("lateral_position")
    for _ in range(round(duration / PERIOD)):
        measured = planner.car.state(plant.full_state(state, [steering]), [steering])
        plan, took = planner.plan(measured, steering)
        state = plant.step(state, [steering], PERIOD, next_inputs=plan[1:2])
        steering = plan[1]
        aside.append(plant.outputs(state, plan[1:2])[place])
        seconds.append(took)
    return np.array(aside), np.array(seconds)


# %%
# Runge-Kutta steps of a whole period suit the reduced car. The full one needs collocation: five
# steps a period make it slower still.
if __name__ == "__main__":
    reduced = vm.rom(MODEL)
    full = vm.reduce(reduced.model, "full_order")
    figure, axes = plt.subplots(2, figsize=(6.7, 4.6))
    for label, car, steps in (("reduced", reduced, 1), ("full", full, 0)):
        steering, seconds = Planner(car, steps=steps).plan(car.state())
        print(f"{label}: {seconds:.2f} s, largest steering {1e3 * abs(steering).max():.2f} mrad")
        axes[0].plot(PERIOD * np.arange(61), 1e3 * steering, "-" if steps else "--", label=label)
    aside, seconds = drive(Planner(reduced, periods=30, steps=1), full)
    print(f"loop: {1e3 * np.median(seconds):.0f} ms a plan, {1e3 * max(seconds):.0f} at most")
    axes[1].plot(PERIOD * np.arange(1, len(aside) + 1), aside)
    axes[0].set(ylabel="optimal steering (mrad)")
    axes[0].legend()
    axes[1].set(xlabel="time (s)", ylabel="lateral position,\nloop (m)")
    plt.show()
