"""The path map converges to the full order, depends on the inputs alone, and knows its range."""

from dataclasses import replace

import numpy as np
import pytest

from tests.reducing import figure_errors, fitted
from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.reduction.methods import path_map
from vehiclemor.reduction.methods.path_map import PathMapModel
from vehiclemor.registry import component
from vehiclemor.simulation.algebraic import AlgebraicModel

START = "equilibrium"


def mapped(model: AlgebraicModel, maneuver: Maneuver, **settings: object) -> PathMapModel:
    reduced = fitted(model, maneuver, "path_map", **settings)
    assert isinstance(reduced, PathMapModel)
    return reduced


def travelling(signal, maneuver: Maneuver) -> Maneuver:
    """The maneuver with another travel: times (s) -> travel (m) and rack (m)."""
    return replace(maneuver, signal=lambda t, *_: np.column_stack(signal(t)))


@pytest.fixture(scope="module")
def unseen(nominal: Maneuver) -> list[Maneuver]:
    factors = [(0.7, 1.0), (2.0, 1.0), (1.0, 0.5), (1.0, 1.15), (1.3, -1.2)]
    return [nominal.perturbed(*pair) for pair in factors] + [component("maneuver", "chirp_travel")]


def test_error_on_unseen_inputs_falls_geometrically_with_the_degree(
    model: AlgebraicModel, nominal: Maneuver, unseen: list[Maneuver]
) -> None:
    degrees = (4, 6, 8, 10)
    maps = [mapped(model, nominal.perturbed(1.0, 1.2), degree=degree) for degree in degrees]
    for maneuver in unseen:
        full = model.simulate(maneuver)
        errors = np.array(
            [
                np.abs(reduced.simulate(maneuver, START).coordinates - full.coordinates).max()
                for reduced in maps
            ]
        )
        # An analytic function's: the same ratio from degree to degree.
        assert np.all(errors[1:] < 0.25 * errors[:-1])


def test_published_errors_are_met_from_degree_six_on(
    model: AlgebraicModel, nominal: Maneuver, unseen: list[Maneuver]
) -> None:
    reduced = mapped(model, nominal.perturbed(1.0, 1.2), degree=6)
    for maneuver in unseen:
        run, full = reduced.simulate(maneuver, START), model.simulate(maneuver)
        assert np.all(figure_errors(model, run.outputs, full) < [7.57e-5, 2.4e-5])


