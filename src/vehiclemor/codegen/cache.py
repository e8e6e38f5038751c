"""Files in the user's cache, addressed by content and checked whenever they are read.

Object code is executed, so a file counts only if it and its folders are this user's own and nobody
else can write them, and if it is as it was written; else it is named once, and made again.

Names hold hashes of the source that the content is made from.  Of several processes that miss a
file one makes it, of several threads too.
"""

import atexit
import gc
import hashlib
import logging
import os
import platform
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache, wraps
from importlib.metadata import version
from pathlib import Path
from threading import RLock
from typing import Any, TypeVar

from vehiclemor.exceptions import FileError, MachineError
from vehiclemor.files import write_whole
from vehiclemor.progress import compiling

Made = TypeVar("Made")
COMPILER_PACKAGES = ("numba", "llvmlite", "numpy")
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
_LOG = logging.getLogger("vehiclemor")


@cache
def compiler_identity() -> str:
    """Versions of the compiler, and the processor that object code is made for."""
    import llvmlite.binding as llvm

    parts = [f"{package} {version(package)}" for package in COMPILER_PACKAGES]
    features = llvm.get_host_cpu_features().flatten()
    return "\n".join([*parts, platform.machine(), llvm.get_host_cpu_name(), features])


def cache_folder() -> Path:
    """Folder of the cache: $VEHICLEMOR_CACHE, or the user's cache folder.

    Where it can't be written, or others could write it, a temporary folder: then every process
    compiles for itself, with its workers.
    """
    return _folder(os.environ.get("VEHICLEMOR_CACHE"))[0]


@cache
def _folder(chosen: str | None) -> list[Path]:
    """The folder, the only item; another takes its place if files in it can't be trusted."""
    import platformdirs

    folder = Path(chosen) if chosen else platformdirs.user_cache_path("vehiclemor")
    # A process that changes its folder keeps its cache.
    folder = folder.absolute()
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
        reason = _distrust(folder.stat())
    except OSError as error:
        reason = error.strerror or "it can't be written"
    return [_instead(folder, reason) if reason else folder]


def _folder_of(name: str) -> Path:
    """The folder of the cache; from here on another if others may put a file of this name there."""
    held = _folder(os.environ.get("VEHICLEMOR_CACHE"))
    for part in list(Path(name).parents)[:-1]:
        with suppress(OSError):
            if reason := _distrust((held[0] / part).lstat()):
                held[0] = _instead(held[0] / part, reason)
    return held[0]


def _instead(folder: Path, reason: str) -> Path:
    """A temporary folder, removed when this process ends."""
    _LOG.warning("cache %s is not used (%s): every process compiles for itself", folder, reason)
    temporary = Path(tempfile.mkdtemp(prefix="vehiclemor-"))
    atexit.register(shutil.rmtree, temporary, ignore_errors=True)
    return temporary


def _distrust(status: os.stat_result) -> str:
    """Why what lies there may be another user's; empty if it can't be."""
    if stat.S_ISLNK(status.st_mode):
        return "it is a link"
    if not hasattr(os, "geteuid"):
        return ""
    if status.st_uid != os.geteuid():
        return "it belongs to another user"
    if status.st_mode & OTHERS_WRITE:
        return "other users can write it, see chmod go-w"
    return ""


def digest_of(parts: Sequence[str]) -> str:
    """Hash of all that determines the content of a file."""
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:20]


def fetched(name: str, make: Callable[[], bytes]) -> bytes:
    """Content of a file of the cache; made and written if it is missing, damaged or not ours.

    One process makes it, while others that want it wait.  Its name, a path in the cache, holds the
    hash of all that determines the content.
    """
    path = _folder_of(name) / name
    content, reason = _checked(path, name)
    if content is not None:
        return content
    if reason:
        _LOG.warning("%s is made again: %s", path, reason)
    # Loops take seconds, most kernels a tenth of one.
    announced = compiling(path.stem.partition("-")[0], slow=name.startswith("loops"))
    with announced, locked(path), _no_collection():
        content, _ = _checked(path, name)
        if content is None:
            content = make()
            _keep(path, _digest(name, content) + b"\n" + content)
    return content


@contextmanager
def _no_collection() -> Iterator[None]:
    """A tenth of the time of what makes many small objects and drops few."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def _digest(name: str, content: bytes) -> bytes:
    """Hash that stands before the content; it does not hold under another name."""
    return hashlib.sha256(name.encode() + b"\n" + content).hexdigest().encode()


def _checked(path: Path, name: str) -> tuple[bytes | None, str]:
    """Content of a file, or why it can't be trusted; neither where there is none."""
    try:
        reason = _distrust(path.lstat())
        digest, _, content = (b"" if reason else path.read_bytes()).partition(b"\n")
    except FileNotFoundError:
        return None, ""
    except OSError as error:
        return None, error.strerror or "it can't be read"
    if reason or digest != _digest(name, content):
        return None, reason or "the file is damaged"
    return content, ""


def _keep(path: Path, content: bytes) -> None:
    """Write a file of the cache that nobody else can write; where that can't be, go on."""

    def write(temporary: Path) -> None:
        temporary.touch(0o600)
        temporary.write_bytes(content)

    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_whole(path, write)
    except (OSError, FileError, MachineError) as error:
        _LOG.warning("%s is not kept: %s", path, error)


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Alone with the file at a path; the system ends the lock of a process that dies.

    Where it has no locks, or the folder can't be written, each makes the file for itself.
    """
    lock, file = path.with_name(f"{path.name}.lock"), None
    with suppress(ImportError, OSError):
        from fcntl import LOCK_EX, flock

        lock.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        file = lock.open("wb")
        flock(file, LOCK_EX)
    try:
        yield
    finally:
        if file:
            # Who waits finds what was made, and who comes later does too.
            lock.unlink(missing_ok=True)
            file.close()


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
