"""Piecewise polynomials through samples, as the compiled time loops take their inputs."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

# Times that differ by so little, relative to what they are, are one.
ROUNDING = 1e-12
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
        Polynomials (pieces, inputs, degree + 1) in the part of the piece that has passed, lowest
        power first.
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
        rates[:, :, :-1] = self.coefficients[:, :, 1:] * np.arange(1.0, rates.shape[2])
        return self._replace(coefficients=rates / self.lengths[:, None, None])

    def at(self, times: np.ndarray) -> np.ndarray:
        """Values (n, inputs) at times (n,) in s; at a jump those after it, at the end before."""
        edges, first, starts, coefficients = self
        if len(starts):
            rows = np.searchsorted(starts, times, side="right") - 1
            rows = np.clip(rows, 0, len(starts) - 1)
            parts = (times - starts[rows]) / self.lengths[rows]
        else:
            segments: Any = 0
            if len(edges) > 2:
                reached = times + ROUNDING * (1.0 + times)
                segments = np.searchsorted(edges, reached, side="right") - 1
                segments = np.clip(segments, 0, len(edges) - 2)
            pieces, begin = first[segments + 1] - first[segments], edges[segments]
            places = (times - begin) / (edges[segments + 1] - begin) * pieces
            rows = np.clip(places.astype(np.int64), 0, pieces - 1)
            parts, rows = places - rows, rows + first[segments]
        own, parts = coefficients[rows], parts[:, None]
        values = own[:, :, -1]
        for power in range(own.shape[2] - 2, -1, -1):
            values = own[:, :, power] + parts * values
        return values


def held(times: np.ndarray, values: np.ndarray) -> Pieces:
    """Each sample until the next; jumps are break points, the last sample only ends the run."""
    jumps = (values[1:-1] != values[:-2]).any(axis=1).nonzero()[0] + 1
    rows = np.concatenate([[0], jumps])
    edges = np.concatenate([times[rows], times[-1:]])
    return Pieces(edges, np.arange(len(edges)), np.empty(0), values[rows, :, None])


def linear(times: np.ndarray, values: np.ndarray) -> Pieces:
    """Straight lines between samples."""
    coefficients = np.empty((len(values) - 1, values.shape[1], 2))
    coefficients[:, :, 0] = values[:-1]
    np.subtract(values[1:], values[:-1], out=coefficients[:, :, 1])
    return _pieces(times, values, coefficients)


def cubic(times: np.ndarray, values: np.ndarray) -> Pieces:
    """The cubic spline with continuous second derivatives, not-a-knot at its ends."""
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(times, values)
    coefficients = np.empty((*spline.c.shape[1:], len(spline.c)))
    lengths = np.diff(times)[:, None]
    for power in range(len(spline.c)):
        coefficients[:, :, power] = spline.c[-1 - power] * lengths**power
    return _pieces(times, values, coefficients)


HOLDS = {"linear": linear, "zero": held, "cubic": cubic}


def _pieces(times: np.ndarray, values: np.ndarray, coefficients: np.ndarray) -> Pieces:
    """One piece for each interval; segments end where a quiet stretch begins or ends."""
    first = _quiet_ends(times, values)
    edges, starts = times[first], np.empty(0)
    for (a, b), (begin, end) in zip(pairwise(first.tolist()), pairwise(edges), strict=True):
        step = (end - begin) / (b - a)
        off = times[a : b + 1] - np.linspace(begin, end, b - a + 1)
        if max(off.max(), -off.min()) > EQUIDISTANT * step:
            starts = times[:-1].copy()
            break
    return Pieces(edges, first, starts, coefficients)


def _quiet_ends(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Numbers of the samples at which segments begin and end."""
    last = len(times) - 1
    moves = values[1:] != values[:-1]
    if moves.all():
        return np.array([0, last])
    moves = moves.any(axis=1)
    changes = (moves[1:] != moves[:-1]).nonzero()[0] + 1
    ends = np.concatenate([[0], changes, [last]])
    quiet = ~moves[ends[:-1]] & (np.diff(times[ends]) >= QUIET)
    # A change is one of segments if what lies on one of its sides is quiet.
    return ends[np.concatenate([[True], quiet[1:] | quiet[:-1], [True]])]
