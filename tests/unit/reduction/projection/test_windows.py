"""Control periods cover a run once: no sample is left out or counted twice."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from vehiclemor.reduction.projection.windows import first_samples, window_edges

durations = st.floats(0.01, 1000.0)
shares = st.floats(0.002, 3.0)


@given(duration=durations, share=shares)
def test_edges_cover_the_run(duration: float, share: float) -> None:
    period = share * duration
    edges = window_edges(duration, period)
    assert (edges[0], edges[-1]) == (0.0, duration)
    widths = np.diff(edges)
    assert widths[:-1] == pytest.approx(np.full(len(edges) - 2, period), rel=1e-9)
    # It is shorter where the period does not divide the run.
    assert 0.0 < widths[-1] <= period * (1 + 1e-6)


@given(duration=durations, share=shares, samples=st.integers(2, 400))
def test_every_sample_is_in_exactly_one_window(duration: float, share: float, samples: int) -> None:
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


@given(windows=st.integers(1, 60), per_window=st.integers(1, 40))
def test_period_that_divides_the_run_gives_equal_windows(windows: int, per_window: int) -> None:
    # Not representable in binary, so that edges and times are rounded each in its own way.
    period = 0.1
    edges = window_edges(period * windows, period)
    assert len(edges) == windows + 1
    first = first_samples(np.linspace(0.0, period * windows, windows * per_window + 1), edges)
    counts = np.diff(first)
    assert list(counts[:-1]) == [per_window] * (windows - 1)
    assert counts[-1] == per_window + 1


def test_windows_of_the_paper() -> None:
    edges = window_edges(10.0, 5.0)
    assert list(edges) == [0.0, 5.0, 10.0]
    # The output time 5 s belongs to the second period.
    assert list(first_samples(np.linspace(0.0, 10.0, 1001), edges)) == [0, 500, 1001]
