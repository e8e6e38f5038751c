"""Reduced models meet the published bounds, stay near the floor, and are exact at full rank."""

from dataclasses import replace

import numpy as np
import pytest

from tests.reducing import figure_errors, fitted, floor_errors, two_way_travel
from vehiclemor.errors import InputError
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.reduction.projection.bases import Basis
from vehiclemor.registry import component
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.trajectory import Trajectory

# Masoudi et al. (2015): RMS errors of spindle y (m) and second Euler angle (rad), r = 3.
PUBLISHED = np.array([7.57e-5, 2.4e-5])


@pytest.mark.parametrize("test_space", ["least_squares", "galerkin"])
def test_three_coordinates_meet_the_published_errors(
    model: AlgebraicModel, nominal: Maneuver, full: Trajectory, test_space: str
) -> None:
    reduced = fitted(model, nominal, "pod", rank=3, test_space=test_space)
    run = reduced.simulate(nominal, model.starts[0])
    assert reduced.effective_rank == 3
    assert np.all(figure_errors(model, run.outputs, full) < PUBLISHED)


def test_least_squares_is_near_the_projection_floor_and_falls_with_the_rank(
    model: AlgebraicModel, nominal: Maneuver, full: Trajectory
) -> None:
    errors = []
    for rank in (1, 2, 3, 4):
        reduced = fitted(model, nominal, "pod", rank=rank)
        run = reduced.simulate(nominal, model.starts[0])
        errors.append(figure_errors(model, run.outputs, full))
        assert np.all(errors[-1] < 1.5 * floor_errors(model, reduced, full))
        # No trajectory in the subspaces is nearer in the coordinates' norm than the projection.
        best = reduced.best_approximation(full.states) - full.coordinates
        assert np.sum(best**2) <= np.sum((run.coordinates - full.coordinates) ** 2)
    assert np.all(np.array(errors[1:]) < 0.2 * np.array(errors[:-1]))


def test_singular_values_beyond_the_fourth_are_rounding(
    model: AlgebraicModel, nominal: Maneuver
) -> None:
    for basis in fitted(model, nominal, "pod").bases:
        assert basis.singular_values[3] > 1e-6
        assert np.all(basis.singular_values[4:] < 1e-14)
    # So the rank cut leaves four of six coordinates; without it all six stay.
    assert fitted(model, nominal, "pod", rank=6).effective_rank == 4
    assert fitted(model, nominal, "pod", rank=6, rank_tolerance=0.0).effective_rank == 6


@pytest.mark.parametrize("galerkin", [False, True])
def test_full_rank_equals_full_order(
    model: AlgebraicModel, rng: np.random.Generator, galerkin: bool
) -> None:
    maneuver = two_way_travel()
    turned, _ = np.linalg.qr(rng.standard_normal((8, 8)))
    basis = Basis(model.design + 0.05 * rng.standard_normal(8), turned, np.ones(8))
    fit = fitted(model, maneuver, "pod")
    tests = (turned, turned) if galerkin else None
    run = replace(fit, bases=(basis, basis), tests=tests).simulate(maneuver, model.starts[0])
    assert run.status == "ok"
    np.testing.assert_allclose(
        run.coordinates, model.simulate(maneuver).coordinates, rtol=0, atol=1e-11
    )


def test_snapshots_are_hit_where_they_span_the_subspace(
    model: AlgebraicModel, nominal: Maneuver
) -> None:
    reduced = fitted(model, nominal, "pod", rank=4)
    for k, basis in enumerate(reduced.bases):
        times = np.linspace(5.0 * k, 5.0 * k + 5.0, 10)
        exact = model.simulate(nominal, times=times).coordinates
        at = basis.mean + (exact - basis.mean) @ basis.vectors @ basis.vectors.T
        np.testing.assert_allclose(at, exact, rtol=0, atol=1e-14)
        # Both ends of the window are snapshots.
        assert basis.mean == pytest.approx(exact.mean(axis=0), abs=1e-15)


