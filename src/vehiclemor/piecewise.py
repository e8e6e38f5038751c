"""Piecewise polynomials through samples, as the compiled time loops take their inputs."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

DEGREE = 5
# Samples whose spacing differs by less, relative to it, are equidistant.
EQUIDISTANT = 1e-9
# A stretch of equal samples is quiet from so long (s) on: a run at rest could step over its end.
QUIET = 0.1


class Pieces(NamedTuple):
    """Piecewise polynomials, see `simulation/integrators/structures.Signal`.

    Attributes
    ----------
    edges
        Ends of the smooth segments (segments + 1,) in s.
    first
        Number of the first piece of each segment (segments + 1,).
    starts
        Times (pieces,) in s at which pieces begin; empty if those of a segment are of one length.
    coefficients
        Polynomials (pieces, inputs, 6) in the part of the piece that has passed, lowest power
        first.
    """

    edges: np.ndarray
    first: np.ndarray
    starts: np.ndarray
    coefficients: np.ndarray

    @property
    def lengths(self) -> np.ndarray:
        """Lengths (pieces,) in s."""
        if len(self.starts):
            return np.diff(self.starts, append=self.edges[-1])
        pieces = np.diff(self.first)
        return np.repeat(np.diff(self.edges) / pieces, pieces)

    def scaled(self, frequency: float, amplitudes: np.ndarray) -> Pieces:
        """So much faster, and each input times its own amplitude (inputs,)."""
        edges, starts = self.edges / frequency, self.starts / frequency
        return Pieces(edges, self.first, starts, self.coefficients * amplitudes[:, None])

    def derivative(self) -> Pieces:
        """By time; jumps have none."""
        rates = np.zeros_like(self.coefficients)
        rates[:, :, :-1] = self.coefficients[:, :, 1:] * np.arange(1.0, DEGREE + 1)
        return self._replace(coefficients=rates / self.lengths[:, None, None])

    def at(self, times: np.ndarray) -> np.ndarray:
        """Values (n, inputs) at times (n,) in s; at a jump those after it, at the end before."""
        return evaluated(self.coefficients, *self.located(times))

    def located(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of the pieces in which times (n,) lie, and the parts of them that have passed."""
        edges, first, starts, _ = self
        if len(starts):
            rows = np.searchsorted(starts, times, side="right") - 1
            rows = np.clip(rows, 0, len(starts) - 1)
            return rows, (times - starts[rows]) / self.lengths[rows]
        segments: Any = 0
        if len(edges) > 2:
            segments = np.searchsorted(edges, times, side="right") - 1
            segments = np.clip(segments, 0, len(edges) - 2)
        pieces, begin = first[segments + 1] - first[segments], edges[segments]
        places = (times - begin) / (edges[segments + 1] - begin) * pieces
        rows = np.clip(places.astype(np.int64), 0, pieces - 1)
        return rows + first[segments], places - rows


def evaluated(coefficients: np.ndarray, rows: np.ndarray, parts: np.ndarray) -> np.ndarray:
    """Values (..., n, inputs) of polynomials (..., pieces, inputs, 6), see `Pieces.located`."""
    own, parts = coefficients[..., rows, :, :], parts[:, None]
    values = own[..., DEGREE]
    for power in range(DEGREE - 1, -1, -1):
        values = own[..., power] + parts * values
    return values


def held(times: np.ndarray, values: np.ndarray) -> Pieces:
    """Each sample until the next; jumps are break points, the last sample only ends the run."""
    jumps = (values[1:-1] != values[:-2]).any(axis=1).nonzero()[0] + 1
    rows = np.concatenate([[0], jumps])
    coefficients = _constant(values[rows])
    edges = np.concatenate([times[rows], times[-1:]])
    return Pieces(edges, np.arange(len(edges)), np.empty(0), coefficients)


def linear(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Coefficients of straight lines between samples."""
    del times
    coefficients = _constant(values[:-1])
    coefficients[:, :, 1] = np.diff(values, axis=0)
    return coefficients


def cubic(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Coefficients of the spline with continuous second derivatives, not-a-knot at its ends."""
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(times, values)
    coefficients = np.zeros((*spline.c.shape[1:], DEGREE + 1))
    lengths = np.diff(times)[:, None]
    for power in range(len(spline.c)):
        coefficients[:, :, power] = spline.c[-1 - power] * lengths**power
    return coefficients


# Coefficients (intervals, inputs, 6) that don't depend on what other columns hold.
CONTINUOUS = {"linear": linear, "cubic": cubic}
HOLDS = ("linear", "zero", "cubic")


def through(times: np.ndarray, values: np.ndarray, hold: str) -> Pieces:
    """Polynomials through samples (n, inputs) by one of `HOLDS`."""
    if hold == "zero":
        return held(times, values)
    return joined(times, values, CONTINUOUS[hold](times, values))


def _constant(values: np.ndarray) -> np.ndarray:
    coefficients = np.zeros((*values.shape, DEGREE + 1))
    coefficients[:, :, 0] = values
    return coefficients


def joined(times: np.ndarray, values: np.ndarray, coefficients: np.ndarray) -> Pieces:
    """One piece for each interval; segments end where a quiet stretch begins or ends."""
    first = _quiet_ends(times, values)
    edges, starts = times[first], np.empty(0)
    for a, b in pairwise(first):
        step = (times[b] - times[a]) / (b - a)
        off = times[a : b + 1] - (times[a] + step * np.arange(b - a + 1))
        if np.abs(off).max() > EQUIDISTANT * step:
            starts = times[:-1].copy()
            break
    return Pieces(edges, first, starts, coefficients)


def _quiet_ends(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Numbers of the samples at which segments begin and end."""
    last = len(times) - 1
    moves = (values[1:] != values[:-1]).any(axis=1)
    changes = (moves[1:] != moves[:-1]).nonzero()[0] + 1
    ends = np.concatenate([[0], changes, [last]])
    if len(changes):
        quiet = ~moves[ends[:-1]] & (np.diff(times[ends]) >= QUIET)
        # A change is one of segments if what lies on one of its sides is quiet.
        ends = ends[np.concatenate([[True], quiet[1:] | quiet[:-1], [True]])]
    return ends.astype(np.int64)
