"""Inputs as piecewise polynomials, so that compiled loops can evaluate them at any time.

Of a function: between two break points of a maneuver an input is smooth: polynomials of degree 5
through the Chebyshev points of equal pieces (L. N. Trefethen, Approximation Theory and
Approximation Practice, 2013, chapter 2), halved until the error half-way between these points is
below `ACCURACY` times the input's largest value.

Of samples: one polynomial between two of them, and the samples at which a time loop must begin
anew.
"""

from collections.abc import Sequence
from functools import cache
from itertools import pairwise

import numpy as np

from vehiclemor.exceptions import InputError
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.inputs.polynomial_loops import EQUIDISTANT, Pieces
from vehiclemor.multibody.quantities import integral_of

ACCURACY = 1e-11
MOST_PIECES = 1 << 15
DEGREE = 5
# Interpolation between samples, and the degree of its polynomials.
HOLDS = {"linear": 1, "zero": 0, "cubic": 3}
# Change of slope beside that of the neighbouring samples, times the spacing or `FINE` (s), relative
# to the largest value: from here on a sample is a break point.  Without it, steps of a loose
# tolerance pass over noise that they do not see.
KINK, FINE = 1e-3, 0.01
# Shortest stretch (s) of equal samples that is a rest: a run at rest could step over its end.
REST = 0.1
# Largest swing of a spline within a rest, relative to the largest value.
SWING = 1e-6
# Runs that are computed together: their arrays fit into the cache of a processor.
TOGETHER = 1000
INFINITE = "samples of a signal: the polynomials through them are not finite"


# --- of functions ---------------------------------------------------------------------------------


def fitted_pieces(maneuver: Excitation) -> Pieces:
    """Piecewise polynomials that approximate the functions of a maneuver.

    `InputError` if an input isn't finite, or isn't smooth between the break points.
    """
    inner = sorted(t for t in set(maneuver.break_points) if 0.0 < t < maneuver.duration)
    edges = np.array([0.0, *inner, maneuver.duration])
    probe = np.linspace(0.0, maneuver.duration, 1001)
    values = maneuver.at(probe)
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        sample, column = bad[0]
        raise InputError(
            f"input {maneuver.inputs[column]} is not finite at t = {probe[sample]:.6g} s"
        )
    # A short pulse may lie between the probes of the run.
    inside = np.concatenate([np.linspace(a, b, 18)[1:-1] for a, b in pairwise(edges)])
    times, samples = np.concatenate([probe, inside]), np.concatenate([values, maneuver.at(inside)])
    largest = np.abs(samples).max(axis=0) + 1e-300
    parts = [_segment(maneuver, (a, b), largest, (times, samples)) for a, b in pairwise(edges)]
    first = np.cumsum([0, *(len(part) for part in parts)])
    return Pieces(edges, first.astype(np.int64), np.empty(0), np.concatenate(parts))


def _segment(
    maneuver: Excitation,
    ends: tuple[float, float],
    largest: np.ndarray,
    known: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """Polynomials (pieces, 6, inputs) between two break points, which also give known values."""
    a, b = ends
    # One-sided values at the ends, where the input may jump.
    inside = min(max(1e-13, 2.0 * np.spacing(b) / (b - a)), 1e-6)
    known_parts = (known[0] - a) / (b - a)
    within = (known_parts > inside) & (known_parts < 1.0 - inside)
    known_parts, known_values = known_parts[within], known[1][within]

    def inputs_at(parts: np.ndarray) -> np.ndarray:
        times = a + (b - a) * np.clip(parts, inside, 1.0 - inside)
        values = maneuver.at(times.ravel())
        if not np.isfinite(values).all():
            raise InputError(f"an input is not finite between t = {a:g} and {b:g} s")
        return values.reshape(*parts.shape, -1)

    nodes = _nodes()
    middles = 0.5 * (nodes[1:] + nodes[:-1])
    pieces = 8
    while pieces <= MOST_PIECES:
        left = np.arange(pieces)[:, None]
        values = inputs_at((left + nodes) / pieces)
        if np.all(values == values[0, 0]) and np.all(known_values == values[0, 0]):
            constant = np.zeros((1, DEGREE + 1, values.shape[2]))
            constant[0, 0] = values[0, 0]
            return constant
        coefficients = _powers(nodes) @ values
        # The first and the last node have been moved inside.
        coefficients[0] = _powers(np.fmax(nodes, inside * pieces)) @ values[0]
        coefficients[-1] = _powers(np.fmin(nodes, 1.0 - inside * pieces)) @ values[-1]
        between = middles[:, None] ** np.arange(DEGREE + 1) @ coefficients
        errors = between - inputs_at((left + middles) / pieces)
        further = _values(coefficients, known_parts) - known_values
        if max(np.abs(e / largest).max(initial=0.0) for e in (errors, further)) < ACCURACY:
            return coefficients
        pieces *= 2
    raise InputError(
        f"maneuver {maneuver.name!r} is not smooth between t = {a:g} and {b:g} s; "
        f"name the times of its corners as break points"
    )


@cache
def _nodes() -> np.ndarray:
    """Chebyshev points on [0, 1], both ends among them."""
    return 0.5 - 0.5 * np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)


