"""One process at a time, where several want to make the same file of the cache."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Alone with the file at a path; the system ends the lock of a process that dies.

    Where it has no locks, or the folder can't be written, each makes the file for itself.
    """
    lock = path.with_name(f"{path.name}.lock")
    file = _held(lock)
    try:
        yield
    finally:
        if file:
            # Who waits finds what was made, and who comes later does too.
            lock.unlink(missing_ok=True)
            file.close()


def _held(lock: Path) -> BinaryIO | None:
    try:
        from fcntl import LOCK_EX, flock

        lock.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        file = lock.open("wb")
        flock(file, LOCK_EX)
    except (ImportError, OSError):
        return None
    return file
