"""Bounds of rates, and full-order times interpolated to an error."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom

from vehiclemor.report.unseen import at_error, upper_bound


@given(st.integers(0, 40), st.integers(1, 400))
def test_the_bound_of_a_rate_is_exact(misses, runs):
    misses = min(misses, runs)
    bound = upper_bound(misses, runs)
    if misses == runs:
        assert bound == 1.0
    else:
        # At the bound so few misses have a probability of 5 %.
        np.testing.assert_allclose(binom.cdf(misses, runs, bound), 0.05, rtol=1e-6)


def test_299_runs_without_a_miss_prove_less_than_1_percent():
    assert upper_bound(0, 298) > 0.01 > upper_bound(0, 299)


def ladder(name, order, scores, factor=1.0):
    return [
        {"label": f"{name} {s}", "score": s, "seconds": factor * s ** (-1.0 / order)}
        for s in scores
    ]


@given(st.floats(0.011, 0.99))
def test_a_power_law_is_interpolated_exactly(error):
    rows = ladder("a", 3.0, [1.0, 0.1, 0.01])
    # A row that is slower and less accurate than another is no part of the curve.
    rows.append({"label": "slip", "score": 0.5, "seconds": 50.0})
    found = at_error([rows], error, "seconds")
    np.testing.assert_allclose(found.seconds, error ** (-1.0 / 3.0), rtol=1e-12)
    assert found.rows == (("a 1.0", "a 0.1") if error >= 0.1 else ("a 0.1", "a 0.01"))


def test_the_fastest_ladder_counts_that_reaches_the_error():
    slow, fast = ladder("slow", 3.0, [1.0, 0.001], 2.0), ladder("fast", 3.0, [1.0, 0.1])
    assert at_error([slow, fast], 0.2, "seconds").rows == ("fast 1.0", "fast 0.1")
    assert at_error([slow, fast], 0.04, "seconds").rows == ("slow 1.0", "slow 0.001")
    # Just beyond its end the fast one is continued by its own law, not replaced by the slow one.
    (first, last), continued = fast, at_error([slow, fast], 0.06, "seconds")
    law = math.log(last["seconds"] / first["seconds"]) / math.log(last["score"] / first["score"])
    expected = last["seconds"] * (0.06 / last["score"]) ** law
    assert continued.rows == ("fast 1.0", "fast 0.1")
    assert continued.seconds == pytest.approx(expected, rel=1e-12)
    assert at_error([slow, fast], 5.0, "seconds") == (1.0, ("fast 1.0",))
    assert math.isnan(at_error([slow, fast], 1e-6, "seconds").seconds)
