"""What reduced models tell of their runs."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vehiclemor.reduction.trust import trust_of


@given(size=st.floats(0.0, 3.0), sample=st.integers(0, 9), column=st.integers(0, 1))
def test_the_first_range_that_is_left_is_named(size, sample, column):
    used = np.zeros((10, 2))
    used[sample:, column] = -size
    found = trust_of(np.arange(10.0), used, ("roll", "speed"))
    assert found.indicator == size
    assert found.until == (sample if size > 1.0 else np.inf)
    assert found.reason.startswith(("roll", "speed")[column] if size > 1.0 else "")
    assert bool(found.reason) == (size > 1.0)


def test_what_is_no_number_is_beyond():
    found = trust_of(np.arange(3.0), np.array([[0.5], [np.nan], [0.1]]), ("roll",))
    assert (found.indicator, found.until) == (0.5, 1.0)