def _powers(nodes: np.ndarray) -> np.ndarray:
    """Coefficients of the powers of the polynomials that are 1 at one node, 0 at the others."""
    return np.linalg.inv(nodes[:, None] ** np.arange(DEGREE + 1))


def _values(coefficients: np.ndarray, parts: np.ndarray) -> np.ndarray:
    """Polynomials (n, inputs) at parts (n,) between 0 and 1 of their segment."""
    pieces = np.floor(parts * len(coefficients)).astype(int)
    powers = (parts * len(coefficients) - pieces)[:, None] ** np.arange(DEGREE + 1)
    return np.einsum("npi,np->ni", coefficients[pieces], powers)


# --- of samples -----------------------------------------------------------------------------------


def interpolants(
    times: np.ndarray, samples: np.ndarray, hold: str, names: Sequence[str]
) -> list[Pieces]:
    """Polynomials of each run through samples (runs, n, inputs) by one of `HOLDS`.

    One piece for each interval; segments end at kinks, at jumps, and at the ends of rests.
    `InputError` if times (n,) don't increase, a number isn't finite, or a rate is wrong.
    """
    _check(times, samples)
    runs = []
    for first in range(0, len(samples), TOGETHER):
        runs += _interpolants(times, samples[first : first + TOGETHER], hold, names)
    return runs


def _interpolants(
    times: np.ndarray, samples: np.ndarray, hold: str, names: Sequence[str]
) -> list[Pieces]:
    """The same; runs with the same segments share all arrays but their coefficients."""
    lengths = np.diff(times)
    with np.errstate(over="ignore", invalid="ignore"):
        rises = np.diff(samples, axis=1)
        coefficients = _coefficients(times, samples, rises, hold)
        check_rates(coefficients, names)
        breaks = np.zeros(samples.shape[:2], dtype=bool)
        if hold == "zero":
            breaks[:, 1:-1] = (rises[:, :-1] != 0.0).any(axis=2)
        else:
            mark_kinks(breaks, samples, rises, lengths)
            mark_rests(breaks, times, samples, coefficients)
    breaks[:, 0] = breaks[:, -1] = True
    equidistant = lengths.max() - lengths.min() <= EQUIDISTANT * lengths[0]
    starts = np.empty(0) if equidistant else times[:-1].copy()
    segments: dict[bytes, Pieces] = {}
    runs = []
    for row, run_coefficients in zip(breaks, coefficients, strict=True):
        key = row.tobytes()
        if key not in segments:
            first = np.flatnonzero(row)
            segments[key] = Pieces(times[first], first, starts, run_coefficients)
        runs.append(segments[key]._replace(coefficients=run_coefficients))
    return runs


def _check(times: np.ndarray, samples: np.ndarray) -> None:
    """Raise `InputError` if a number isn't finite or times don't increase."""
    if not np.isfinite(times).all():
        row = np.isfinite(times).argmin()
        raise InputError(f"samples of a signal: t[{row}] is not finite")
    if not np.isfinite(samples).all():
        run, row, _ = np.argwhere(~np.isfinite(samples))[0]
        where = f" of run {run}" if len(samples) > 1 else ""
        raise InputError(f"samples of a signal: u[{row}]{where} is not finite")
    increases = times[1:] > times[:-1]
    if not increases.all():
        row = int(increases.argmin())
        raise InputError(
            f"samples of a signal: times must increase, t[{row + 1}] = {times[row + 1]:.6g} s "
            f"follows {times[row]:.6g} s"
        )


