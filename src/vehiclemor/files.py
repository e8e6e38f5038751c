"""Files: where data are, what is read and replaced, and writing under a temporary name first."""

import os
import secrets
import shutil
import stat
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path

from vehiclemor.exceptions import FileError, MachineError, machine_reason

# Beginning of temporary names; and age (s) of a file that nobody is writing any more.
TEMPORARY, OLD = ".partial-", 3600.0
NO_FILE = "it is a folder, pipe or device, not a file"


@cache
def data_folder() -> Path:
    """Folder with `parameters`, `studies`, `protocols` and all other data; or `FileError`."""
    package = Path(__file__).resolve().parent
    for folder in (package / "data", package.parents[1] / "data"):
        if (folder / "parameters").is_dir():
            return folder
    raise FileError(
        f"the data files are missing: neither {package / 'data'} nor a checkout has them"
    )


def data_names(kind: str) -> list[str]:
    """Names (without ending) of the data files of one kind, sorted."""
    return sorted(path.stem for path in (data_folder() / kind).glob("*.toml"))


def make_folder(folder: Path) -> None:
    """Create a folder and those above it; `FileError` if it is a file, or that fails."""
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


def read_regular(path: Path, most: int) -> bytes:
    """Bytes of a file; `ValueError` if it is a folder, pipe or device, or has more than `most`."""
    status = path.stat()
    # Of a pipe or a device there may never be an end.
    if not stat.S_ISREG(status.st_mode):
        raise ValueError(NO_FILE)
    if status.st_size > most:
        raise ValueError(f"it has {status.st_size} bytes, more than {most}")
    return path.read_bytes()


def begins_with(beginning: bytes, at: int = 0) -> Callable[[Path], bool]:
    """Whether a file has these bytes at its begin, as `replaceable` asks."""

    def is_kind(path: Path) -> bool:
        with path.open("rb") as file:
            return file.read(at + len(beginning))[at:] == beginning

    return is_kind


def replaceable(path: Path, kind: str, is_kind: Callable[[Path], bool]) -> Path:
    """The path; `FileError` if something stands there that is not of this kind.

    Devices, pipes, sockets and links that lead nowhere are of no kind.
    """
    try:
        # Whether there is something is asked first: another process may just be storing it.
        if os.path.lexists(path) and not ((path.is_file() or path.is_dir()) and is_kind(path)):
            raise FileError(f"{path} exists and is no {kind}: it is not replaced; move it away")
    except OSError as error:
        raise not_written(path, error) from None
    return path


def not_written(path: Path, error: Exception) -> FileError | MachineError:
    """The error that says why a path can't be written."""
    machine = machine_reason(error)
    reason = machine or getattr(error, "strerror", None) or error
    return (MachineError if machine else FileError)(f"{path}: can't be written ({reason})")


def write_whole(path: Path, write: Callable[[Path], object], folder: Path | None = None) -> Path:
    """Let `write` fill a temporary file or folder, beside `path` by default; then move it there.

    The temporary path ends like `path`, on the same disk: a reader sees the old content or the new
    one, never a part.  `FileError` if the folder can't be written or the path is a device or the
    like, `MachineError` if the disk fails.
    """
    replaceable(path, "file or folder", Path.exists)
    target = path.absolute()
    temporary = temporary_path((folder or target.parent) / target.name)
    old = temporary.with_name(f"{temporary.name}.old")
    try:
        write(temporary)
        if target.is_dir():
            # Nothing moves onto a folder: the old one stays aside until the new one is there.
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
    """Write a text file at once; its folder is created."""
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
