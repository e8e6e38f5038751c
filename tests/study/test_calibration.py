"""Calibrated error estimates cover what they promise, however poor the estimate is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vehiclemor.study.plans.calibration import LEVEL, calibrate, covered, estimated


def draws(rng, runs, noise):
    """Raw estimates and errors of two outputs, related up to so much noise."""
    errors = rng.lognormal(size=(runs, 2))
    return errors * rng.lognormal(sigma=noise, size=errors.shape), errors


@pytest.mark.parametrize("noise", [0.0, 0.5, 2.0])
def test_the_promised_share_is_covered(noise):
    rng, shares = np.random.default_rng(1), []
    for _ in range(400):
        raw, errors = draws(rng, 60, noise)
        further, true = draws(rng, 50, noise)
        shares.append(covered(estimated(further, calibrate(raw, errors)), true))
    share = np.mean(shares)
    # On average over calibrations it is at least the level, and at most one run in 61 above it.
    assert share > LEVEL - 0.006
    assert noise == 0.0 or share < LEVEL + 1 / 61 + 0.006


@settings(max_examples=30)
@given(scale=st.floats(1e-6, 1e6), seed=st.integers(0, 100))
def test_the_estimates_own_scale_does_not_matter(scale, seed):
    raw, errors = draws(np.random.default_rng(seed), 40, 1.0)
    expected = estimated(raw, calibrate(raw, errors))
    np.testing.assert_allclose(estimated(scale * raw, calibrate(scale * raw, errors)), expected)


def test_an_exact_estimate_stays_as_it_is():
    errors = np.abs(np.random.default_rng(2).standard_normal((30, 3)))
    np.testing.assert_allclose(calibrate(errors, errors), 1.0)


def test_too_few_runs_promise_nothing():
    assert np.all(np.isinf(calibrate(np.ones((18, 1)), np.ones((18, 1)))))
    assert np.all(np.isfinite(calibrate(np.ones((19, 1)), np.ones((19, 1)))))


def test_runs_without_an_estimate_count_for_nothing():
    raw, errors = draws(np.random.default_rng(3), 40, 1.0)
    gaps = np.full((5, 2), np.nan)
    found = calibrate(np.vstack([raw, gaps]), np.vstack([errors, gaps]))
    np.testing.assert_array_equal(found, calibrate(raw, errors))
    # No error needs no estimate; an error without one can't be covered by any factor.
    assert np.all(calibrate(np.zeros((40, 1)), np.zeros((40, 1))) == 0.0)
    assert np.all(np.isinf(calibrate(np.zeros((40, 1)), np.ones((40, 1)))))