def _coefficients(
    times: np.ndarray, samples: np.ndarray, rises: np.ndarray, hold: str
) -> np.ndarray:
    """Coefficients (runs, n - 1, degree + 1, inputs) of powers of the passed part of an interval.

    Of degree 3 they are the spline with continuous second derivatives, not-a-knot at its ends.
    """
    runs, intervals, inputs = rises.shape
    coefficients = np.empty((runs, intervals, HOLDS[hold] + 1, inputs))
    coefficients[:, :, 0] = samples[:, :-1]
    if hold == "linear":
        coefficients[:, :, 1] = rises
    elif hold == "cubic":
        # Imported with the first spline: it takes a tenth of a second.
        from scipy.interpolate import CubicSpline

        try:
            spline = CubicSpline(times, samples, axis=1)
        except ValueError:
            raise InputError(INFINITE) from None
        lengths = np.diff(times)[:, None]
        for power in (1, 2, 3):
            # Of the spline by power from the highest on, interval, run and input.
            by_interval = np.moveaxis(spline.c[3 - power], 0, 1)
            coefficients[:, :, power] = by_interval * lengths**power
    if not np.isfinite(coefficients).all():
        raise InputError(INFINITE)
    return coefficients


def mark_kinks(
    breaks: np.ndarray, samples: np.ndarray, rises: np.ndarray, lengths: np.ndarray
) -> None:
    """Mark the samples at which the slope changes otherwise than beside them.

    A finely sampled curve bends by as much from sample to sample; noise, corners and coarse samples
    do not, and an integrator must not step over these.
    """
    spacing = 0.5 * (lengths[1:] + lengths[:-1])[:, None]
    bends = np.zeros(samples.shape)
    bends[:, 1:-1] = np.diff(rises / lengths[:, None], axis=1) / spacing
    here, beside = bends[:, 1:-1], 0.5 * (bends[:, :-2] + bends[:, 2:])
    # A sample beside a corner doesn't bend itself.
    excess = np.minimum(np.abs(here - beside), np.abs(here))
    excess *= spacing
    excess *= np.maximum(spacing, FINE)
    largest = np.abs(samples).max(axis=1, keepdims=True)
    breaks[:, 1:-1] |= (excess > KINK * largest).any(axis=2)


def mark_rests(
    breaks: np.ndarray, times: np.ndarray, samples: np.ndarray, coefficients: np.ndarray
) -> None:
    """Mark where long stretches begin and end in which no input moves.

    A spline that sets off from rest swings between the samples before: these are marked too.
    """
    still = np.zeros((len(samples), len(times) + 1), dtype=bool)
    still[:, 1:-1] = (samples[:, 1:] == samples[:, :-1]).all(axis=2)
    run, begin = np.nonzero(still[:, 1:] & ~still[:, :-1])
    end = np.nonzero(still[:, :-1] & ~still[:, 1:])[1]
    long = times[end] - times[begin] >= REST
    if not long.any():
        return
    run, begin, end = run[long], begin[long], end[long]
    breaks[run, begin] = breaks[run, end] = True
    if coefficients.shape[2] > HOLDS["linear"] + 1:
        changes = np.zeros(breaks.shape, dtype=int)
        changes[run, begin], changes[run, end] = 1, -1
        resting = changes.cumsum(axis=1)[:, :-1] > 0
        largest = np.abs(samples).max(axis=1)[:, None, None]
        swings = (np.abs(coefficients[:, :, 1:]) > SWING * largest).any(axis=(2, 3))
        swings &= resting
        breaks[:, :-1] |= swings
        breaks[:, 1:] |= swings


def check_rates(coefficients: np.ndarray, names: Sequence[str]) -> None:
    """Raise `InputError` if an input moves between samples, but what is named its rate is zero.

    Coefficients are (runs, pieces, degree + 1, inputs).  How well rates fit that are not zero can't
    be told from samples that are far apart.
    """
    for column, name in enumerate(names):
        lower = integral_of(name)
        # A rate that jumps may have the rate zero.
        if lower not in names or integral_of(lower) in names:
            continue
        moves = coefficients[:, :, 1:, names.index(lower)].any(axis=(1, 2))
        if (moves & ~coefficients[..., column].any(axis=(1, 2))).any():
            raise InputError(
                f"{lower} moves, but its rate {name} is 0; left out, it follows by a cubic hold"
            )


def piece_lengths(pieces: Pieces) -> np.ndarray:
    """How long each piece lasts (pieces,), in s."""
    if len(pieces.starts):
        return np.diff(pieces.starts, append=pieces.edges[-1])
    counts = np.diff(pieces.first)
    return np.repeat(np.diff(pieces.edges) / counts, counts)


def time_derivative(pieces: Pieces) -> Pieces:
    """Derivative by time; jumps have none."""
    lengths = piece_lengths(pieces)
    rates = np.zeros_like(pieces.coefficients)
    powers = np.arange(1.0, rates.shape[1])[:, None]
    rates[:, :-1] = pieces.coefficients[:, 1:] * powers
    return pieces._replace(coefficients=rates / lengths[:, None, None])
