"""Piecewise polynomials through samples, as the compiled time loops take their inputs."""

from __future__ import annotations

from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from vehiclemor.errors import InputError

# Times that differ by so little, relative to what they are, are one.
ROUNDING = 1e-12
# Samples whose spacings differ by less, relative to them, are equidistant.
EQUIDISTANT = 1e-8
# Change of slope beside that of the neighbouring samples, times the spacing or `FINE` (s), relative
# to the largest value: from here on a sample is a break point.  What it buys: `my-signal` in the
# handbook.
KINK, FINE = 1e-3, 0.01
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


def linear(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Coefficients of straight lines between samples."""
    del times
    coefficients = np.empty((len(values) - 1, values.shape[1], 2))
    coefficients[:, :, 0] = values[:-1]
    np.subtract(values[1:], values[:-1], out=coefficients[:, :, 1])
    return coefficients


def cubic(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Coefficients of the spline with continuous second derivatives, not-a-knot at its ends."""
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(times, values)
    coefficients = np.empty((*spline.c.shape[1:], len(spline.c)))
    lengths = np.diff(times)[:, None]
    for power in range(len(spline.c)):
        coefficients[:, :, power] = spline.c[-1 - power] * lengths**power
    return coefficients


# Coefficients (intervals, inputs, degree + 1) that don't depend on what other columns hold.
CONTINUOUS = {"linear": linear, "cubic": cubic}
HOLDS = ("linear", "zero", "cubic")


def through(times: np.ndarray, values: np.ndarray, hold: str) -> Pieces:
    """Polynomials through samples (n, inputs) by one of `HOLDS`."""
    if hold == "zero":
        return held(times, values)
    coefficients = polynomials(times, values, hold)
    return joined(times, bent(times, values), coefficients)


def polynomials(times: np.ndarray, values: np.ndarray, hold: str) -> np.ndarray:
    """Coefficients by one of `CONTINUOUS`; `InputError` if they overflow."""
    with np.errstate(all="ignore"), suppress(ValueError):
        coefficients = CONTINUOUS[hold](times, values)
        if np.isfinite(coefficients).all():
            return coefficients
    raise InputError("samples of a signal: the polynomials through them are not finite")


def joined(times: np.ndarray, bends: np.ndarray, coefficients: np.ndarray) -> Pieces:
    """One piece for each interval; segments end where samples are `bent`."""
    lengths, ends = np.diff(times), [[0], bends.nonzero()[0] + 1, [len(times) - 1]]
    first = np.concatenate(ends) if bends.any() else np.array([0, len(lengths)])
    even = lengths.max() - lengths.min() <= EQUIDISTANT * lengths[0]
    return Pieces(times[first], first, np.empty(0) if even else times[:-1].copy(), coefficients)


def bent(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Which of the inner samples (n - 2,) are break points: kinks, and ends of quiet."""
    moves = (values[1:] != values[:-1]).any(axis=1)
    return bent_by_column(times, values).any(axis=1) | quiet_ends(times, moves)


@np.errstate(over="ignore", invalid="ignore")
def bent_by_column(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """At which of the inner samples (n - 2, inputs) the slope changes otherwise than beside it.

    A curve that is sampled finely bends by as much from sample to sample; what is left of noise,
    corners and coarse samples is what an integrator must not step over.
    """
    lengths = np.diff(times)[:, None]
    spacing = 0.5 * (lengths[1:] + lengths[:-1])
    slopes = (values[1:] - values[:-1]) / lengths
    bends = np.zeros((len(values), values.shape[1]))
    np.divide(slopes[1:] - slopes[:-1], spacing, out=bends[1:-1])
    off = np.abs(bends[1:-1] - 0.5 * (bends[:-2] + bends[2:]))
    # A sample beside a corner doesn't bend itself.
    np.minimum(off, np.abs(bends[1:-1]), out=off)
    largest = np.maximum(values.max(axis=0), -values.min(axis=0))
    return off * spacing * np.maximum(spacing, FINE) > KINK * largest


def quiet_ends(times: np.ndarray, moves: np.ndarray) -> np.ndarray:
    """At which of the inner samples (n - 2,) stretches begin or end that don't move (n - 1,)."""
    inner = moves[1:] != moves[:-1]
    if inner.any():
        changes = np.concatenate([[0], inner.nonzero()[0] + 1, [len(times) - 1]])
        quiet = ~moves[changes[:-1]] & (np.diff(times[changes]) >= QUIET)
        # A change counts if what lies on one of its sides is quiet.
        inner[changes[1:-1] - 1] = quiet[1:] | quiet[:-1]
    return inner
