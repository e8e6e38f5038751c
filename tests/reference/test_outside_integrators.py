"""Lane changes of both vehicles against LSODA of SciPy and CVODE of SUNDIALS."""

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sksundae.cvode import CVODE

from tests.oracles import high_fidelity_data, vehicle_lagrange
from vehiclemor.registry import component
from vehiclemor.simulation.build import build

# Model -> maneuver, and its inputs as the oracle has them.
VEHICLES = {
    "independent_suspension_vehicle": ("lane_change", vehicle_lagrange.lane_change),
    "high_fidelity_vehicle": ("rack_lane_change", high_fidelity_data.lane_change),
}
CASES = list(itertools.product(VEHICLES, ("equilibrium", "dropped")))
# The pulse of the steering is not smooth at its ends.
EDGES = (0.0, 1.0, 3.5, 4.0)
TIMES = np.array([0.05, 0.3, 0.9, 1.7, 2.6, 3.4, 4.0])


@pytest.fixture(scope="module", params=CASES, ids="-".join)
def case(request):
    """Model, start, and states at `TIMES` by LSODA, broken at the pulse's ends."""
    name, start = request.param
    vehicle, (_, steering) = build(name), VEHICLES[name]
    x, path = vehicle.start(start), []
    for a, b in itertools.pairwise(EDGES):
        times = [*(t for t in TIMES if a < t < b), b]

        def rates(t, x):
            return vehicle.derivative(x, steering(t))

        solution = solve_ivp(rates, (a, b), x, "LSODA", times, rtol=1e-10, atol=1e-11)
        x = solution.y[:, -1]
        path += [state for t, state in zip(times, solution.y.T, strict=True) if np.any(t == TIMES)]
    return vehicle, start, np.array(path)


@pytest.mark.parametrize(
    ("solver", "tolerance"),
    [
        ("dopri5", 1e-10),
        ("rodas4", 1e-8),
        ("ros34pw2", 1e-9),
        ("etdrk4", 1e-7),
        ("exponential_adams", 1e-9),
    ],
)
def test_compiled_solvers_agree_with_lsoda(case, solver, tolerance):
    vehicle, start, expected = case
    maneuver = component("maneuver", VEHICLES[vehicle.name][0])
    found = vehicle.simulate(maneuver, start, TIMES, solver, tolerance).states
    assert np.abs(found - expected).max() < 1e-6


def test_sundials_agrees_with_lsoda(case):
    vehicle, start, expected = case
    x, steering = vehicle.start(start), VEHICLES[vehicle.name][1]
    for a, b in itertools.pairwise(EDGES):

        def rates(t, x, slope):
            slope[:] = vehicle.derivative(x, steering(t))

        # Straight running is at rest: steps would become too long to notice a wheel that lands.
        options = {"rtol": 1e-10, "atol": 1e-11, "max_num_steps": 100000, "max_step": 0.01}
        x = CVODE(rates, **options).solve(np.array([a, b]), x).y[-1]
    np.testing.assert_allclose(x, expected[-1], rtol=0, atol=1e-7)
