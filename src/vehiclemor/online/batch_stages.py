"""Loops that are called for one run after the other, with words of their arguments changed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vehiclemor.codegen.loops import Loop, Prepared, address_of_array, loops
from vehiclemor.online.batch_loops import Stage
from vehiclemor.simulation.paths import PATH_LOOPS

NOTHING = np.zeros(0, dtype=np.int64)
NO_STAGE = Stage(NOTHING, NOTHING, NOTHING, NOTHING.reshape(0, 0), NOTHING)


def stage(
    call: Prepared,
    places: Sequence[int],
    columns: Sequence[np.ndarray],
    rows: Sequence[int] = (),
    runs: int = 0,
) -> Stage:
    """A stage whose words at some places change from run to run.

    Parameters
    ----------
    columns
        What stands at the places, in each run.
    rows
        Places of the words that are a number of rows.
    runs
        Number of runs, where nothing changes.
    """
    by_run = np.column_stack(columns) if len(columns) else np.empty((runs, 0), dtype=np.int64)
    return Stage(
        np.array([call.entry], dtype=np.int64),
        np.frombuffer(memoryview(call.words), dtype=np.int64),
        np.array(places, dtype=np.int64),
        np.ascontiguousarray(by_run),
        np.array(rows, dtype=np.int64),
    )


def addresses(arrays: np.ndarray) -> np.ndarray:
    """Addresses (runs,) of the parts of an array along its first dimension."""
    return address_of_array(arrays) + np.arange(len(arrays)) * arrays[0].nbytes


def batch_loop(name: str) -> Loop:
    """A loop over runs, see `batch_loops`."""
    return loops((*PATH_LOOPS, "online.batch_loops"), ("many_runs", "for_each_run"))[name]
