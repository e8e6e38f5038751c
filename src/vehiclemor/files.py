"""Writing files whole: under a temporary name first, then moved into place."""

import hashlib
import os
import platform
import shutil
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path

from vehiclemor.errors import FileError, MachineError, machine_reason

TEMPORARY, DAY = ".partial-", 86400.0


def make_folder(folder: Path) -> None:
    """Make a folder and those above it.

    Raises
    ------
    FileError
        If it is a file, or can't be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise FileError(f"{folder}: not a folder") from None
    except OSError as error:
        raise not_written(folder, error) from None


def probe_folder(folder: Path) -> None:
    """Raise `VehiclemorError` if a folder can't be written."""
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise not_written(folder, error) from None


def not_written(path: Path, error: Exception) -> FileError | MachineError:
    """The error that tells why a path can't be written."""
    machine = machine_reason(error)
    reason = machine or getattr(error, "strerror", None) or error
    return (MachineError if machine else FileError)(f"{path}: can't be written ({reason})")


def write_whole(path: Path, write: Callable[[Path], object], folder: Path | None = None) -> Path:
    """Let `write` fill a temporary file in a folder, by default that of `path`; then move it there.

    A reader sees the old content or the new one, never a part.

    Parameters
    ----------
    write
        Called with the temporary path, which ends like `path`.
    folder
        On the same disk.

    Raises
    ------
    FileError
        If the folder can't be written.
    MachineError
        If the disk is full or fails.
    """
    temporary = temporary_path((folder or path.parent) / path.name)
    try:
        return _moved(temporary, path, write)
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_folder(path: Path, write: Callable[[Path], object]) -> Path:
    """As `write_whole`, of a folder that is not there yet."""
    temporary = temporary_path(path.absolute())
    try:
        return _moved(temporary, path, write)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _moved(temporary: Path, path: Path, write: Callable[[Path], object]) -> Path:
    """Fill a temporary file or folder, and move it into place."""
    try:
        write(temporary)
        os.replace(temporary, path)
    except OSError as error:
        raise not_written(path, error) from None
    return path


def write_text(path: Path, text: str) -> Path:
    """Write a text file whole; its folder is made."""
    make_folder(path.parent)
    return write_whole(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))


def temporary_path(path: Path) -> Path:
    """Name beside `path` that no other process or thread writes under."""
    owner = f"{os.getpid()}-{threading.get_ident()}-{_machine()}"
    return path.with_name(f"{TEMPORARY}{owner}-{path.name}")


def remove_leftovers(folder: Path) -> None:
    """Remove temporary files of processes that are no more; finished files are never touched.

    Of another machine's processes, which share the folder, nothing is known: theirs stay for a day.
    """
    for path in folder.glob(f"{TEMPORARY}*"):
        process, _, machine, *_ = [*path.name.removeprefix(TEMPORARY).split("-"), "", ""]
        with suppress(OSError):
            if machine == _machine() and process.isdigit():
                ended = not _alive(int(process))
            else:
                ended = time.time() - path.stat().st_mtime > DAY
            if ended:
                path.unlink()


@cache
def _machine() -> str:
    return hashlib.sha256(platform.node().encode()).hexdigest()[:8]


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    try:
        # A process that has ended stays known until its parent has asked for it.
        return not Path(f"/proc/{process}/stat").read_text().rpartition(") ")[2].startswith("Z")
    except OSError:
        return True
