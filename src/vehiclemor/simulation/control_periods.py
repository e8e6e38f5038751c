"""Subspaces by time window, and the spans on which a run is smooth."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from vehiclemor.arguments import check_indices, check_shapes, require
from vehiclemor.codegen.loops import Ready, ready
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.loop_arguments import Spans, Subspaces


@dataclass(frozen=True)
class ControlPeriods(ShortRepr):
    """Formulation of a system with one affine subspace for each window.

    One of the `formulations`; window edges (windows + 1,) in s; means (windows, 2 n); bases and
    projections by rows (windows, R, 2 n), of which rows beyond a window's rank are not used; ranks,
    the dimensions (windows,) of the reduced systems.
    """

    formulation: str
    edges: np.ndarray
    means: np.ndarray
    trial_basis: np.ndarray
    test_basis: np.ndarray
    ranks: np.ndarray

    def check_sizes(self) -> None:
        """Raise `ValueError` if loops would read or write beyond a basis."""
        windows, form = len(self.ranks), self.formulation
        rows, columns = self.trial_basis.shape[1:]
        require(form in ("full", "state", "coordinates") and windows > 0, "formulation")
        check_shapes("spaces", (self.edges, windows + 1), (self.means, windows, columns))
        for basis in (self.trial_basis, self.test_basis):
            check_shapes("spaces", (basis, windows, rows, columns))
        if form != "full":
            # A coordinate and its rate share a row where coordinates are projected.
            most = rows * (2 if form == "coordinates" else 1)
            check_indices("ranks", self.ranks.tolist(), min(most, columns) + 1)

    @cached_property
    def subspaces(self) -> Ready:
        """Subspaces as the compiled loop takes them."""
        return ready(Subspaces(self.means, self.trial_basis, self.test_basis, self.ranks))

    def spans(self, breaks: np.ndarray, end: float, begin: float = 0.0) -> Ready:
        """Spans from `begin` to `end` without a window edge or a break point of the inputs inside.

        Break points are ends of the smooth segments of the inputs, from 0 to the maneuver's end.
        """
        return _spans(breaks.tobytes(), self.edges.tobytes(), end, begin)


@lru_cache(maxsize=256)
def _spans(breaks_in_bytes: bytes, edges_in_bytes: bytes, end: float, begin: float) -> Ready:
    breaks, edges = np.frombuffer(breaks_in_bytes), np.frombuffer(edges_in_bytes)
    cuts = np.sort(np.concatenate([breaks, edges, [begin, end]]))
    cuts = cuts[(cuts >= begin) & (cuts <= end)]
    # Times that differ by rounding are one.
    cuts = cuts[np.concatenate([[True], np.diff(cuts) > 1e-9 * max(end, 1.0)])]
    # Also a run that ends at once has a span, to be recorded in.
    cuts = np.array([begin, end]) if len(cuts) == 1 else cuts
    cuts[-1] = end
    middles = (cuts[1:] + cuts[:-1]) / 2.0
    segments, windows = (
        np.minimum(np.searchsorted(known, middles, side="right") - 1, len(known) - 2)
        for known in (breaks, edges)
    )
    return ready(Spans(cuts, segments, windows))


@lru_cache(maxsize=64)
def whole_space(dim: int) -> ControlPeriods:
    """The full space of a system with `dim` states, in one window."""
    edges, ranks = np.array([0.0, np.inf]), np.array([dim], dtype=np.int64)
    mean, nothing = np.zeros((1, 1)), np.zeros((1, 1, 1))
    return ControlPeriods("full", edges, mean, nothing, nothing, ranks)
