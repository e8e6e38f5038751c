"""Subspaces by window, and the spans on which a run is smooth, for the compiled loops."""

from dataclasses import dataclass

import numpy as np

from vehiclemor.simulation.system_loops import FULL


@dataclass(frozen=True)
class Spaces:
    """Form of a system with one affine subspace for each window.

    Attributes
    ----------
    form
        FULL, STATE or COORDINATES of `system_loops`.
    edges
        Window edges (windows + 1,) in s.
    means
        Means (windows, 2 n).
    lifts, drops
        Bases by rows and projections (windows, R, 2 n); rows beyond a window's rank are not used.
    ranks
        Dimensions (windows,) of the reduced systems.
    """

    form: int
    edges: np.ndarray
    means: np.ndarray
    lifts: np.ndarray
    drops: np.ndarray
    ranks: np.ndarray

    @property
    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Arguments of the compiled loops."""
        return self.means, self.lifts, self.drops, self.ranks

    def spans(self, breaks: np.ndarray, end: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Spans without a break point or window edge inside, from 0 to `end`.

        Parameters
        ----------
        breaks
            Ends of the smooth segments of the inputs, from 0 to the end of the maneuver.

        Returns
        -------
        tuple
            Edges (spans + 1,) in s, number of the segment and of the window of each span.
        """
        edges = np.unique(np.concatenate([breaks, self.edges, [0.0, end]]))
        edges = edges[edges <= end]
        # Edges that differ by rounding are one.
        edges = edges[np.concatenate([[True], np.diff(edges) > 1e-9 * max(end, 1.0)])]
        edges[-1] = end
        middles = (edges[1:] + edges[:-1]) / 2.0
        segments = np.clip(np.searchsorted(breaks, middles) - 1, 0, len(breaks) - 2)
        windows = np.clip(np.searchsorted(self.edges, middles) - 1, 0, len(self.edges) - 2)
        return edges, segments.astype(np.int64), windows.astype(np.int64)


def full_space(n: int) -> Spaces:
    """The whole state space of a model with n coordinates, in one window."""
    return whole_space(2 * n)


def whole_space(dim: int) -> Spaces:
    """The whole space of a system with `dim` states, in one window."""
    nothing = np.zeros((1, 1, 1))
    return Spaces(
        FULL,
        np.array([0.0, np.inf]),
        np.zeros((1, 1)),
        nothing,
        nothing,
        np.array([dim], dtype=np.int64),
    )
