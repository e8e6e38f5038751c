"""Writing files whole: under a temporary name first, then moved into place."""

import os
import tempfile
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from vehiclemor.errors import FileError, MachineError, machine_reason

TEMPORARY = ".partial-"


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


def write_whole(path: Path, write: Callable[[Path], object]) -> Path:
    """Let `write` fill a temporary file beside `path`, then move it there.

    A reader sees the old content or the new one, never a part.

    Parameters
    ----------
    write
        Called with the temporary path, which ends like `path`.

    Raises
    ------
    FileError
        If the folder can't be written.
    MachineError
        If the disk is full or fails.
    """
    temporary = temporary_path(path)
    try:
        write(temporary)
        os.replace(temporary, path)
    except OSError as error:
        raise not_written(path, error) from None
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
    return path


def write_text(path: Path, text: str) -> Path:
    """Write a text file whole; its folder is made."""
    make_folder(path.parent)
    return write_whole(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))


def temporary_path(path: Path) -> Path:
    """Name beside `path` that no other process or thread writes under."""
    owner = f"{os.getpid()}-{threading.get_ident()}"
    return path.with_name(f"{TEMPORARY}{owner}-{path.name}")


def remove_leftovers(folder: Path) -> None:
    """Remove temporary files of processes that are no more; finished files are never touched."""
    for path in folder.glob(f"{TEMPORARY}*"):
        process = path.name.removeprefix(TEMPORARY).split("-")[0]
        if process.isdigit() and not _alive(int(process)):
            path.unlink(missing_ok=True)


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
