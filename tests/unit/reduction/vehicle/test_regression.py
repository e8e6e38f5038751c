"""Choice of regression terms one after the other, and their elimination, against all subsets."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vehiclemor.reduction.vehicle.regression import forward_selection, surviving


def left_over(columns, values, chosen):
    part = columns[:, chosen]
    return float(np.sum((values - part @ np.linalg.lstsq(part, values, rcond=None)[0]) ** 2))


@given(seed=st.integers(0, 10**6), first=st.integers(0, 3))
def test_each_term_is_the_one_that_explains_most(seed, first):
    random = np.random.default_rng(seed)
    columns = random.normal(size=(30, 8)) @ random.normal(size=(8, 8))
    values = random.normal(size=(30, 2))
    chosen = forward_selection(columns, values, first, 3)
    assert chosen[:first] == list(range(first))
    assert len(set(chosen)) == first + 3
    for n in range(first, len(chosen)):
        others = [i for i in range(8) if i not in chosen[:n]]
        best = min(left_over(columns, values, [*chosen[:n], i]) for i in others)
        assert left_over(columns, values, chosen[: n + 1]) == pytest.approx(best, rel=1e-6)


def test_a_sum_of_chosen_terms_comes_last():
    random = np.random.default_rng(3)
    columns = random.normal(size=(40, 3))
    both = np.column_stack(
        [columns[:, 0], columns[:, 1], columns[:, :2].sum(axis=1), columns[:, 2]]
    )
    assert forward_selection(both, columns[:, :2], 2, 1) == [0, 1, 3]


def problem(seed, features=6, targets=2, samples=40):
    """Columns and targets of a regression with coefficients of very different weight."""
    random = np.random.default_rng(seed)
    columns = random.normal(size=(samples, features)) @ random.normal(size=(features, features))
    weights = 10.0 ** random.uniform(-2.0, 1.0, size=(features, targets))
    return columns, columns @ weights + 0.01 * random.normal(size=(samples, targets))


def fitted(columns, goals):
    c = np.linalg.lstsq(columns, goals, rcond=None)[0]
    return c, float(np.sum((columns @ c - goals) ** 2))


def eliminated(columns, goals, kept):
    n, targets = columns.shape[1], goals.shape[1]
    normal = np.kron(np.eye(targets), columns.T @ columns)
    c = fitted(columns, goals)[0].T.ravel()
    groups = [[i + n * t for t in range(targets)] for i in range(n)]
    left, changed = surviving(normal, c, groups, kept)
    return left, changed.reshape(targets, n).T


@given(seed=st.integers(0, 10**6), kept=st.integers(1, 5))
def test_what_is_left_is_fitted_anew(seed, kept):
    columns, goals = problem(seed)
    left, c = eliminated(columns, goals, kept)
    assert len(left) == kept
    gone = [i for i in range(6) if i not in left]
    assert not c[gone].any()
    expected, least = fitted(columns[:, left], goals)
    np.testing.assert_allclose(c[left], expected, rtol=1e-4, atol=1e-4 * np.abs(expected).max())
    assert np.sum((columns @ c - goals) ** 2) == pytest.approx(least, rel=1e-4)


@given(seed=st.integers(0, 10**6))
def test_the_first_to_go_is_the_one_that_is_needed_least(seed):
    columns, goals = problem(seed)
    (left, _), every = eliminated(columns, goals, 5), range(6)
    errors = {
        subset: fitted(columns[:, subset], goals)[1] for subset in itertools.combinations(every, 5)
    }
    assert errors[tuple(left)] <= (1.0 + 1e-6) * min(errors.values())


def test_coefficients_of_no_group_stay():
    columns, goals = problem(7)
    normal, c = columns.T @ columns, fitted(columns, goals)[0][:, 0]
    left, changed = surviving(normal, c, [[1], [2], [4]], 1)
    assert len(left) == 1
    assert np.count_nonzero(changed) == 4
    assert changed[[0, 3, 5]].all()
    # Nothing goes where all may stay.
    left, every = surviving(normal, c, [[1], [2], [4]], 3)
    assert left == [0, 1, 2]
    np.testing.assert_allclose(every, c, rtol=1e-9)
