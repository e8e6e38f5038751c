"""Time that a compiled loop takes by its own account; studies take whole calls, see `timing`."""

from collections.abc import Callable
from time import thread_time
from typing import TypeVar

Result = TypeVar("Result")
CLOCK = "CPU time of the thread"
clock = thread_time


def timed(run: Callable[[], Result]) -> tuple[Result, float]:
    """Result of a run, and its seconds."""
    began = clock()
    result = run()
    return result, clock() - began
