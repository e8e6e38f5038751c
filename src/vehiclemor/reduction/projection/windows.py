"""Control periods: time windows that cover a run exactly once."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np


def window_edges(duration: float, control_period: float) -> np.ndarray:
    """Edges (windows + 1,) in s of control periods that cover [0, duration].

    The last window is shorter where the period does not divide the duration.
    """
    count = max(1, int(np.ceil(duration / control_period - 1e-9)))
    edges = control_period * np.arange(count + 1)
    edges[-1] = duration
    return edges


def first_samples(times: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Indices (windows + 1,): window k holds the samples from entry k up to entry k + 1.

    A time on an edge belongs to the later window, the end of the run to the last one.
    """
    slack = 1e-9 * (edges[-1] - edges[0])
    inner = np.searchsorted(times, edges[1:-1] - slack)
    return np.concatenate([[0], inner, [len(times)]]).astype(np.int64)


def by_window(
    states: np.ndarray, edges: np.ndarray, project: Callable[[np.ndarray, int], np.ndarray]
) -> np.ndarray:
    """States (samples of equidistant times, n), those of each window by `project(states, k)`."""
    first = first_samples(np.linspace(edges[0], edges[-1], len(states)), edges)
    parts = [project(states[a:b], k) for k, (a, b) in enumerate(pairwise(first))]
    return np.concatenate(parts)
