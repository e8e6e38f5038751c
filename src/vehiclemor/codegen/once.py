"""What is made once by its arguments and then kept, also where threads ask for it together."""

from collections.abc import Callable
from functools import wraps
from threading import RLock
from typing import Any, TypeVar

Made = TypeVar("Made")


def once(make: Callable[..., Made]) -> Callable[..., Made]:
    """The function, with a result by its arguments that is made by one thread alone.

    Machine code needs it: its addresses are handed out, so it must never be made twice and the
    first be thrown away, as `functools.cache` may do.
    """
    made: dict[tuple[Any, ...], Made] = {}
    lock = RLock()

    @wraps(make)
    def found(*arguments: Any) -> Made:
        if arguments not in made:
            with lock:
                if arguments not in made:
                    made[arguments] = make(*arguments)
        return made[arguments]

    return found
