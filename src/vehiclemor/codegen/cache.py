"""Files in the user's cache, addressed by content and checked whenever they are read.

Object code is executed, so a file counts only if it and its folders belong to this user, nobody
else can write them, and its content is unchanged.  Otherwise a warning names the file and it is
computed again.

Names hold hashes of the source that the content is computed from.  If several processes or threads
miss a file, one computes it.
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

Result = TypeVar("Result")
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


class Cache:
    """A folder of files; a temporary folder where it can't be written, or others could write it.

    Then every process compiles for itself, with its workers.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                pass
            reason = _distrust(folder.stat())
        except OSError as error:
            reason = error.strerror or "it can't be written"
        if reason:
            self.distrust(folder, reason)

    def path(self, name: str) -> Path:
        """Path of a file; others can't write to a folder on the way to it."""
        for parent in list(Path(name).parents)[:-1]:
            path = self.folder / parent
            with suppress(OSError):
                if reason := _distrust(path.lstat()):
                    self.distrust(path, reason)
        return self.folder / name

    def distrust(self, path: Path, reason: str) -> None:
        """Use a temporary folder from here on, removed when this process ends."""
        _LOG.warning("cache %s is not used (%s): every process compiles for itself", path, reason)
        self.folder = Path(tempfile.mkdtemp(prefix="vehiclemor-"))
        atexit.register(shutil.rmtree, self.folder, ignore_errors=True)


def cache_folder() -> Path:
    """Folder of the cache: $VEHICLEMOR_CACHE, or the user's cache folder, see `Cache`."""
    return _cache(os.environ.get("VEHICLEMOR_CACHE")).folder


@cache
def _cache(chosen: str | None) -> Cache:
    import platformdirs

    folder = Path(chosen) if chosen else platformdirs.user_cache_path("vehiclemor")
    # A process that changes its working directory stays with its cache.
    return Cache(folder.absolute())


def _distrust(status: os.stat_result) -> str:
    """Why a path may be another user's; empty if it can't be."""
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


def from_cache(name: str, compute: Callable[[], bytes]) -> bytes:
    """Content of a file of the cache; computed and written if it is missing, damaged or not ours.

    One process computes it, while others that want it wait.  Its name, a path in the cache, holds
    the hash of all that determines the content.
    """
    path = _cache(os.environ.get("VEHICLEMOR_CACHE")).path(name)
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
            content = compute()
            _write(path, _digest(name, content) + b"\n" + content)
    return content


@contextmanager
def _no_collection() -> Iterator[None]:
    """Pause the garbage collector: code that makes many small objects takes a tenth of the time."""
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


def _write(path: Path, content: bytes) -> None:
    """Write a file of the cache that nobody else can write; warn where that fails."""

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
    """Lock the file at a path; the system ends the lock of a process that dies.

    Without locks of the system, or in a folder that can't be written, each computes the file.
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
            # Those who wait, and those who come later, read the file.
            lock.unlink(missing_ok=True)
            file.close()


def cached_by_one_thread(compute: Callable[..., Result]) -> Callable[..., Result]:
    """The function with its results cached by arguments; one thread alone computes a result.

    Machine code needs it: its addresses are handed out, so it must never be loaded twice and the
    first be thrown away, as `functools.cache` may do.
    """
    results: dict[tuple[Any, ...], Result] = {}
    lock = RLock()

    @wraps(compute)
    def cached(*arguments: Any) -> Result:
        if arguments not in results:
            with lock:
                if arguments not in results:
                    results[arguments] = compute(*arguments)
        return results[arguments]

    return cached
