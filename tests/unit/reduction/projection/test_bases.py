"""POD bases are orthonormal, best, of fixed signs; control periods cover a run exactly once."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vehiclemor.reduction.projection.bases import first_samples, pod_basis, project, window_edges


def snapshots_of(seed, n=8, m=12, decay=0.3):
    """Snapshots (n, m) with a mean and decreasing singular values."""
    rng = np.random.default_rng(seed)
    left, right = (np.linalg.qr(rng.standard_normal((k, min(n, m))))[0] for k in (n, m))
    return rng.standard_normal((n, 1)) + left * decay ** np.arange(min(n, m)) @ right.T


@given(seed=st.integers(0, 10**6), n=st.integers(2, 10), m=st.integers(2, 14), data=st.data())
def test_basis_is_orthonormal_and_projection_idempotent(seed, n, m, data):
    rank = data.draw(st.integers(1, min(n, m)))
    basis = pod_basis(snapshots_of(seed, n, m), rank)
    assert basis.rank == rank
    assert basis.vectors.T @ basis.vectors == pytest.approx(np.eye(rank), abs=1e-13)
    points = np.random.default_rng(seed + 1).standard_normal((5, n))
    once = project(points, basis)
    assert project(once, basis) == pytest.approx(once, abs=1e-12)
    # The error is perpendicular to the subspace: nothing in it is nearer.
    assert (points - once) @ basis.vectors == pytest.approx(np.zeros((5, rank)), abs=1e-12)
    assert project(basis.mean[None, :], basis) == pytest.approx(basis.mean[None, :], abs=1e-15)


@given(seed=st.integers(0, 10**6), rank=st.integers(1, 8))
def test_error_of_the_snapshots_is_the_tail_of_the_singular_values(seed, rank):
    snapshots = snapshots_of(seed)
    basis = pod_basis(snapshots, rank)
    error = np.sum((project(snapshots.T, basis).T - snapshots) ** 2)
    assert error == pytest.approx(np.sum(basis.singular_values[rank:] ** 2), rel=1e-9, abs=1e-28)


@pytest.mark.parametrize(
    ("tolerance", "kept"), [(0.0, 6), (1e-8, 6), (2e-3, 3), (0.05, 2), (0.5, 1)]
)
def test_rank_tolerance_drops_small_modes(tolerance, kept):
    rng = np.random.default_rng(0)
    left, right = (np.linalg.qr(rng.standard_normal((k, 6)))[0] for k in (8, 12))
    right -= right.mean(axis=0)
    snapshots = left * 0.1 ** np.arange(6) @ np.linalg.qr(right)[0].T
    basis = pod_basis(snapshots, 6, tolerance)
    assert basis.rank == kept
    assert len(basis.singular_values) == 8
    assert pod_basis(snapshots, 1, tolerance).rank == 1
    # The cut is relative: units play no part.
    assert pod_basis(1e-3 * snapshots, 6, tolerance).rank == kept


durations = st.floats(0.01, 1000.0)
shares = st.floats(0.002, 3.0)


@given(duration=durations, share=shares)
def test_edges_cover_the_run(duration, share):
    period = share * duration
    edges = window_edges(duration, period)
    assert (edges[0], edges[-1]) == (0.0, duration)
    widths = np.diff(edges)
    assert widths[:-1] == pytest.approx(np.full(len(edges) - 2, period), rel=1e-9)
    # It is shorter where the period does not divide the run.
    assert 0.0 < widths[-1] <= period * (1 + 1e-6)


@given(duration=durations, share=shares, samples=st.integers(2, 400))
def test_every_sample_is_in_exactly_one_window(duration, share, samples):
    times, edges = np.linspace(0.0, duration, samples), window_edges(duration, share * duration)
    first = first_samples(times, edges)
    assert len(first) == len(edges)
    covered = [i for a, b in itertools.pairwise(first) for i in range(a, b)]
    assert covered == list(range(samples))
    slack = 1e-8 * duration
    for k, (a, b) in enumerate(itertools.pairwise(first)):
        inside = times[a:b]
        assert np.all(inside >= edges[k] - slack)
        if k < len(edges) - 2:
            assert np.all(inside < edges[k + 1])
