"""Writing files whole: under a temporary name first, then moved into place."""

import errno
import os
import secrets
import shutil
import stat
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from vehiclemor.exceptions import FileError, MachineError, machine_reason

# Beginning of temporary names; and age (s) of a file that nobody is writing any more.
TEMPORARY, OLD = ".partial-", 3600.0


def make_folder(folder: Path) -> None:
    """Make a folder and those above it; `FileError` if it is a file, or can't be made."""
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


def read_regular(path: Path, most: int) -> bytes:
    """Content of a regular file of at most so many bytes; `FileError` for anything else there.

    Pipes would wait for ever, and devices have no end.
    """
    described = path.stat()
    if stat.S_ISDIR(described.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISREG(described.st_mode):
        raise FileError(f"{path}: a device or pipe, not a file")
    if described.st_size > most:
        raise FileError(f"{path}: has {described.st_size} bytes, more than {most}")
    return path.read_bytes()


def write_whole(path: Path, write: Callable[[Path], object], folder: Path | None = None) -> Path:
    """Let `write` fill a temporary file or folder, beside `path` by default; then move it there.

    The temporary path ends like `path`, on the same disk: a reader sees the old content or the new
    one, never a part.  `FileError` if the folder can't be written, or a device or pipe is there,
    `MachineError` if the disk fails.
    """
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise FileError(f"{path}: a device or pipe, not a file: it is not replaced")
    whole = path.absolute()
    temporary = temporary_path((folder or whole.parent) / whole.name)
    old = temporary.with_name(f"{temporary.name}.old")
    try:
        write(temporary)
        if whole.is_dir():
            # Nothing moves onto a folder: the old one is kept until the new one is there.
            os.replace(path, old)
        os.replace(temporary, path)
        shutil.rmtree(old, ignore_errors=True)
    except OSError as error:
        raise not_written(path, error) from None
    finally:
        if temporary.is_dir():
            shutil.rmtree(temporary, ignore_errors=True)
        else:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)
    return path


def write_text(path: Path, text: str) -> Path:
    """Write a text file whole; its folder is made."""
    make_folder(path.parent)
    return write_whole(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))


def temporary_path(path: Path) -> Path:
    """Name beside `path` that nobody else writes under."""
    return path.with_name(f"{TEMPORARY}{secrets.token_hex(8)}-{path.name}")


def remove_leftovers(folder: Path) -> None:
    """Remove temporary files of processes that were killed; finished files are never touched."""
    for path in folder.glob(f"{TEMPORARY}*"):
        with suppress(OSError):
            if time.time() - path.stat().st_mtime > OLD:
                path.unlink()
