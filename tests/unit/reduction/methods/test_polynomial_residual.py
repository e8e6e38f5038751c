"""Fitted reduced equations are those of the model near the path, and so are their solutions."""

from dataclasses import replace

import numpy as np
import pytest

from tests.reducing import figure_errors, fitted, floor_errors
from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.metrics import rms
from vehiclemor.reduction.methods import polynomial_residual
from vehiclemor.reduction.methods.polynomial_residual import PolynomialResidualModel
from vehiclemor.reduction.polynomials.kernels import derivatives, monomials
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.registry import component
from vehiclemor.simulation.algebraic import AlgebraicModel

START = "equilibrium"


def reduced_model(
    model: AlgebraicModel, maneuver: Maneuver, **settings: object
) -> PolynomialResidualModel:
    reduced = fitted(model, maneuver, "polynomial_residual", **settings)
    assert isinstance(reduced, PolynomialResidualModel)
    return reduced


def exact_residual(reduced: PolynomialResidualModel, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    q = reduced.basis.mean + (x * reduced.scales) @ reduced.basis.vectors.T
    return reduced.model.residual_at(q, u) @ reduced.test


def near_the_path(
    reduced: PolynomialResidualModel, model: AlgebraicModel, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Points that the fit has not seen, and inputs with the rack at any place."""
    heights = np.column_stack([rng.uniform(-0.1, 0.1, 200), np.zeros(200)])
    path = reduced.reduced(np.array([model.solve(u) for u in heights]))
    x = path + rng.uniform(-0.04, 0.04, path.shape)
    return x, rng.uniform(-0.1, 0.1, (200, 2))


def test_fitted_equations_are_the_models_near_the_path(
    model: AlgebraicModel, nominal: Maneuver, rng: np.random.Generator
) -> None:
    snapshots = TrainingRun(model, nominal, START).at(np.linspace(0.0, 10.0, 101))
    errors = []
    for degree in (3, 4, 5):
        reduced = reduced_model(model, nominal, degree=degree)
        fitted_at = polynomial_residual._points(reduced.reduced(snapshots.coordinates), seed=0)
        seen = fitted_at, np.zeros((len(fitted_at), 2))
        both = [seen, near_the_path(reduced, model, rng)]
        errors.append(
            [rms(reduced.fitted_residual(*at) - exact_residual(reduced, *at)) for at in both]
        )
    # Nothing is overfitted, and every equation gains from every degree: an odd one from the next
    # odd degree most.
    fit, unseen = np.array(errors).swapaxes(0, 1)
    assert np.all(unseen < 1.5 * fit)
    assert np.all(unseen[1:] < unseen[:-1])
    assert np.all(unseen[2] < 0.01 * unseen[0])


def test_part_of_the_inputs_is_exact(
    model: AlgebraicModel, nominal: Maneuver, rng: np.random.Generator
) -> None:
    reduced = reduced_model(model, nominal)
    x, u = near_the_path(reduced, model, rng)
    other = 10.0 * u
    fitted_change = reduced.fitted_residual(x, other) - reduced.fitted_residual(x, u)
    exact_change = exact_residual(reduced, x, other) - exact_residual(reduced, x, u)
    np.testing.assert_allclose(fitted_change, exact_change, rtol=0, atol=1e-10)


def test_equations_are_scaled_to_the_unit_matrix(model: AlgebraicModel, nominal: Maneuver) -> None:
    reduced = reduced_model(model, nominal)
    jacobian = derivatives(reduced.coefficients, 3, 3)[:, 0, :]
    np.testing.assert_allclose(jacobian, np.eye(3), rtol=0, atol=1e-12)


@pytest.mark.parametrize(("rank", "degree"), [(2, 2), (3, 3)])
def test_compiled_polynomials_are_those_of_the_coefficients(
    model: AlgebraicModel, nominal: Maneuver, rng: np.random.Generator, rank: int, degree: int
) -> None:
    reduced = reduced_model(model, nominal, rank=rank, degree=degree)
    coefficients = rng.standard_normal(reduced.coefficients.shape)
    reduced = replace(reduced, coefficients=coefficients)
    x, u = rng.uniform(-1.0, 1.0, (20, rank)), np.tile(reduced.mean_inputs, (20, 1))
    powers = [np.prod(x[:, list(term)], axis=1) for term in monomials(rank, degree)]
    expected = np.column_stack(powers) @ coefficients
    np.testing.assert_allclose(reduced.fitted_residual(x, u), expected, rtol=0, atol=1e-12)
    # Derivatives, against differences of the values.
    slopes, lower = derivatives(coefficients, rank, degree), monomials(rank, degree - 1)
    at = np.column_stack([np.prod(x[:, list(term)], axis=1) for term in lower])
    for j, unit in enumerate(1e-6 * np.eye(rank)):
        change = reduced.fitted_residual(x + unit, u) - reduced.fitted_residual(x - unit, u)
        np.testing.assert_allclose(at @ slopes[j], change / 2e-6, rtol=0, atol=1e-7)


def test_chord_and_newton_solve_the_same_equations(
    model: AlgebraicModel, nominal: Maneuver
) -> None:
    maneuver = component("maneuver", "chirp_travel").perturbed(1.0, 0.9)
    runs = {
        solver: reduced_model(model, nominal, solver=solver, tolerance=1e-11).simulate(
            maneuver, START
        )
        for solver in ("chord", "newton")
    }
    chord, newton = runs["chord"], runs["newton"]
    np.testing.assert_allclose(chord.coordinates, newton.coordinates, rtol=0, atol=1e-11)
    assert chord.counts["jacobian_evaluations"] == 0
    assert newton.counts["jacobian_evaluations"] == newton.counts["iterations"]
    # Quadratic against linear convergence.
    assert newton.counts["iterations"] < 0.7 * chord.counts["iterations"]


@pytest.mark.parametrize("solver", ["chord", "newton"])
def test_solutions_are_zeros_of_the_fitted_equations(
    model: AlgebraicModel, nominal: Maneuver, solver: str
) -> None:
    reduced = reduced_model(model, nominal, solver=solver, tolerance=1e-12)
    run = reduced.simulate(nominal, START)
    residual = reduced.fitted_residual(reduced.reduced(run.coordinates), run.inputs)
    assert np.abs(residual).max() < 1e-10
    # Nothing of the solution is outside of the subspace.
    best = reduced.best_approximation(run.coordinates)
    np.testing.assert_allclose(best, run.coordinates, rtol=0, atol=1e-13)


@pytest.mark.parametrize("degree", [3, 4])
def test_three_coordinates_come_near_the_floor(
    model: AlgebraicModel, nominal: Maneuver, degree: int
) -> None:
    reduced = reduced_model(model, nominal.perturbed(1.0, 1.2), rank=3, degree=degree)
    for factors in ((0.7, 1.0), (2.0, 1.0), (1.0, 0.5), (1.0, -1.0)):
        full = model.simulate(nominal.perturbed(*factors))
        run = reduced.simulate(nominal.perturbed(*factors), START)
        errors = figure_errors(model, run.outputs, full)
        assert np.all(errors < 1.5 * floor_errors(model, reduced, full))


def test_seed_moves_the_fit_and_not_the_solution(model: AlgebraicModel, nominal: Maneuver) -> None:
    full = model.simulate(nominal)
    first, other = (reduced_model(model, nominal, seed=seed) for seed in (0, 1))
    assert not np.array_equal(first.coefficients, other.coefficients)
    runs = [reduced.simulate(nominal, START).coordinates for reduced in (first, other)]
    error = np.abs(runs[0] - full.coordinates).max()
    assert 0.0 < np.abs(runs[0] - runs[1]).max() < 0.05 * error


def test_run_without_a_solution_is_recorded(model: AlgebraicModel, nominal: Maneuver) -> None:
    run = reduced_model(model, nominal).simulate(nominal.perturbed(1.0, 20.0), START)
    assert run.status == "diverged"
    assert "at t = " in run.message
    assert np.isnan(run.coordinates[-1]).all()


def test_model_with_inputs_that_are_not_linear_is_refused(
    model: AlgebraicModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert polynomial_residual.METHOD.accepts(model) == (True, "")
    real = AlgebraicModel.residual

    def bent(self, q, u):
        return real(self, q, u) + 0.01 * np.asarray(u)[1] ** 2

    monkeypatch.setattr(AlgebraicModel, "residual", bent)
    accepted, reason = polynomial_residual.METHOD.accepts(model)
    assert not accepted
    assert "linearly" in reason


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"rank": 9}, "rank 9 is above the 8 coordinates"),
        ({"rank": 4, "snapshots": 3}, "rank 4 is above the number of snapshots 3"),
        ({"snapshots": 10**6}, "snapshots is 1000000; it must be at most"),
        ({"degree": 9}, "degree 9 is above 8"),
        ({"rank": 6, "degree": 4}, "degree 4 with rank 6 has 210 monomials; at most 150"),
        ({"solver": "broyden"}, "solver is 'broyden'; allowed: chord, newton"),
        ({"tolerance": 0.0}, "tolerance is 0; it must be above 0"),
        ({"seed": -1}, "seed is -1; it must be at least 0"),
    ],
)
def test_wrong_settings_are_refused(
    model: AlgebraicModel, nominal: Maneuver, settings: dict[str, object], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        reduced_model(model, nominal, **settings)


def test_training_without_motion_is_refused(model: AlgebraicModel, nominal: Maneuver) -> None:
    with pytest.raises(InputError, match="doesn't move in training"):
        reduced_model(model, nominal.perturbed(1.0, 0.0))
