"""Symmetries and runs of both vehicles: against their mirror image, LSODA, CVODE, themselves."""

from functools import cache
from itertools import pairwise, product

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sksundae.cvode import CVODE

from tests.models import CAR, FIDELITY, VEHICLES
from tests.oracles import high_fidelity_data, vehicle_lagrange
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.simulation.integrators.catalogue import INTEGRATORS

LANE_CHANGE = {
    CAR: component("maneuver", "lane_change"),
    FIDELITY: component("maneuver", "rack_lane_change"),
}
# The same inputs as the oracles have them, and a sample of them.
STEERING = {CAR: vehicle_lagrange.lane_change, FIDELITY: high_fidelity_data.lane_change}
MIRROR = {CAR: vehicle_lagrange.mirror, FIDELITY: high_fidelity_data.mirror}
INPUTS = {CAR: np.array([0.3]), FIDELITY: np.array([0.02, 0.1, 1.0])}
STARTS = ("equilibrium", "dropped")
# The pulse of the steering is not smooth at its ends.
EDGES = (0.0, 1.0, 3.5, 4.0)
TIMES = np.array([0.05, 0.3, 0.9, 1.7, 2.6, 3.4, 4.0])
each_vehicle = pytest.mark.parametrize("name", VEHICLES)
each_solver = pytest.mark.parametrize("solver", INTEGRATORS)


def integrate(model, start, solver="dopri5", tolerance=1e-9, longest_step=None):
    """States of the lane change, and counts."""
    maneuver = LANE_CHANGE[model.name]
    return model.simulate(maneuver, start, TIMES, solver, tolerance, longest_step=longest_step)


@cache
def exact(name: str, start: str = "equilibrium") -> np.ndarray:
    model = build(name)
    return integrate(model, model.start(start), tolerance=1e-13 if name == CAR else 1e-12).states


def turn(model, x: np.ndarray, angle: float) -> np.ndarray:
    """States (..., n) of the vehicle turned about the world's origin."""
    turned, heading = np.array(x), model.coordinates.index("psi")
    turned[..., heading] += angle
    # Speeds of the high-fidelity vehicle are those in the world.
    for k in (0, 26) if model.name == FIDELITY else (0,):
        place = (x[..., k] + 1j * x[..., k + 1]) * np.exp(1j * angle)
        turned[..., k], turned[..., k + 1] = place.real, place.imag
    return turned


def random_motion(model, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """About straight running: loops may be open, wheels in the air or deep in the road."""
    n, x = len(model.coordinates), model.start()
    spread = np.concatenate([[0.0, 0.0, 0.05, 0.0], np.full(n - 8, 0.1), np.full(4, 3.0)])
    x[:n] += rng.uniform(-spread, spread)
    spread = np.concatenate([[15.0], np.full(n - 5, 2.0), np.full(4, 20.0)])
    x[n:] += rng.uniform(-spread, spread)
    return turn(model, x, rng.uniform(-3.0, 3.0)), INPUTS[model.name] * rng.uniform(-1.0, 1.0)


def close(found: np.ndarray, expected: np.ndarray) -> None:
    """But for rounding of forces that cancel each other at rest."""
    assert np.abs(found - expected).max() < 1e-10 * max(1.0, np.abs(expected).max())


# Symmetries


@each_vehicle
def test_mirrored_turned_and_moved_the_vehicle_accelerates_alike(name, rng):
    model = build(name)
    n, heading = len(model.coordinates), model.coordinates.index("psi")
    for _ in range(60):
        x, u = random_motion(model, rng)
        rates = model.rhs(x, u)
        close(model.rhs(MIRROR[name](x), -u), MIRROR[name](rates))
        # Place, heading and wheel angles have no influence.
        angle = rng.uniform(-6.0, 6.0)
        moved = turn(model, x, angle)
        moved[:2] += rng.uniform(-100.0, 100.0, 2)
        moved[n - 4 : n] += rng.uniform(-50.0, 50.0, 4)
        expected = turn(model, rates, angle)
        expected[heading] -= angle
        close(model.rhs(moved, u), expected)


@each_vehicle
@each_solver
def test_the_run_does_not_depend_on_the_heading(name, solver):
    """With equal steps not even its error does, though the frozen Jacobian is of one heading."""
    model = build(name)
    x, angle = model.start("dropped"), 2.0
    # The explicit pair and the formulas of many steps are stable with short ones.
    step = {"dopri5": 0.002}.get(solver, 0.01)
    plain = integrate(model, x, solver, 1e9, step)
    turned = integrate(model, turn(model, x, angle), solver, 1e9, step)
    size = 1e-6 if name == FIDELITY else 1e-3
    np.testing.assert_allclose(turned.states, turn(model, plain.states, angle), rtol=0, atol=size)
    assert turned.counts == plain.counts
    if name == FIDELITY:
        assert np.abs(plain.states - exact(name, "dropped")).max() > 1e-5


# Accuracy


@pytest.mark.parametrize(("solver", "order"), [("dopri5", 5), ("rodas4", 4), ("etdrk4", 4)])
def test_the_path_in_the_plane_converges_with_the_order_of_the_method(solver, order):
    """Though the Jacobian leaves out how the path turns with the heading."""
    model, errors = build(CAR), []
    # Fixed steps, where the explicit pair is stable and rounding plays no part.
    for step in (0.008, 0.004) if solver == "dopri5" else (0.04, 0.02):
        found = integrate(model, model.start(), solver, 1e6, step).states
        errors.append(np.abs(found - exact(CAR))[1:, [0, 1]].max())
    assert np.log2(errors[0] / errors[1]) > order - 1.2, errors


@pytest.fixture(scope="module", params=product(VEHICLES, STARTS), ids="-".join)
def case(request):
    """Model, start, and states at `TIMES` by LSODA, broken at the pulse's ends."""
    name, start = request.param
    model = build(name)
    x, path = model.start(start), []
    for a, b in pairwise(EDGES):
        times = [*(t for t in TIMES if a < t < b), b]

        def rates(t, x):
            return model.rhs(x, STEERING[name](t))

        solution = solve_ivp(rates, (a, b), x, "LSODA", times, rtol=1e-10, atol=1e-11)
        x = solution.y[:, -1]
        path += [state for t, state in zip(times, solution.y.T, strict=True) if np.any(t == TIMES)]
    return model, start, np.array(path)


TOLERANCES = {"dopri5": 1e-10, "rodas4": 1e-8, "etdrk4": 1e-7}


def test_compiled_solvers_and_sundials_agree_with_lsoda(case):
    model, start, expected = case
    for solver, tolerance in TOLERANCES.items():
        found = integrate(model, model.start(start), solver, tolerance).states
        assert np.abs(found - expected).max() < 1e-6, solver
    x, steering = model.start(start), STEERING[model.name]

    def rates(t, x, slope):
        slope[:] = model.rhs(x, steering(t))

    for a, b in pairwise(EDGES):
        # Straight running is at rest: steps would become too long to notice a wheel that lands.
        options = {"rtol": 1e-10, "atol": 1e-11, "max_num_steps": 100000, "max_step": 0.01}
        x = CVODE(rates, **options).solve(np.array([a, b]), x).y[-1]
    np.testing.assert_allclose(x, expected[-1], rtol=0, atol=1e-7)
