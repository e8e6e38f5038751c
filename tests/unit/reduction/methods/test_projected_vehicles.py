"""Contenders that keep the full equations: softened slip, slaved spins, global projections."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

import vehiclemor as vm
from vehiclemor.errors import InputError
from vehiclemor.reduction.methods import (
    balanced_pod,
    fixed_basis,
    global_pod,
    quasi_steady_wheels,
    softened_slip,
)
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.validation import validated
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.simulation.linearisation import reduced_jacobian
from vehiclemor.simulation.projection_windows import whole_space
from vehiclemor.simulation.system import Solver
from vehiclemor.steering_maneuvers import (
    lane_change,
    rack_lane_change,
    rack_step_steer,
    step_steer,
    straight_ahead,
)

VEHICLES = ("independent_suspension_vehicle", "high_fidelity_vehicle")
TIGHT = 1e-8


def fitted(method, model, training=(), **settings):
    complete = validated(method.METHOD, model.kind, settings)
    method.METHOD.check(model, complete)
    return method.fit(model, training, complete)


def jacobian(model, reduced):
    """Of the reduced equations at straight running."""
    start = model.start()
    y = reduced.spaces.test_basis[0] @ (start - reduced.spaces.means[0])
    return reduced_jacobian(model, reduced.spaces, 0, y)


@pytest.fixture(scope="module")
def vehicle():
    return vm.model("independent_suspension_vehicle")


@pytest.fixture(scope="module")
def detailed():
    return vm.model("high_fidelity_vehicle")


@pytest.fixture(scope="module")
def training(vehicle):
    """Runs of different durations, from both starts."""
    return [
        TrainingRun(vehicle, lane_change.perturbed(1.0, 1.3), "equilibrium"),
        TrainingRun(vehicle, lane_change.perturbed(1.4, -0.9), "dropped"),
        TrainingRun(vehicle, step_steer.perturbed(1.0, 0.7), "dropped"),
    ]


# Softened slip


@pytest.mark.parametrize("name", VEHICLES)
def test_softened_by_one_is_the_full_model(name):
    model = vm.model(name, {"initial_speed": 17.0, "tire_damping": 900.0})
    maneuver = step_steer if name == VEHICLES[0] else rack_step_steer
    run = fitted(softened_slip, model, factor=1.0).simulate(maneuver, "dropped")
    full = model.simulate(maneuver, "dropped", solver="dopri5", tolerance=1e-4)
    np.testing.assert_array_equal(run.states, full.states)
    np.testing.assert_array_equal(run.outputs, full.outputs)


def test_outputs_of_softened_states_are_those_of_the_original_tires(vehicle):
    run = fitted(softened_slip, vehicle).simulate(step_steer, "equilibrium")
    np.testing.assert_array_equal(run.outputs, vehicle.outputs_at(run.states, run.inputs))


@pytest.mark.parametrize("name", VEHICLES)
def test_softening_lowers_the_fastest_eigenvalue_by_its_factor(name):
    model = vm.model(name)
    fastest = [
        np.abs(np.linalg.eigvals(VehicleShape(m).linearised.a)).max()
        for m in (model, softened_slip.softened(model, 2.0))
    ]
    assert fastest[0] / fastest[1] == pytest.approx(2.0, rel=0.05)


# Quasi-steady wheels


def slow_and_fast(model):
    """Linearisation of the shape, and which of its states are spins."""
    shape = VehicleShape(model)
    spins = quasi_steady_wheels.spin_angles(model) + len(model.coordinates)
    return shape, np.isin(shape.kept, spins)


def test_slaved_spins_leave_the_slow_eigenvalues(vehicle):
    shape, fast = slow_and_fast(vehicle)
    full = np.linalg.eigvals(shape.linearised.a)
    full = full[np.abs(full) < 120.0]
    reduced = fitted(quasi_steady_wheels, vehicle)
    values = np.linalg.eigvals(jacobian(vehicle, reduced))
    assert np.abs(values).max() < 120.0
    assert len(full) == (~fast).sum()
    spins = np.abs(np.linalg.eigvals(shape.linearised.a[np.ix_(fast, fast)])).min()
    assert spins == pytest.approx(155.4, abs=0.1)
    for value in full[np.abs(full) < 12.0]:
        # Relative errors are of the first order in slow over fast.
        nearest = np.abs(values - value).min()
        assert nearest < np.abs(value) ** 2 / spins + 1e-6


def test_slaved_spins_keep_the_static_gain(vehicle):
    shape, fast = slow_and_fast(vehicle)
    linear = shape.linearised
    reduced = fitted(quasi_steady_wheels, vehicle)
    a = jacobian(vehicle, reduced)
    left = np.setdiff1d(np.arange(28), shape.kept[fast])
    places = np.searchsorted(left, shape.kept[~fast])
    inner = a[np.ix_(places, places)]
    gains = [
        np.linalg.lstsq(matrix, -drive, rcond=1e-9)[0]
        for matrix, drive in ((linear.a, linear.b[:, 0]), (inner, linear.b[~fast, 0]))
    ]
    names = [name for k, name in enumerate(shape.names) if not fast[k]]
    found = dict(zip(names, gains[1], strict=True))
    whole = dict(zip(shape.names, gains[0], strict=True))
    for name in ("v", "r", "phi"):
        assert found[name] == pytest.approx(whole[name], rel=1e-6)


@pytest.mark.parametrize("speed", [14.0, 20.0, 27.0])
def test_slaved_spins_keep_straight_runs_at_every_speed(vehicle, speed):
    # An explicit pair at its limit of stability makes rounding grow to its tolerance.
    reduced = fitted(quasi_steady_wheels, vehicle, solver="rodas4")
    start = vm.model(vehicle.name, {"initial_speed": speed}).start()
    run = reduced.simulate(straight_ahead, start)
    assert np.abs(run.coordinates[:, 1]).max() < 1e-9
    assert run.speeds[-1, 0] == pytest.approx(speed, abs=1e-5)
    # The wheels roll: neither driven nor braked.
    np.testing.assert_allclose(run.speeds[-1, -4:], start[-4:], rtol=1e-7)


def test_equations_in_the_heading_frame_are_the_vehicle_s(detailed):
    shape = VehicleShape(detailed)
    space = whole_space(2 * len(detailed.coordinates))
    maneuver, times = rack_step_steer.perturbed(1.0, 1.5), np.linspace(0.0, 5.0, 6)
    reduced = fitted(quasi_steady_wheels, detailed)
    full = detailed.simulate(maneuver, times=times, tolerance=TIGHT)
    assert full.states[-1, 3] > 1.0
    run = reduced.system.run(maneuver, detailed.start(), space, Solver("dopri5", TIGHT, times))
    turned = np.array([shape.of(row[None])[0] for row in full.states])
    np.testing.assert_allclose(run.path[:, shape.kept], turned, rtol=0, atol=1e-6)
    np.testing.assert_allclose(run.path[:, :4], full.states[:, :4], rtol=0, atol=1e-7)


def test_straight_runs_of_the_detailed_vehicle_head_anywhere(detailed):
    """A car that starts with another heading does the same, turned."""
    reduced = fitted(quasi_steady_wheels, detailed)
    start, turned = detailed.start(), detailed.start()
    turned[3] = 0.8
    turned[26:28] = 20.0 * np.cos(0.8), 20.0 * np.sin(0.8)
    runs = [reduced.simulate(rack_lane_change, state) for state in (start, turned)]
    for name in ("lateral_speed", "yaw_rate", "roll", "longitudinal_speed"):
        place = detailed.outputs.index(name)
        np.testing.assert_allclose(*(run.outputs[:, place] for run in runs), rtol=0, atol=1e-4)


# Balanced POD


def test_balanced_modes_are_biorthogonal_and_ordered(vehicle, training):
    reduced = fitted(balanced_pod, vehicle, training, rank=8)
    lift, drop = reduced.spaces.trial_basis[0], reduced.spaces.test_basis[0]
    assert reduced.effective_rank == 8 + 1
    # And 7 quadratures.
    assert len(lift) == 8 + 1 + 7
    np.testing.assert_allclose(drop @ lift.T, np.eye(len(lift)), rtol=0, atol=1e-10)


def test_balanced_modes_diagonalise_both_gramians(rng):
    """Balanced POD of impulse responses is balanced truncation: Hankel singular values."""
    n = 6
    a = -np.diag(np.arange(1.0, n + 1)) + 0.3 * rng.normal(size=(n, n))
    b, c = rng.normal(size=(n, 1)), rng.normal(size=(2, n))
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n] = a
    # One more state that nothing changes, seen by nobody.
    still = np.eye(n + 1)[n], np.eye(n + 1)[n]
    reach = solve_continuous_lyapunov(a, -b @ b.T)
    see = solve_continuous_lyapunov(a.T, -c.T @ c)
    values, vectors = np.linalg.eigh(reach)
    snapshots = np.vstack([vectors * np.sqrt(np.maximum(values, 0.0)), np.ones(n)])
    lift, drop, hankel = balanced_pod.balanced(
        whole, still, snapshots, np.column_stack([c, np.zeros(2)]), 3
    )
    expected = np.sqrt(np.sort(np.linalg.eigvals(reach @ see).real)[::-1])
    np.testing.assert_allclose(hankel[:n], expected, rtol=1e-6, atol=1e-9)
    assert np.all(np.diff(hankel) <= 0.0)
    np.testing.assert_allclose(lift[:, :n] @ see @ lift[:, :n].T, np.diag(expected[:3]), atol=1e-9)
    np.testing.assert_allclose(
        drop[:, :n] @ reach @ drop[:, :n].T, np.diag(expected[:3]), atol=1e-9
    )


def test_all_balanced_modes_are_the_full_model(vehicle, training):
    most = len(VehicleShape(vehicle).kept) - 1
    reduced = fitted(balanced_pod, vehicle, training, rank=most, tolerance=TIGHT)
    assert reduced.effective_rank == 21
    unseen = step_steer.perturbed(1.0, -1.2)
    run, full = reduced.simulate(unseen, "dropped"), vehicle.simulate(unseen, "dropped")
    np.testing.assert_allclose(run.states, full.states, rtol=0, atol=1e-5)


# Place and heading


@pytest.mark.parametrize("method", [balanced_pod, global_pod], ids=["balanced", "global"])
def test_place_and_heading_are_no_modes(vehicle, training, method):
    reduced = fitted(method, vehicle, training, rank=3)
    states = vehicle.simulate(step_steer, "dropped").states
    best = reduced.best_approximation(states)
    np.testing.assert_allclose(best[:, [0, 1, 3]], states[:, [0, 1, 3]], rtol=0, atol=1e-11)


@pytest.mark.parametrize("method", [balanced_pod, global_pod], ids=["balanced", "global"])
def test_a_reduced_car_starts_anywhere(vehicle, training, method):
    """Place and heading are quadratures: what moves the car does not feel them."""
    reduced = fitted(method, vehicle, training, rank=3)
    start, moved = vehicle.start("dropped"), vehicle.start("dropped")
    moved[[0, 1, 3]] = 30.0, -7.0, 0.9
    here, there = (reduced.simulate(step_steer, state) for state in (start, moved))
    x, y = here.coordinates[:, 0], here.coordinates[:, 1]
    cosine, sine = np.cos(0.9), np.sin(0.9)
    expected = np.column_stack([30.0 + cosine * x - sine * y, -7.0 + sine * x + cosine * y])
    np.testing.assert_allclose(there.coordinates[:, :2], expected, rtol=0, atol=1e-2)
    np.testing.assert_allclose(there.coordinates[:, 3], here.coordinates[:, 3] + 0.9, atol=1e-3)


@pytest.mark.parametrize("method", [balanced_pod, global_pod], ids=["balanced", "global"])
def test_a_dropped_car_stays_in_its_lane(vehicle, training, method):
    """Modes are symmetric or lateral: training runs count with their mirror images."""
    reduced = fitted(method, vehicle, training, rank=5, solver="rodas4")
    trajectory = reduced.simulate(straight_ahead, "dropped")
    assert np.abs(trajectory.coordinates[:, 1]).max() < 1e-4


# Global POD


def test_all_modes_of_the_coordinates_are_the_full_model(vehicle, training):
    reduced = fitted(global_pod, vehicle, training, rank=10, tolerance=TIGHT)
    assert reduced.effective_rank == 14
    unseen = step_steer.perturbed(1.0, -1.2)
    run, full = reduced.simulate(unseen, "dropped"), vehicle.simulate(unseen, "dropped")
    np.testing.assert_allclose(run.states, full.states, rtol=0, atol=1e-5)


def test_global_modes_are_orthonormal_in_energy_beside_place_and_heading(vehicle, training):
    reduced = fitted(global_pod, vehicle, training)
    lift, drop = reduced.spaces.trial_basis[0, :12, :14], reduced.spaces.test_basis[0, :12, :14]
    np.testing.assert_allclose(drop @ lift.T, np.eye(12), rtol=0, atol=1e-12)
    mass = vehicle.mass_matrix(vehicle.start())
    np.testing.assert_allclose(lift[4:] @ mass @ lift[4:].T, np.eye(8), rtol=0, atol=1e-12)
    assert not lift[4:, [0, 1, 3]].any()
    # Rolling straight ahead needs no mode: it is a vector of its own.
    rolling = vehicle.derivative(vehicle.start(), np.zeros(1))[10:14]
    np.testing.assert_allclose(lift[4:, 10:] @ rolling, 0.0, atol=1e-10)


# Windows in time


def test_pod_in_windows_refuses_runs_of_different_durations(vehicle, training):
    with pytest.raises(InputError, match="training runs of one duration, not 5, 25 s") as caught:
        fitted(fixed_basis, vehicle, training)
    assert "\n" not in str(caught.value)


def test_ranks_beyond_the_states_are_refused(vehicle):
    with pytest.raises(InputError, match="rank 21 is above the 20 states"):
        fitted(balanced_pod, vehicle, rank=21)
    with pytest.raises(InputError, match="rank 11 is above the 10 coordinates"):
        fitted(global_pod, vehicle, rank=11)


@pytest.mark.parametrize(
    "method",
    [softened_slip, quasi_steady_wheels, balanced_pod, global_pod],
    ids=lambda m: m.__name__.rpartition(".")[2],
)
def test_a_model_that_is_no_vehicle_is_refused(method):
    accepted, reason = method.METHOD.accepts(SimpleNamespace(name="box", kind="ode", planar=()))
    assert not accepted
    assert "no vehicle" in reason
