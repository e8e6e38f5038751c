"""Time that a compiled loop takes; measured several times over where a study of times asks for it.

Between two runs of a comparison Python does other work, which throws the loop's code and data out
of the caches: a run of 50 microseconds then takes 200.  A user who runs a model again and again
finds them warm.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from time import thread_time
from typing import TypeVar

import numpy as np

Result = TypeVar("Result")
CLOCK = "CPU time of the thread"
clock = thread_time
_repeats = ContextVar("repeats", default=1)


@contextmanager
def repeated(times: int) -> Iterator[None]:
    """Within it every run is done so many times, and its seconds are the median of all but one.

    The first of them warms the caches.
    """
    token = _repeats.set(times)
    try:
        yield
    finally:
        _repeats.reset(token)


def timed(run: Callable[[], Result], counts: np.ndarray) -> tuple[Result, float]:
    """Result of a run, and its seconds.

    Parameters
    ----------
    run
        Writes the same each time, but for what it adds to its counts.
    counts
        Set back before each time.
    """
    initial, seconds = counts.copy(), []
    while True:
        began = clock()
        result = run()
        seconds.append(clock() - began)
        if len(seconds) >= _repeats.get():
            break
        counts[:] = initial
    return result, float(np.median(seconds[1:] or seconds))
