"""Projected equations of motion: exact in the whole space; only the subspace counts."""

from dataclasses import replace

import numpy as np
import pytest

from tests.oracles import vehicle_lagrange as oracle
from vehiclemor.exceptions import InputError
from vehiclemor.inputs.steering import lane_change
from vehiclemor.inputs.suspension import sine_travel
from vehiclemor.reduction.methods import pod
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.validation import validated
from vehiclemor.simulation.build import build
from vehiclemor.simulation.control_periods import ControlPeriods, whole_space
from vehiclemor.simulation.workspaces import Solver

N = 14
STATE, COORDINATES = "state", "coordinates"
TIMES = np.linspace(0.0, 4.0, 41)
# No dampers, no shear forces of the tires: nothing takes energy away.
CONSERVATIVE = {"front_damping": 0.0, "rear_damping": 0.0, "PKX1": 0.0, "PKX2": 0.0, "PKY1": 0.0}


@pytest.fixture(scope="module")
def model():
    return build("independent_suspension_vehicle")


def in_windows(form, edges, mean=0.0, mixing=None):
    """The identity, or any regular matrix, as basis in every window."""
    size = N if form == COORDINATES else 2 * N
    basis = np.eye(size) if mixing is None else mixing
    windows = len(edges) - 1
    lifts, drops = np.zeros((windows, size, 2 * N)), np.zeros((windows, size, 2 * N))
    lifts[:, :, :size], drops[:, :, :size] = basis, np.linalg.inv(basis).T
    ranks = np.full(windows, 2 * N, dtype=np.int64)
    return ControlPeriods(
        form, np.array(edges), np.full((windows, 2 * N), mean), lifts, drops, ranks
    )


def fitted(model, start="equilibrium", maneuver=lane_change, **chosen):
    settings = validated(pod.METHOD, "ode", chosen)
    pod.check(model, settings)
    return pod.fit(model, [TrainingRun(model, maneuver, start)], settings)


@pytest.mark.parametrize("form", [STATE, COORDINATES])
@pytest.mark.parametrize("start", ["equilibrium", "dropped"])
def test_the_whole_space_gives_the_full_model(model, form, start):
    generator = np.random.default_rng(3)
    size = N if form == COORDINATES else 2 * N
    mixing = np.eye(size) + 0.1 * generator.normal(size=(size, size))
    spaces = in_windows(form, [0.0, 0.7, 2.0, 25.0], mean=0.3, mixing=mixing)
    state = model.start(start)
    full = model.integrate(lane_change, state, whole_space(2 * N), Solver("dopri5", 1e-10, TIMES))
    reduced = model.integrate(lane_change, state, spaces, Solver("dopri5", 1e-10, TIMES))
    assert reduced.status == "ok"
    np.testing.assert_allclose(reduced.states, full.states, rtol=1e-7, atol=1e-6)


def test_projected_mechanics_keep_the_energy():
    model = build("independent_suspension_vehicle", overrides=CONSERVATIVE)
    maneuver = replace(lane_change, amplitude_factor=0.0, duration=3.0, samples=151)
    one_window = {"control_period": 3.0, "snapshots": 100, "rank": 4, "tolerance": 1e-10}
    reduced = fitted(model, "dropped", maneuver, **one_window)
    run = reduced.simulate(maneuver, "dropped")
    assert run.status == "ok"
    p = {**oracle.PARAMETERS, "c_f": 0.0, "c_r": 0.0, "PKX1": 0.0, "PKX2": 0.0, "PKY1": 0.0}
    energy = np.array([oracle.energy(x, p) for x in run.states[::5]])
    exchanged = np.ptp([0.5 * p["m_s"] * x[16] ** 2 for x in run.states])
    assert exchanged > 1.0
    assert np.ptp(energy) < 1e-5 * exchanged


def test_spectral_abscissas_are_those_of_the_projected_jacobian(model):
    reduced = fitted(model, "dropped", formulation="state", inner_product="euclidean")
    spaces, expected = reduced.spaces, []
    for k, rank in enumerate(spaces.ranks):
        trial, test = spaces.trial_basis[k, :rank], spaces.test_basis[k, :rank]
        small = test @ model.jacobian(spaces.means[k], [0.0]) @ trial.T
        expected.append(np.linalg.eigvals(small).real.max())
    np.testing.assert_allclose(reduced.spectral_abscissas, expected, rtol=1e-6, atol=1e-6)
    assert reduced.spectral_abscissa == max(reduced.spectral_abscissas) > 100.0


def test_divergence_is_recorded_with_its_time(model):
    reduced = fitted(model, "dropped", formulation="paired", inner_product="range")
    run = reduced.simulate(lane_change, "dropped")
    assert run.status == "diverged"
    assert "t = " in run.message
    assert run.counts["rhs_calls"] > 0
    failed = ~np.isfinite(run.states).all(axis=1)
    assert failed.any()
    assert not np.isfinite(run.states[np.argmax(failed) :]).any()


def test_windows_refuse_runs_of_different_durations(model):
    for built, longer in ((model, lane_change), (build("double_wishbone"), sine_travel)):
        runs = [TrainingRun(built, m, "dropped") for m in (longer, replace(longer, duration=5.0))]
        with pytest.raises(InputError, match=r"not 5, (25|10) s"):
            pod.fit(built, runs, validated(pod.METHOD, built.kind, {}))
