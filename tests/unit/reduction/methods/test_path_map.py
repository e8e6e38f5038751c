"""The path map converges to the full order, depends on the inputs alone, and knows its range."""

from dataclasses import replace

import numpy as np
import pytest

from tests.reducing import fitted
from vehiclemor.exceptions import InputError
from vehiclemor.registry import component

START = "equilibrium"


def mapped(model, maneuver, **settings):
    return fitted(model, maneuver, "path_map", **settings)


def travelling(signal, maneuver):
    """The maneuver with another travel: times (s) -> travel (m) and rack (m)."""
    return replace(maneuver, signal=lambda t, *_: np.column_stack(signal(t)))


@pytest.fixture(scope="module")
def both():
    """Travel and rack over a rectangle of 0.12 m and 0.036 m to both sides."""
    return component("maneuver", "travel_and_rack").perturbed(1.0, 1.2)


@pytest.fixture(scope="module")
def unseen():
    factors = {"": (1.7, -1.15), "_sweep": (1.3, 1.1), "_multisine": (0.8, -1.0)}
    return [
        component("maneuver", f"travel_and_rack{name}").perturbed(*pair)
        for name, pair in factors.items()
    ]


def largest_error(model, reduced, maneuver):
    run, full = reduced.simulate(maneuver, START), model.simulate(maneuver)
    assert run.status == "ok"
    pairs = ((run.coordinates, full.coordinates), (run.outputs, full.outputs))
    return max(np.abs(found - exact).max() for found, exact in pairs)


@pytest.mark.parametrize("moving", ["both", "travel"])
def test_error_on_unseen_inputs_falls_geometrically_with_the_degree(
    model, nominal, both, unseen, moving
):
    if moving == "travel":
        both, unseen = nominal.perturbed(1.0, 1.2), [nominal.perturbed(0.7, -1.1)]
    maps = [mapped(model, both, cells=2, degree=degree) for degree in (3, 5, 7, 9)]
    for maneuver in unseen:
        errors = np.array([largest_error(model, reduced, maneuver) for reduced in maps])
        # An analytic function's: the same ratio from degree to degree.
        assert np.all(errors[1:] < 0.1 * errors[:-1])


@pytest.mark.parametrize("degree", [2, 3, 4])
def test_error_falls_with_the_cells_at_the_order_of_the_polynomials(model, both, unseen, degree):
    coarse, fine = (
        max(largest_error(model, mapped(model, both, cells=n, degree=degree), m) for m in unseen)
        for n in (8, 16)
    )
    assert np.log2(coarse / fine) == pytest.approx(degree + 1, abs=0.8)


def test_coordinates_depend_on_the_inputs_alone(model, both):
    reduced = mapped(model, both)
    rng = np.random.default_rng(5)
    values = rng.uniform(-1.0, 1.0, (both.samples, 2)) * [0.12, 0.036]
    order = rng.permutation(both.samples)
    first, mixed = (
        reduced.simulate(replace(both, signal=lambda *_, v=v: v), START)
        for v in (values, values[order])
    )
    assert first.status == "ok"
    np.testing.assert_array_equal(mixed.coordinates, first.coordinates[order])
    # No equation is solved.
    assert set(first.counts.values()) == {0}


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("column", [0, 1])
def test_leaving_the_training_is_said_with_time_and_place(model, both, sign, column):
    def leaving(times, *_):
        inputs = np.zeros((len(times), 2))
        inputs[:, column] = sign * [0.15, 0.045][column] * np.sin(0.1 * np.pi * times)
        return inputs

    maneuver = replace(both, signal=leaving)
    reduced = mapped(model, both)
    run, full = reduced.simulate(maneuver, START), model.simulate(maneuver)
    outside = np.abs(run.inputs[:, column]) > 1.01 * [0.12, 0.036][column]
    trust = reduced.trust(run.coordinates, run.inputs)
    assert trust.indicator == pytest.approx(1.25 / 1.01, rel=1e-4)
    assert f"input {model.inputs[column]} leaves its known range" in trust.reason
    errors = np.abs(run.coordinates - full.coordinates).max(axis=1)
    assert errors[~outside].max() < 1e-6
    # It goes on with the polynomials of the last cell, worse and worse.
    assert errors[~outside].max() < errors[outside].max() < 0.1


def test_wrong_training_and_inputs_are_refused(model, nominal):
    # Either is within reach; both together are not.
    corner = travelling(lambda t: (-0.18 * (t < 5.0), 0.08 * (t >= 5.0)), nominal)
    for maneuver, given, words in (
        (nominal.perturbed(1.0, 0.0), {}, "no input moves"),
        (corner, {}, r"z -0\.1809 to 0\.0009 m, s0 -0\.0004 to 0\.0804 m"),
        (nominal, {"degree": 21}, "degree 21"),
        (nominal, {"degree": 0}, "degree is 0"),
        (nominal, {"cells": 100, "degree": 5}, "360000"),
    ):
        with pytest.raises(InputError, match=words):
            mapped(model, maneuver, **given)
    missing = travelling(lambda t: (np.where(t > 3.0, np.nan, 0.0), 0.0 * t), nominal)
    with pytest.raises(InputError, match=r"z .* t = 3\.01 s"):
        mapped(model, nominal).simulate(missing, START)
