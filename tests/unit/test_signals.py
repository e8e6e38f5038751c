"""Signals: piecewise polynomials through samples, wherever a maneuver is wanted."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline, interp1d

import vehiclemor as vm
from vehiclemor.errors import InputError

GAPS = st.lists(st.floats(1e-3, 0.5), min_size=3, max_size=30)


def samples(gaps: list[float], columns: int = 1, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Times that begin at zero, and values that stand still for a while."""
    times = np.concatenate([[0.0], np.cumsum(gaps)])
    values = np.random.default_rng(seed).normal(size=(len(times), columns))
    values[1 : len(times) // 2] = values[0]
    return times, values


@settings(max_examples=40)
@given(gaps=GAPS, columns=st.integers(1, 3), seed=st.integers(0, 1000), even=st.booleans())
@pytest.mark.parametrize("hold", ["linear", "zero", "cubic"])
def test_polynomials_are_scipys(hold, gaps, columns, seed, even):
    times, values = samples([0.1] * len(gaps) if even else gaps, columns, seed)
    oracle = {
        "linear": interp1d(times, values, axis=0),
        "zero": interp1d(times, values, "previous", axis=0),
        "cubic": CubicSpline(times, values),
    }[hold]
    signal = vm.Signal.from_samples(times, values, hold)
    places = np.random.default_rng(seed).uniform(0.0, times[-1], 200)
    # Beside a jump both sides are right to rounding.
    places = places[np.abs(places[:, None] - times).min(axis=1) > 1e-9]
    np.testing.assert_allclose(signal.at(places), oracle(places), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("t", "u", "told"),
    [
        ([0.0, 2.0, 1.0], [0.0, 0.0, 0.0], r"times must increase, t\[2\] = 1 s follows 2 s"),
        ([0.0, np.nan], [0.0, 0.0], r"t\[1\] is not finite"),
        ([0.0, 1.0], [0.0, np.inf], r"u\[1\] is not finite"),
        ([0.0], [0.0], "two samples at least, not 1"),
        ([0.0, 1.0], [0.0, 1.0, 2.0], r"t has shape \(2,\) and u \(3,\)"),
        ([0.0, 1.0], ["a", "b"], "is not a number or a list of numbers"),
    ],
)
def test_bad_samples_are_refused_in_one_line(t, u, told):
    with pytest.raises(InputError, match=told) as raised:
        vm.Signal.from_samples(t, u)
    assert "\n" not in str(raised.value)


def test_unknown_hold_is_refused():
    with pytest.raises(InputError, match="unknown hold 'cubics'; did you mean cubic"):
        vm.Signal.from_samples([0.0, 1.0], [0.0, 1.0], "cubics")


def test_a_signal_is_run_wherever_a_maneuver_is():
    car = vm.model("independent_suspension_vehicle")
    t = np.linspace(0.0, 4.0, 401)
    signal = vm.Signal.from_samples(t, 0.01 * np.sin(t) ** 3, "cubic")
    full = car.simulate(signal, "equilibrium")
    result = vm.simulate(car, "pod", maneuver=signal, amplitude=0.9, training="nominal")
    assert len(full.time) == 201
    np.testing.assert_allclose(result["inputs"][:, 0], 0.9 * full.inputs[:, 0], atol=1e-12)
