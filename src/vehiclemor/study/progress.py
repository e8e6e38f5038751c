"""Who is told how far long work is: it is done deep inside of comparisons and figures too."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

# Called with (study or other work, finished parts, all parts).
Progress = Callable[[str, int, int], None]
_LISTENER: ContextVar[Progress | None] = ContextVar("progress", default=None)


@contextmanager
def listening(progress: Progress | None) -> Iterator[None]:
    """Tell a function of the progress of all that is run inside."""
    token = _LISTENER.set(progress)
    try:
        yield
    finally:
        _LISTENER.reset(token)


def tell(work: str, done: int, total: int) -> None:
    """Tell whoever listens."""
    if progress := _LISTENER.get():
        progress(work, done, total)