def test_bases_of_the_nominal_run_fail_at_another_frequency(
    model: AlgebraicModel, nominal: Maneuver
) -> None:
    faster = nominal.perturbed(frequency=2.0)
    reference = model.simulate(faster)

    def errors(policy: str, rank: int) -> np.ndarray:
        reduced = fitted(model, faster, "pod", policy, rank=rank)
        return figure_errors(model, reduced.simulate(faster, model.starts[0]).outputs, reference)

    # Figure 14: three coordinates fail, as many as the snapshots have directions follow.
    assert np.all(errors("nominal", 3) > [1.0, 10.0] * PUBLISHED)
    assert np.all(errors("nominal", 4) < PUBLISHED)
    # It is the training that fails, not the number of coordinates.
    assert np.all(errors("matched", 3) < 0.1 * errors("nominal", 3))


def test_fixed_basis_is_pod_with_one_control_period(
    model: AlgebraicModel, nominal: Maneuver
) -> None:
    one = fitted(model, nominal, "fixed_basis", snapshots=20, rank=3)
    same = fitted(model, nominal, "pod", snapshots=20, rank=3, control_period=10.0)
    assert len(one.bases) == len(same.bases) == 1
    runs = [reduced.simulate(nominal, model.starts[0]) for reduced in (one, same)]
    np.testing.assert_array_equal(runs[0].coordinates, runs[1].coordinates)


def test_replay_returns_its_training_run(
    model: AlgebraicModel, nominal: Maneuver, full: Trajectory
) -> None:
    replay = fitted(model, nominal, "replay", "nominal")
    for maneuver in (nominal, nominal.perturbed(2.0, 0.5), component("maneuver", "chirp_travel")):
        run = replay.simulate(maneuver, model.starts[0])
        np.testing.assert_array_equal(run.coordinates, full.coordinates)
        np.testing.assert_array_equal(run.outputs, full.outputs)
        assert set(run.counts.values()) == {0}
        assert run.seconds == 0.0
        np.testing.assert_array_equal(run.inputs, maneuver.at(maneuver.times))
    assert replay.effective_rank == 0
    assert replay.best_approximation(full.states) is None


def test_offline_cost_counts_the_training_simulations(
    model: AlgebraicModel, nominal: Maneuver
) -> None:
    few, many = (fitted(model, nominal, "pod", snapshots=n).offline.evaluations for n in (5, 50))
    # Every snapshot but the two at the design position takes at least two Newton iterations.
    assert 2 * 8 <= few < many
    assert fitted(model, nominal, "full_order").offline.evaluations == 0


@pytest.mark.parametrize(
    ("method", "settings", "words"),
    [
        ("pod", {"rank": 9, "snapshots": 20}, "rank 9 .* 8 coordinates"),
        ("pod", {"rank": 6, "snapshots": 5}, "rank 6 .* snapshots 5"),
        ("fixed_basis", {"rank": 9}, "rank 9 .* 8 coordinates"),
        ("pod", {"reversed_coordinates": "theta"}, "'theta'"),
        ("pod", {"rank": 0}, "rank is 0"),
        ("pod", {"control_period": 0}, "control_period is 0"),
        ("pod", {"test_space": "petrov"}, "least_squares, galerkin"),
        ("pod", {"ranks": 3}, "'ranks'"),
    ],
)
def test_wrong_settings_are_named(
    model: AlgebraicModel, nominal: Maneuver, method: str, settings: dict, words: str
) -> None:
    with pytest.raises(InputError, match=words):
        fitted(model, nominal, method, **settings)


def test_iteration_that_fails_is_a_result(model: AlgebraicModel, nominal: Maneuver) -> None:
    reduced = fitted(model, nominal, "pod", "nominal", rank=3, test_space="galerkin")
    broken = tuple(np.zeros_like(test) for test in reduced.tests)
    run = replace(reduced, tests=broken).simulate(nominal, model.starts[0])
    assert run.status == "diverged"
    assert "singular at t = 0 s" in run.message
    assert np.isnan(run.coordinates).all()
    assert np.isnan(run.outputs[:, 0]).all()
