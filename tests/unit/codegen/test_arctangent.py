"""The arctangent of the kernels, alone and in batches."""

import math

import mpmath as mp
import numpy as np

from vehiclemor.codegen.arctangent import TAN_3_PI_8, atan


def test_arctangent_equals_the_c_librarys():
    # Where the argument is reduced, and magnitudes from denormal to the largest.
    borders = [0.66, 1.0, TAN_3_PI_8]
    dense = np.concatenate(
        [
            np.linspace(0.0, 4.0, 20001),
            np.logspace(-300, 300, 2001),
            *([np.nextafter(b, 9.0), b, np.nextafter(b, 0.0)] for b in borders),
        ]
    )
    found = np.array([atan(float(x)) for x in dense])
    expected = np.array([math.atan(x) for x in dense])
    np.testing.assert_allclose(found, expected, rtol=3.4e-16, atol=0.0)
    mirrored = np.array([atan(float(-x)) for x in dense])
    np.testing.assert_array_equal(mirrored, -found)


def test_arctangent_is_as_accurate_as_it_says(rng):
    points = np.concatenate([rng.uniform(-4.0, 4.0, 1500), rng.standard_cauchy(500)])
    with mp.workdps(40):
        errors = [abs(mp.mpf(float(atan(float(x)))) / mp.atan(mp.mpf(x)) - 1) for x in points]
    assert max(errors) < 2.3e-16


def test_arctangent_of_special_values():
    with np.errstate(all="ignore"):
        for x in (0.0, math.inf, -math.inf, 1e308, -1e308, 5e-324):
            assert float(atan(np.float64(x))) == math.atan(x)
    assert math.isnan(atan(math.nan))


def test_compiled_arctangents_are_the_arctangents_and_do_not_disturb_each_other(standard, rng):
    model = standard()
    states = rng.standard_cauchy((400, 4)) * 10.0 ** rng.integers(-9, 9, (400, 4))
    states[::7, 2] = np.nan
    states[1::7, 1] = np.inf
    states[2::7, 3] = -0.0
    found = model.along("outputs", states, np.zeros((400, 3)))
    np.testing.assert_array_equal(found[:, :4], states)
    np.testing.assert_allclose(found[:, 4:], np.arctan(states), rtol=3.4e-16, atol=0.0)
