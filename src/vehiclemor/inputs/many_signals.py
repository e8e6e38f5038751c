"""Signals for many runs, of one array of samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vehiclemor.arguments import real_array
from vehiclemor.errors import InputError, one_line
from vehiclemor.inputs.piecewise import through
from vehiclemor.inputs.signal import OUTPUT_STEP, Signal


def many_signals(
    t: Any,
    u: Any,
    hold: str = "linear",
    *,
    inputs: str | Sequence[str] = (),
    output_step: float = OUTPUT_STEP,
) -> list[Signal]:
    """Signals through samples at the same times, by one compiled call for all.

    Parameters
    ----------
    t
        Increasing times (n,) in s.
    u
        Inputs (runs, n) or (runs, n, inputs) at these times, SI units.
    hold, inputs, output_step
        See `Signal.from_samples`.

    Raises
    ------
    InputError
        If the samples are none of signals.
    """
    try:
        times, values = real_array(t), real_array(u)
    except (TypeError, ValueError) as error:
        raise InputError(f"samples of signals: {one_line(error)}") from None
    if values.ndim not in (2, 3) or not len(values) or values.shape[1:2] != times.shape:
        raise InputError(
            f"samples of signals: t has shape {times.shape} and u {values.shape}, "
            f"not (n,) and (runs, n) or (runs, n, inputs)"
        )
    values = np.ascontiguousarray(values.reshape(*values.shape[:2], -1))
    # All that they share is checked with the first.
    first = Signal.from_samples(times, values[0], hold, inputs=inputs, output_step=output_step)
    finite = np.isfinite(values).all(axis=(1, 2))
    if not finite.all():
        raise InputError(f"samples of signals: run {finite.argmin()} holds what is not finite")
    every = through(times - times[0], values, hold)
    return [replace(first, pieces=pieces, kept={}) for pieces in every]
