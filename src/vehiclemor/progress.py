"""Log slow first use, and report the progress of studies.

Lines go to the logger `vehiclemor`.  They appear on standard error where the application has no
handlers, and are silenced as usual: `logging.getLogger("vehiclemor").setLevel(logging.WARNING)`.
"""

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from time import perf_counter

_LOG = logging.getLogger("vehiclemor")
# Compilation of a lone kernel within this time (s) is not mentioned.
QUICK = 1.0


class StandardError(logging.Handler):
    """Prints to what standard error is at that time; silent beside an application's handlers."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print a line."""
        if not logging.getLogger().handlers and sys.stderr is not None:
            sys.stderr.write(f"{self.format(record)}\n")
            sys.stderr.flush()


if not _LOG.handlers:
    _LOG.addHandler(StandardError())
    if _LOG.level == logging.NOTSET:
        _LOG.setLevel(logging.INFO)


@dataclass
class FirstUse:
    """A use of something whose code may not be in the cache yet."""

    what: str
    announced: bool = False
    seconds: float = 0.0


_CURRENT: ContextVar[FirstUse | None] = ContextVar("first use", default=None)


@contextmanager
def first_use(what: str) -> Iterator[FirstUse]:
    """Code that is missing inside is announced once; a first use within another is part of it."""
    if outer := _CURRENT.get():
        yield outer
        return
    use = FirstUse(what)
    token = _CURRENT.set(use)
    try:
        yield use
    finally:
        _CURRENT.reset(token)
    if use.announced or use.seconds > QUICK:
        _LOG.info("%s: compiled in %.1f s", what, use.seconds)


@contextmanager
def compiling(what: str, slow: bool = True) -> Iterator[None]:
    """Derivation or compilation of something that is missing in the cache.

    It is announced if it is slow, or part of a first use.
    """
    announce = slow or _CURRENT.get() is not None
    with first_use(what) as use:
        if announce and not use.announced:
            use.announced = True
            _LOG.info("first use of %s: compiling, cached for later runs", use.what)
        begin = perf_counter()
        try:
            yield
        finally:
            use.seconds += perf_counter() - begin


# Called with (study or other work, finished parts, all parts).
Progress = Callable[[str, int, int], None]
_LISTENER: ContextVar[Progress | None] = ContextVar("progress", default=None)


@contextmanager
def listening(progress: Progress | None) -> Iterator[None]:
    """Call a function with the progress of all that runs inside, deep in comparisons too."""
    token = _LISTENER.set(progress)
    try:
        yield
    finally:
        _LISTENER.reset(token)


def tell(work: str, done: int, total: int) -> None:
    """Report progress to the function that listens."""
    if progress := _LISTENER.get():
        progress(work, done, total)
