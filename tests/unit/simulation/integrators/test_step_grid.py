"""Pairs of states that turn with the heading."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vehiclemor.simulation.build import build
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.integrators.step_grid import rotate

# Place of the heading, then pairs of places.
TURNING = np.array([2, 0, 1, 6, 4])
angles = st.floats(-7.0, 7.0)
states = st.tuples(*[st.floats(-100.0, 100.0)] * 7).map(np.array)


@pytest.fixture(scope="module")
def model() -> DynamicModel:
    return build("high_fidelity_vehicle")


def turned(vector: np.ndarray, angle: float, turning: np.ndarray = TURNING) -> np.ndarray:
    result = vector.copy()
    assert rotate(result, turning, np.cos(angle), np.sin(angle)) is None
    return result


@settings(max_examples=20)
@given(vector=states, angle=angles)
def test_pairs_turn_as_complex_numbers(vector, angle):
    found, factor = turned(vector, angle), np.exp(1j * angle)
    for a, b in ((0, 1), (6, 4)):
        expected = factor * (vector[a] + 1j * vector[b])
        assert found[a] + 1j * found[b] == pytest.approx(expected, abs=1e-12)
    # The heading and what is in no pair stay.
    np.testing.assert_array_equal(found[[2, 3, 5]], vector[[2, 3, 5]])
    for no_pairs in (np.zeros(0, dtype=np.int64), np.array([2])):
        np.testing.assert_array_equal(turned(vector, angle, no_pairs), vector)


@settings(max_examples=20)
@given(vector=states, angle=angles, other=angles)
def test_turns_add_up_and_are_undone(vector, angle, other):
    np.testing.assert_allclose(turned(turned(vector, angle), -angle), vector, rtol=0, atol=1e-12)
    both = turned(turned(vector, angle), other)
    np.testing.assert_allclose(both, turned(vector, angle + other), rtol=0, atol=1e-11)
    np.testing.assert_array_equal(turned(vector, 0.0), vector)


@settings(max_examples=20)
@given(angle=st.floats(-3.0, 3.0))
def test_a_vehicle_that_heads_elsewhere_moves_alike(model, angle):
    """What `rotate` is for: position and velocity turn with the heading, all else stays."""
    x = model.initial["dropped"].copy()
    x[26:48] += np.linspace(-0.5, 0.5, 22)
    u = np.array([0.01, 0.05, -0.2])
    elsewhere = turned(x, angle, model.rotating)
    elsewhere[model.rotating[0]] += angle
    expected = model.derivative(x, u)
    # The derivative has the rates of the pairs in the same places.
    expected = turned(expected, angle, model.rotating)
    found = model.derivative(elsewhere, u)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())
