"""A word on standard error about what takes long: lines of the logger `vehiclemor`.

They appear where the application has no handlers of its own, and are silenced as usual:
`logging.getLogger("vehiclemor").setLevel(logging.WARNING)`.
"""

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from threading import Timer
from time import perf_counter

# What is done within this time (s) is not worth a word.
QUIET = 1.0
_LOG = logging.getLogger("vehiclemor")
# Lines of this process.
_SAID: set[str] = set()


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


class _Task:
    """What is told of as one: that it has begun, once it has taken long, and then its end."""

    def __init__(self, began: str, ended: str) -> None:
        self.began, self.ended = began, ended
        self.seconds, self.told = 0.0, False

    def tell(self) -> None:
        # One name may stand for several files.
        if self.began not in _SAID:
            _SAID.add(self.began)
            self.told = True
            _LOG.info(self.began)

    def tell_end(self) -> None:
        if self.told:
            _LOG.info("%s in %.1f s", self.ended, self.seconds)

    @contextmanager
    def running(self) -> Iterator[None]:
        """A part of it; the seconds of all parts count."""
        timer = Timer(max(QUIET - self.seconds, 0.0), self.tell)
        timer.daemon = True
        begun = perf_counter()
        if not self.told:
            timer.start()
        try:
            yield
        finally:
            timer.cancel()
            if timer.is_alive():
                timer.join()
            self.seconds += perf_counter() - begun


_CURRENT: ContextVar[_Task | None] = ContextVar("first use", default=None)


@contextmanager
def first_use(what: str) -> Iterator[_Task]:
    """All that is derived and compiled inside is told of as one; within another, part of that."""
    if task := _CURRENT.get():
        yield task
        return
    task = _Task(f"first use of {what}: compiling; kept for later runs", f"{what}: compiled")
    token = _CURRENT.set(task)
    try:
        yield task
    finally:
        _CURRENT.reset(token)
    task.tell_end()


@contextmanager
def making(what: str) -> Iterator[None]:
    """Deriving or compiling something that is kept for later runs."""
    with first_use(what) as task, task.running():
        yield


@contextmanager
def telling(what: str) -> Iterator[None]:
    """Anything else that may take long."""
    task = _Task(what, f"{what}: done")
    with task.running():
        yield
    task.tell_end()


# Called with (study or other work, finished parts, all parts).
Progress = Callable[[str, int, int], None]
_LISTENER: ContextVar[Progress | None] = ContextVar("progress", default=None)


@contextmanager
def listening(progress: Progress | None) -> Iterator[None]:
    """Tell a function of the progress of all that is run inside, deep in comparisons too."""
    token = _LISTENER.set(progress)
    try:
        yield
    finally:
        _LISTENER.reset(token)


def tell(work: str, done: int, total: int) -> None:
    """Tell whoever listens."""
    if progress := _LISTENER.get():
        progress(work, done, total)
