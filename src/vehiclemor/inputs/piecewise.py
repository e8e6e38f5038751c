"""Piecewise polynomials through samples, as the compiled time loops take their inputs."""

from __future__ import annotations

from functools import cache

import numpy as np

from vehiclemor.codegen.loops import Loop, loops
from vehiclemor.exceptions import InputError
from vehiclemor.inputs.sample_loops import DISORDERED, NOT_FINITE, ROWS, Pieces

# What lies between samples, and the degree of its polynomials.
HOLDS = {"linear": 1, "zero": 0, "cubic": 3}


def lengths(pieces: Pieces) -> np.ndarray:
    """Lengths (pieces,) in s."""
    if len(pieces.starts):
        return np.diff(pieces.starts, append=pieces.edges[-1])
    counts = np.diff(pieces.first)
    return np.repeat(np.diff(pieces.edges) / counts, counts)


def scaled(pieces: Pieces, frequency: float, amplitudes: np.ndarray) -> Pieces:
    """So much faster, and each input times its own amplitude (inputs,)."""
    edges, starts = pieces.edges / frequency, pieces.starts / frequency
    return pieces._replace(
        edges=edges, starts=starts, coefficients=pieces.coefficients * amplitudes[:, None]
    )


def derivative(pieces: Pieces) -> Pieces:
    """By time; jumps have none."""
    rates = np.zeros_like(pieces.coefficients)
    rates[:, :, :-1] = pieces.coefficients[:, :, 1:] * np.arange(1.0, rates.shape[2])
    return pieces._replace(coefficients=rates / lengths(pieces)[:, None, None])


def at(pieces: Pieces, times: np.ndarray) -> np.ndarray:
    """Values (n, inputs) at times (n,) in s; at a jump those after it, at the end before."""
    order, values = np.argsort(times), np.empty((len(times), pieces.coefficients.shape[1]))
    increasing = np.empty_like(values)
    polynomial_loops()["sampled"](pieces, times[order], increasing)
    values[order] = increasing
    return values


@cache
def polynomial_loops() -> dict[str, Loop]:
    """Loops over polynomials of time."""
    return loops(("inputs.polynomial_loops",), ("sampled", "extent"))


def through(times: np.ndarray, samples: np.ndarray, hold: str) -> list[Pieces]:
    """Polynomials of each run through samples (runs, n, inputs) by one of `HOLDS`.

    One piece for each interval; segments end at kinks, at jumps, and where nothing moves for long.
    Runs with the same segments share all but their coefficients, which are of one array.
    `InputError` if times (n,) don't increase, or something isn't finite.
    """
    runs, n, inputs = samples.shape
    coefficients = np.empty((runs * (n - 1), inputs, HOLDS[hold] + 1))
    rows, counts = np.empty((runs, n), dtype=np.int64), np.empty(runs, dtype=np.int64)
    loop = loops(("inputs.sample_loops",), ("through",))["through"]
    even = loop(times, samples, np.empty((ROWS, n)), coefficients, rows, counts)
    if even < 0:
        raise InputError(f"samples of a signal: {_wrong(even, times, samples)}")
    starts, own = np.empty(0) if even else times[:-1].copy(), n - 1
    shared: dict[bytes, Pieces] = {}
    found = []
    for run, count in enumerate(counts.tolist()):
        first = rows[run, :count]
        key, part = first.tobytes(), coefficients[run * own : (run + 1) * own]
        if key not in shared:
            shared[key] = Pieces(times[first], first.copy(), starts, part)
        found.append(shared[key]._replace(coefficients=part))
    return found


def _wrong(status: int, times: np.ndarray, samples: np.ndarray) -> str:
    """What is wrong by what the loop has returned."""
    if status == DISORDERED and np.isfinite(times).all():
        row = int(np.argmax(times[1:] <= times[:-1]))
        now, before = times[row + 1], times[row]
        return f"times must increase, t[{row + 1}] = {now:.6g} s follows {before:.6g} s"
    run = NOT_FINITE - status
    given = times if status == DISORDERED else samples[run]
    finite = np.isfinite(given).reshape(len(given), -1).all(axis=1)
    if finite.all():
        return "the polynomials through them are not finite"
    where = f" of run {run}" if len(samples) > 1 and status != DISORDERED else ""
    return f"{'t' if status == DISORDERED else 'u'}[{finite.argmin()}]{where} is not finite"
