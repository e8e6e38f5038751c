"""Clock of the compiled loops (studies time complete calls), and the number of threads."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from time import thread_time
from typing import Any, TypeVar

Result = TypeVar("Result")
CLOCK = "CPU time of the thread"
clock = thread_time


def timed(run: Callable[[], Result]) -> tuple[Result, float]:
    """Result of a run, and its seconds."""
    began = clock()
    result = run()
    return result, clock() - began


@contextmanager
def one_thread() -> Iterator[None]:
    """Pin the linear algebra that is loaded, of NumPy and SciPy, to one thread of this process.

    How many threads add up a sum decides how it is rounded: results are then the same to the bit,
    whatever the number of cores, jobs or limits set outside.
    """
    # SciPy brings another library, by whichever of these is imported first.
    of_scipy = any(name in sys.modules for name in ("scipy.linalg", "scipy.special"))
    with _libraries(of_scipy).limit(limits=1, user_api="blas"):
        yield


@cache
def _libraries(of_scipy: bool) -> Any:
    del of_scipy
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
