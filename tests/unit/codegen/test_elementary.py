"""Sine, cosine, arctangent and exponential of the kernels, in plain Python and compiled."""

import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vehiclemor.codegen import exponential
from vehiclemor.codegen.arctangent import TAN_3_PI_8, atan
from vehiclemor.codegen.kernels import Kernels, kernel_sources
from vehiclemor.codegen.sincos import sincos

# Largest rounding error of sine's polynomials and of the last addition.
ACCURACY = 1.7e-16
PLACES = range(8)
BATCHES = [
    *(f"_work[{k}] = _x[{k}]\n    _work[{k + 24}] = _x[{k}]" for k in PLACES),
    "sincos_batch(_work, 0)\n    atan_batch(_work, 24)",
    *(f"_result[{k}, {c}] = _work[{p + k}]" for k in PLACES for c, p in enumerate((8, 16, 32))),
]
ALONE = ["s, c = sincos_one(_x[0])"] + [
    f"_result[{k}] = {value}"
    for k, value in enumerate(("s", "c", "atan(_x[0])", "math.exp(_x[0])"))
]


def compiled(head: str, lines: list[str]):
    kernels = Kernels(kernel_sources(f"def {head}:\n    " + "\n    ".join(lines) + "\n"))
    (name,) = kernels.sources
    return lambda *arrays: kernels.call(name, *arrays)


def in_batches(x: np.ndarray) -> np.ndarray:
    """Sines, cosines and arctangents (n, 3) by the compiled batches of eight."""
    blocks = np.zeros((-(-len(x) // 8), 8))
    blocks.ravel()[: len(x)] = x
    found, kernel = np.full((len(blocks), 8, 3), np.nan), compiled("b(_x, _work, _result)", BATCHES)
    for block, into in zip(blocks, found, strict=True):
        kernel(block, into)
    return found.reshape(-1, 3)[: len(x)]


def precise(x: np.ndarray, *functions) -> np.ndarray:
    with mp.workdps(40):
        return np.array([[f(mp.mpf(float(e))) for f in functions] for e in x])


@pytest.mark.parametrize("scale", [1e-8, 1e-3, 1.0, 10.0, 1e3, 1e4])
def test_sine_and_cosine_are_as_accurate_as_they_say(scale, rng):
    borders = np.arange(-9, 10) * (np.pi / 4.0)
    near = np.concatenate([borders, np.nextafter(borders, 99.0), np.nextafter(borders, -99.0)])
    angles = np.concatenate([rng.uniform(-scale, scale, 400), near])
    for found in (in_batches(angles)[:, :2], np.array([sincos(float(a)) for a in angles])):
        with mp.workdps(40):
            errors = precise(angles, mp.sin, mp.cos) - found
            assert max(abs(e) for e in errors.ravel()) < ACCURACY


def test_small_angles_keep_their_relative_accuracy():
    angles = np.array([0.0, 1e-300, -1e-20, 1e-12, -3e-9, 1e-5])
    expected = np.column_stack([np.sin(angles), np.cos(angles), np.arctan(angles)])
    np.testing.assert_allclose(in_batches(angles), expected, rtol=3e-16, atol=0.0)


@given(angle=st.floats(-1e4, 1e4))
def test_identities_of_sine_and_cosine_hold(angle):
    sine, cosine = sincos(angle)
    assert sine * sine + cosine * cosine == pytest.approx(1.0, abs=5e-16)
    assert sincos(-angle) == pytest.approx((-sine, cosine), abs=2 * ACCURACY)
    rounding = np.spacing(abs(angle) + 2.0)
    turned = sincos(angle + np.pi / 2.0)
    assert turned == pytest.approx((cosine, -sine), abs=rounding + 2 * ACCURACY)


def test_lanes_do_not_disturb_each_other_and_infinite_angles_give_no_number():
    x = np.array([0.1, np.nan, 0.3, np.inf, 0.5, -0.0, -np.inf, 0.8])
    found, fine = in_batches(x), np.isfinite(x)
    assert np.isnan(found[~fine, :2]).all()
    np.testing.assert_allclose(found[fine, 0], np.sin(x[fine]), rtol=3e-16)
    np.testing.assert_allclose(found[:, 2], np.arctan(x), rtol=3.4e-16, atol=0.0)


def test_arctangent_is_as_accurate_as_it_says(rng):
    points = np.concatenate([rng.uniform(-4.0, 4.0, 1500), rng.standard_cauchy(500)])
    expected = precise(points, mp.atan)[:, 0]
    with mp.workdps(40):
        errors = [abs(atan(float(x)) / e - 1) for x, e in zip(points, expected, strict=True)]
    assert max(errors) < 2.3e-16
    # Where the argument is reduced, and magnitudes from denormal to the largest.
    near = [np.nextafter(b, side) for b in (0.66, 1.0, TAN_3_PI_8) for side in (0.0, b, 9.0)]
    dense = np.concatenate([np.linspace(0, 4, 20001), np.logspace(-300, 300, 2001), near])
    found = np.array([atan(float(x)) for x in dense])
    np.testing.assert_allclose(found, np.arctan(dense), rtol=3.4e-16, atol=0.0)
    np.testing.assert_array_equal([atan(float(-x)) for x in dense], -found)
    with np.errstate(all="ignore"):
        for x in (0.0, math.inf, -math.inf, 1e308, -1e308, 5e-324):
            assert float(atan(np.float64(x))) == math.atan(x)
    assert math.isnan(atan(math.nan))


def test_functions_alone_at_all_sizes_and_beyond_the_range_of_floats(rng):
    kernel, result = compiled("alone(_x, _result)", ALONE), np.empty(4)
    numbers = [*rng.uniform(-700, 700, 500), *rng.uniform(-1, 1, 200), 0.0, -0.0, 5e-324, np.nan]
    beyond = [-np.inf, -1e300, -746.0, -740.0, -708.5, 709.7, 711.0, 1e300, np.inf]
    for x in (*numbers, *beyond):
        kernel(np.array([x]), result)
        with np.errstate(all="ignore"):
            np.testing.assert_allclose(result[3], np.exp(x), rtol=1e-15, atol=5e-324)
            if abs(x) <= 700.0:
                expected = [np.sin(x), np.cos(x), np.arctan(x)]
                np.testing.assert_allclose(result[:3], expected, rtol=5e-16, atol=1e-15)
                assert exponential.exp(x) == pytest.approx(result[3], rel=5e-16)
