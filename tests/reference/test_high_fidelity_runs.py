"""Energy, constraints and runs of the high-fidelity vehicle."""

from dataclasses import replace

import numpy as np
import pytest

from tests.oracles import high_fidelity_vehicle as oracle
from tests.oracles.high_fidelity_data import AXLES, NO_DAMPERS, PARAMETERS
from tests.oracles.projected_simulation import simulate_projected, without_stabilisation
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.simulation.control_periods import whole_space
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.integrators.catalogue import INTEGRATORS
from vehiclemor.simulation.trajectory import Trajectory
from vehiclemor.simulation.workspaces import Solver

NAME = "high_fidelity_vehicle"
N = 26
STARTS = ("equilibrium", "dropped")
LANE_CHANGE = component("maneuver", "rack_lane_change")
STRAIGHT = component("maneuver", "rack_straight_ahead")
REST = np.zeros(3)


@pytest.fixture(scope="module")
def vehicle() -> DynamicModel:
    return build(NAME)


def series(path: Trajectory, model: DynamicModel, *names: str) -> np.ndarray:
    return path.outputs[:, [model.outputs.index(name) for name in names]]


def loads(path: Trajectory, model: DynamicModel) -> np.ndarray:
    return series(path, model, *(f"Fz_{wheel}" for wheel in ("FL", "FR", "RL", "RR")))


# Energy and constraints


def test_energy_is_conserved_in_flight_without_dampers():
    model = build(NAME, overrides={"front_damping": 0.0, "rear_damping": 0.0})
    # Arms that swing this far turn the wheels farther than a car's: mechanics all the same.
    model = replace(model, definition=replace(model.definition, validity={}))
    numbers = PARAMETERS | NO_DAMPERS
    start = model.start()
    # High enough to fall for a second; the springs push the arms out.
    start[2] = 10.0
    start[N + 3 : N + 6] = 0.3, 0.2, 0.4
    times = np.linspace(0.0, 1.0, 41)
    path = model.simulate(STRAIGHT, start, times, "dopri5", 1e-11)
    assert not loads(path, model).any()
    assert np.abs(path.states[:, [10, 17, 20, 21]]).max(axis=0) == pytest.approx(0.75, abs=0.05)

    energies, stored = [], []
    for x in path.states:
        energies.append(oracle.energy(x[:N], x[N:], 0.0, 0.0, numbers))
        now = oracle.Instant(x[:N], x[N:], *REST, numbers)
        squeezed = [
            numbers[f"{axle}.spring.free_length"] - now.spring(k)[0] for k, axle in enumerate(AXLES)
        ]
        stiffness = [numbers[f"{axle}.spring.stiffness"] for axle in AXLES]
        stored.append(np.dot(stiffness, np.square(squeezed)) / 2)
    assert np.ptp(stored) > 1000.0
    assert np.ptp(energies) < 1e-9 * np.ptp(stored)


def test_violations_decay_as_the_gains_say_and_grow_without_them(vehicle):
    """With gains a = b = 50 1/s: (p + (p' + 50 p) t) e^(-50 t); without: p + p' t."""
    rng = np.random.default_rng(4)
    x = vehicle.start()
    x[6:20] += rng.uniform(-1e-3, 1e-3, 14)
    x[N + 6 : N + 20] = rng.uniform(-0.05, 0.05, 14)
    times = np.linspace(0.0, 0.1, 6)
    t = times[:, None]
    position, rate = vehicle.violations(x, REST)
    assert np.abs(position).min() > 1e-5
    laws = {
        vehicle: (position + (rate + 50.0 * position) * t) * np.exp(-50.0 * t),
        without_stabilisation(vehicle): position + rate * t,
    }
    for model, expected in laws.items():
        path = model.simulate(STRAIGHT, x, times, "dopri5", 1e-11)
        found = np.array([model.violations(state, REST)[0] for state in path.states])
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


# Runs


