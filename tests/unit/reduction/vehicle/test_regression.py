"""Choice of regression terms one after the other, against all that could be chosen."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vehiclemor.reduction.vehicle.fitting import forward_selection


def left_over(columns, values, chosen):
    part = columns[:, chosen]
    rest = values - part @ np.linalg.lstsq(part, values, rcond=None)[0]
    return float(np.sum(rest**2 / np.mean(values**2, axis=0)))


@given(seed=st.integers(0, 10**6), first=st.integers(0, 3))
def test_each_term_is_the_one_that_explains_most(seed, first):
    random = np.random.default_rng(seed)
    columns = random.normal(size=(30, 8)) @ random.normal(size=(8, 8))
    values = random.normal(size=(30, 2))
    # Their sizes don't count.
    values *= random.uniform(0.1, 10.0, 2)
    chosen = forward_selection(columns, values, first, 3)
    assert chosen[:first] == list(range(first))
    assert len(set(chosen)) == first + 3
    for n in range(first, len(chosen)):
        others = [i for i in range(8) if i not in chosen[:n]]
        best = min(left_over(columns, values, [*chosen[:n], i]) for i in others)
        assert left_over(columns, values, chosen[: n + 1]) == pytest.approx(best, rel=1e-6)
