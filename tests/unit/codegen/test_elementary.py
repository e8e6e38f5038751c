"""Sine, cosine, arctangent and exponential of the kernels, compiled."""

import mpmath as mp
import numpy as np
import pytest

from tests.unit.kernels import batch, function, kernel, sincos
from vehiclemor.codegen.elementary import TAN_3_PI_8
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.operations import LANES

# Largest rounding error of sine's polynomials and of the last addition.
ACCURACY = 1.7e-16


def batches(x, result):
    given = [x[k] for k in range(LANES)]
    columns = np.array([*batch("sincos", given), *batch("atan", given)]).reshape(3, LANES)
    for place in np.ndindex(LANES, 3):
        result[place] = columns[place[::-1]]


def alone(x, result):
    result[0], result[1] = sincos(x[0])
    result[2], result[3] = function("atan", x[0]), function("exp", x[0])


BATCHES, ALONE = Kernels([kernel(batches, columns=3)]), Kernels([kernel(alone)])


def in_batches(x: np.ndarray) -> np.ndarray:
    """Sines, cosines and arctangents (n, 3) by the compiled batches of eight."""
    blocks = np.zeros((-(-len(x) // LANES), LANES))
    blocks.ravel()[: len(x)] = x
    found = np.full((len(blocks), LANES, 3), np.nan)
    for block, into in zip(blocks, found, strict=True):
        BATCHES.call("batches", block, into)
    return found.reshape(-1, 3)[: len(x)]


def one_by_one(x: np.ndarray) -> np.ndarray:
    """Sines, cosines, arctangents and exponentials (n, 4)."""
    found = np.full((len(x), 4), np.nan)
    for value, into in zip(x, found, strict=True):
        ALONE.call("alone", np.array([value]), into)
    return found


def precise(x: np.ndarray, *functions) -> np.ndarray:
    with mp.workdps(40):
        return np.array([[f(mp.mpf(float(e))) for f in functions] for e in x])


@pytest.mark.parametrize("scale", [1e-8, 1e-3, 1.0, 10.0, 1e3, 1e4])
def test_sine_and_cosine_are_as_accurate_as_they_say(scale, rng):
    borders = np.arange(-9, 10) * (np.pi / 4.0)
    near = np.concatenate([borders, np.nextafter(borders, 99.0), np.nextafter(borders, -99.0)])
    angles = np.concatenate([rng.uniform(-scale, scale, 400), near])
    for found in (in_batches(angles)[:, :2], one_by_one(angles)[:, :2]):
        with mp.workdps(40):
            errors = precise(angles, mp.sin, mp.cos) - found
            assert max(abs(e) for e in errors.ravel()) < ACCURACY


def test_small_angles_keep_their_relative_accuracy():
    angles = np.array([0.0, 1e-300, -1e-20, 1e-12, -3e-9, 1e-5])
    expected = np.column_stack([np.sin(angles), np.cos(angles), np.arctan(angles)])
    np.testing.assert_allclose(in_batches(angles), expected, rtol=3e-16, atol=0.0)


def test_lanes_do_not_disturb_each_other_and_infinite_angles_give_no_number():
    x = np.array([0.1, np.nan, 0.3, np.inf, 0.5, -0.0, -np.inf, 0.8])
    found, fine = in_batches(x), np.isfinite(x)
    assert np.isnan(found[~fine, :2]).all()
    np.testing.assert_allclose(found[fine, 0], np.sin(x[fine]), rtol=3e-16)
    np.testing.assert_allclose(found[:, 2], np.arctan(x), rtol=3.4e-16, atol=0.0)


def test_arctangent_is_as_accurate_as_it_says(rng):
    points = np.concatenate([rng.uniform(-4.0, 4.0, 1500), rng.standard_cauchy(500)])
    expected, found = precise(points, mp.atan)[:, 0], in_batches(points)[:, 2]
    with mp.workdps(40):
        errors = [abs(mp.mpf(float(f)) / e - 1) for f, e in zip(found, expected, strict=True)]
    assert max(errors) < 2.3e-16
    # Where the argument is reduced, and magnitudes from denormal to the largest.
    near = [np.nextafter(b, side) for b in (0.66, 1.0, TAN_3_PI_8) for side in (0.0, b, 9.0)]
    dense = np.concatenate([np.linspace(0, 4, 20001), np.logspace(-300, 300, 2001), near])
    found = in_batches(dense)[:, 2]
    np.testing.assert_allclose(found, np.arctan(dense), rtol=3.4e-16, atol=0.0)
    np.testing.assert_array_equal(in_batches(-dense)[:, 2], -found)
    ends = np.array([0.0, np.inf, -np.inf, 1e308, -1e308, 5e-324])
    np.testing.assert_array_equal(in_batches(ends)[:, 2], np.arctan(ends))
    assert np.isnan(in_batches(np.array([np.nan]))[0, 2])


def test_functions_alone_at_all_sizes_and_beyond_the_range_of_floats(rng):
    numbers = [*rng.uniform(-700, 700, 500), *rng.uniform(-1, 1, 200), 0.0, -0.0, 5e-324, np.nan]
    beyond = [-np.inf, -1e300, -746.0, -740.0, -708.5, 709.7, 711.0, 1e300, np.inf]
    x = np.array([*numbers, *beyond])
    found, within = one_by_one(x), abs(x) <= 700.0
    with np.errstate(all="ignore"):
        np.testing.assert_allclose(found[:, 3], np.exp(x), rtol=1e-15, atol=5e-324)
    x = x[within]
    expected = np.column_stack([np.sin(x), np.cos(x), np.arctan(x)])
    np.testing.assert_allclose(found[within, :3], expected, rtol=5e-16, atol=1e-15)