@pytest.mark.parametrize(
    ("start", "lateral", "at_rest_of_pulse", "heading", "lightest"),
    [
        ("equilibrium", 3.50000025, 3.4604313, 3.65694e-4, 2202.47),
        ("dropped", 3.49305892, 3.4583545, 3.21000e-4, 0.0),
    ],
)
def test_the_lane_change_is_the_published_one(
    vehicle, start, lateral, at_rest_of_pulse, heading, lightest
):
    times = np.linspace(0.0, 10.0, 10001)
    path = vehicle.simulate(LANE_CHANGE, start, times, "dopri5", 1e-9)
    x = path.states
    assert x[-1, 1] == pytest.approx(lateral, abs=2e-8)
    assert x[4500, 1] == pytest.approx(at_rest_of_pulse, abs=1e-6)
    assert x[-1, 3] == pytest.approx(heading, abs=2e-9)
    assert np.degrees(np.abs(x[:, 5]).max()) == pytest.approx(4.274, abs=1e-3)
    speeds = np.abs(series(path, vehicle, "lateral_speed", "vertical_speed")).max(axis=0)
    assert speeds[0] == pytest.approx(0.2433, abs=5e-5)
    assert speeds[1] == pytest.approx({"equilibrium": 0.0121, "dropped": 0.2247}[start], abs=5e-5)
    on_road = loads(path, vehicle)
    assert on_road.min() == pytest.approx(lightest, abs=0.05)
    assert on_road.max() == pytest.approx(5787.4, abs=0.1)
    across = np.column_stack([-np.sin(x[:, 3]), np.cos(x[:, 3])])
    slopes = vehicle.rhs_at(x, LANE_CHANGE.at(times))[:, N : N + 2]
    assert np.abs(np.sum(across * slopes, axis=1)).max() == pytest.approx(5.048, abs=1e-3)


def test_the_dropped_rear_wheels_are_in_the_air_for_a_while(vehicle):
    times = np.linspace(0.0, 0.2, 201)
    path = vehicle.simulate(LANE_CHANGE, "dropped", times, "dopri5", 1e-9)
    aloft = (loads(path, vehicle) == 0.0).sum(axis=0) * 1e-3
    np.testing.assert_allclose(aloft, [0.0, 0.0, 0.036, 0.036], atol=1.1e-3)
    assert path.remark.startswith("off the ground for a time: RL (first at 0 s), RR")
    assert not vehicle.simulate(LANE_CHANGE, times=[0.05, 4.0]).remark


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("solver", INTEGRATORS)
def test_the_loops_stay_closed(vehicle, start, solver):
    path = vehicle.simulate(LANE_CHANGE, start, solver=solver, tolerance=1e-6)
    drift = series(path, vehicle, "position_drift", "velocity_drift").max(axis=0)
    assert (drift < [1e-7, 1e-5]).all()


def test_a_run_with_brakes_starts_where_its_own_equations_rest(vehicle):
    run = vehicle.simulate("rack_braking_in_turn", times=[0.0])
    assert run.states[0].tolist() == run.model.start().tolist()


def test_stabilisation_does_not_change_the_run(vehicle):
    """A second way to hold the constraints: projection onto them, without any gain."""
    # It lands, then it steers from 1 s on.
    maneuver, start = replace(LANE_CHANGE, duration=2.0, samples=101), "dropped"
    # Tight, because errors are largest in the spin of wheels that have just landed.
    expected = simulate_projected(vehicle, maneuver, start, tolerance=1e-11)
    found = vehicle.simulate(maneuver, start, tolerance=1e-11)
    assert np.abs(found.states - expected.states).max() < 1e-6
    assert np.abs(found.coordinates - expected.coordinates)[:, :22].max() < 1e-7
    assert series(expected, vehicle, "position_drift", "velocity_drift").max() < 1e-12


@pytest.mark.parametrize("factor", [20.0, 25.0, -30.0, 50.0])
def test_a_rack_beyond_reach_ends_the_run(vehicle, factor):
    """The linkage locks near 1.3 rad; on the branch beyond it the closures hold all the same."""
    beyond, space = LANE_CHANGE.perturbed(amplitude=factor), whole_space(2 * N)
    run = vehicle.integrate(beyond, vehicle.start(), space, Solver("dopri5", 1e-6))
    assert run.status == "diverged"
    assert "steer_F" in run.message
    kept = np.isfinite(run.outputs).all(axis=1)
    assert kept[0]
    assert not kept[-1]
    steer = run.outputs[:, [vehicle.outputs.index(f"steer_{wheel}") for wheel in ("FL", "FR")]]
    assert np.abs(steer[kept]).max() < 1.1
    # As far as the run is kept, no corner has changed its branch.
    signs = []
    for x, u in zip(run.states[kept], run.inputs[kept], strict=True):
        closures = vehicle.descriptor(x, u)[2]
        corners = (closures[:6, 6:13], closures[6:, 13:20])
        signs.append([np.sign(np.linalg.det(np.delete(c, 4, axis=1))) for c in corners])
    assert len(np.unique(signs, axis=0)) == 1