def test_powers_equal_the_chebyshev_series_to_rounding(
    model: AlgebraicModel, nominal: Maneuver, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = []
    real = path_map.chebyshev.cheb2poly
    monkeypatch.setattr(path_map.chebyshev, "cheb2poly", lambda c: found.append(c) or real(c))
    reduced = mapped(model, nominal, degree=14)
    run = reduced.simulate(nominal, START)
    x = (run.inputs[:, 0] - reduced.centre) * reduced.scale
    series = path_map.chebyshev.chebval(x, np.array(found).T).T
    np.testing.assert_allclose(run.coordinates, series, rtol=0, atol=1e-14)


def test_coordinates_depend_on_the_travel_alone(model: AlgebraicModel, nominal: Maneuver) -> None:
    reduced = mapped(model, nominal)
    heights = np.random.default_rng(5).uniform(-0.1, 0.1, nominal.samples)
    order = np.random.default_rng(6).permutation(nominal.samples)

    def run(values):
        return reduced.simulate(travelling(lambda t: (values, 0.0 * t), nominal), START)

    first, mixed = run(heights), run(heights[order])
    assert first.status == "ok"
    np.testing.assert_array_equal(mixed.coordinates, first.coordinates[order])
    # No equation is solved.
    assert set(first.counts.values()) == {0}


@pytest.mark.parametrize("samples", [2, 63, 64, 65, 128, 1000])
def test_every_number_of_samples_is_computed(
    model: AlgebraicModel, nominal: Maneuver, samples: int
) -> None:
    short = replace(nominal, duration=2.0, samples=samples)
    run = mapped(model, nominal).simulate(short, START)
    full = model.simulate(short)
    np.testing.assert_allclose(run.coordinates, full.coordinates, rtol=0, atol=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_leaving_the_travel_of_training_is_a_recorded_divergence(
    model: AlgebraicModel, nominal: Maneuver, sign: float
) -> None:
    reduced = mapped(model, nominal)
    higher = nominal.perturbed(1.0, 1.01 * sign)
    run = reduced.simulate(higher, START)
    first = int(np.flatnonzero(np.abs(run.inputs[:, 0]) > 0.1 * (1.0 + 2e-9))[0])
    assert run.status == "diverged"
    for part in ("-0.1 to 0.1 m", f"t = {run.time[first]:.6g} s", f"{run.inputs[first, 0]:.5g} m"):
        assert part in run.message
    assert np.isfinite(run.coordinates[:first]).all()
    assert np.isnan(run.coordinates[first:]).all()
    assert np.isnan(run.outputs[first:]).all()
    # Within the slack, 1e-9 of the range, it goes on.
    assert reduced.simulate(nominal.perturbed(1.0, sign * (1.0 + 1e-9)), START).status == "ok"
    assert reduced.simulate(nominal.perturbed(1.0, sign * (1.0 + 1e-8)), START).status == "diverged"


def test_another_rack_than_in_training_is_a_recorded_divergence(
    model: AlgebraicModel, nominal: Maneuver
) -> None:
    still = np.arange(nominal.samples) >= 500
    maneuver = travelling(lambda t: (0.05 * np.sin(t), 0.01 * still), nominal)
    run = mapped(model, nominal).simulate(maneuver, START)
    assert run.status == "diverged"
    assert "rack at 0.01 m at t = 5 s" in run.message
    assert np.isnan(run.coordinates).all(axis=1).tolist() == still.tolist()


def test_training_with_the_rack_moved_to_a_side_holds_there(
    model: AlgebraicModel, nominal: Maneuver
) -> None:
    maneuver = travelling(lambda t: (0.08 * np.sin(t) + 0.02, np.full(len(t), 0.03)), nominal)
    run, full = mapped(model, maneuver).simulate(maneuver, START), model.simulate(maneuver)
    np.testing.assert_allclose(run.coordinates, full.coordinates, rtol=0, atol=1e-7)


def test_extrapolation_goes_on_and_gets_worse_with_the_distance(
    model: AlgebraicModel, nominal: Maneuver
) -> None:
    reduced = mapped(model, nominal, outside="extrapolate")
    errors = []
    for factor in (1.0, 1.1, 1.3, 1.6):
        maneuver = nominal.perturbed(1.0, factor)
        run, full = reduced.simulate(maneuver, START), model.simulate(maneuver)
        assert run.status == "ok"
        errors.append(np.abs(run.coordinates - full.coordinates).max())
    assert np.all(np.array(errors[1:]) > 5.0 * np.array(errors[:-1]))


def test_wrong_training_and_inputs_are_refused(model: AlgebraicModel, nominal: Maneuver) -> None:
    steered = travelling(lambda t: (0.05 * np.sin(t), 0.03 * (t > 5.0)), nominal)
    with pytest.raises(InputError, match=r"constant rack: in training it moves from 0 to 0\.03 m"):
        mapped(model, steered)
    with pytest.raises(InputError, match="degree 10 needs 11 heights; training has 1"):
        mapped(model, nominal.perturbed(1.0, 0.0))
    with pytest.raises(InputError, match="degree 21 is above 20"):
        mapped(model, nominal, degree=21)
    with pytest.raises(InputError, match="degree is 0; it must be at least 1"):
        mapped(model, nominal, degree=0)
    with pytest.raises(InputError, match="outside is 'clamp'; allowed: stop, extrapolate"):
        mapped(model, nominal, outside="clamp")
    missing = travelling(lambda t: (np.where(t > 3.0, np.nan, 0.0), 0.0 * t), nominal)
    with pytest.raises(InputError, match=r"input z is not finite at t = 3\.01 s"):
        mapped(model, nominal).simulate(missing, START)
