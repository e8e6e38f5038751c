"""Datasets as netCDF-4 files: combined results, single runs, saved models.

Each ends with the hash of its bytes, which is checked before the library reads them: of damaged
ones it may never come back.  Anybody can write such a hash, so what is neither data of the package,
nor stored in a results folder, nor known to this process is first read in one that can be ended.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vehiclemor.exceptions import CorruptError, FileError, MachineError, machine_reason
from vehiclemor.files import NO_FILE, read_regular, write_whole

if TYPE_CHECKING:
    import netCDF4
    import xarray as xr

# Group of a file that ends with the hash of its bytes, and what stands before that hash: behind the
# data, where no reader of netCDF looks.
INTEGRITY, SEAL = "integrity", b"\nvehiclemor sha256 "
# What reads a file of others.  Bytes that a file and its variables may have; seconds that reading
# any may take, and bytes that are read in a further one.
READ = """
import math, sys, netCDF4
with netCDF4.Dataset(sys.argv[1]) as file:
    size = sum(8 * math.prod(variable.shape) for variable in file.variables.values())
    if size > int(sys.argv[2]):
        sys.exit(3)
    for owner in (file, *file.variables.values()):
        owner.__dict__
    for variable in file.variables.values():
        variable[...]
"""
MOST_BYTES, LIMIT, SPEED = 8_000_000_000, 10.0, 2e7
DAMAGED = "damaged, or no netCDF-4 file"
# Of files that this process has written or read elsewhere.
_KNOWN: set[bytes] = set()


def write_dataset(dataset: xr.Dataset, path: Path) -> None:
    """Write a dataset to a file, which replaces an older one when it is complete."""
    import netCDF4
    from xarray.backends import NetCDF4DataStore

    def write(temporary: Path) -> None:
        try:
            with netCDF4.Dataset(temporary, "w") as file:
                dataset.dump_to_store(NetCDF4DataStore(file))
                file.createGroup(INTEGRITY)
            with temporary.open("ab") as file:
                digest = _digest(temporary.read_bytes())
                file.write(SEAL + digest)
                _KNOWN.add(digest)
        except (OSError, RuntimeError):
            # The library hides the reason; plain writing of as much as there is tells it.
            temporary.write_bytes(bytes(dataset.nbytes + (1 << 16)))
            raise

    try:
        write_whole(path, write)
    except RuntimeError as error:
        raise FileError(f"{path}: can't be written ({error})") from None


def read_dataset(path: Path, stored: bool = False) -> xr.Dataset:
    """A result file of this package, which is `stored` if it is a results folder's.

    `FileError` if it is missing; `CorruptError` if it is corrupt, or of others.
    """
    import xarray as xr
    from xarray.backends import NetCDF4DataStore

    mend = "; move it away and run again"
    with opened(path, "result file", mend, stored) as file:
        if getattr(file, "source", None) != "vehiclemor":
            raise CorruptError("not a result of vehiclemor", path, mend)
        file.set_auto_maskandscale(True)
        return xr.open_dataset(NetCDF4DataStore(file)).load()


def global_attributes(path: Path, stored: bool = False) -> dict[str, Any]:
    """Attributes of an undamaged file of this package; empty of any other."""
    with suppress(FileError), opened(path, "result file", "", stored) as file:
        if INTEGRITY in file.groups:
            return {name: file.getncattr(name) for name in file.ncattrs()}
    return {}


def is_result(path: Path) -> bool:
    """Whether a path is a result file of this package, as `replaceable` asks."""
    attributes = global_attributes(path)
    return attributes.get("source") == "vehiclemor" and "saved_model" not in attributes


def is_saved_model(path: Path) -> bool:
    """Whether a path is a reduced model that this package has saved."""
    return "saved_model" in global_attributes(path)


@contextmanager
def opened(
    path: Path, kind: str, mend: str = "", trusted: bool = False
) -> Iterator[netCDF4.Dataset]:
    """A netCDF file that is as it was written; of others, one that the library can read.

    An error calls it a `kind`, and tells how to `mend` it.  What is `trusted` is read at once.
    """
    import netCDF4

    # In this order: another process may just be storing it.
    if not path.exists():
        raise FileError(f"{path}: no such {kind}")
    if not path.is_file():
        raise CorruptError(f"not a {kind}: {NO_FILE}", path)
    try:
        digest = _sealed(path)
        if digest not in _KNOWN and not (digest and trusted):
            _read_elsewhere(path)
            if digest:
                _KNOWN.add(digest)
        with netCDF4.Dataset(path) as file:
            file.set_auto_maskandscale(False)
            if INTEGRITY in file.groups and not digest:
                raise ValueError("not what was written")
            yield file
    except (OSError, ValueError, RuntimeError, KeyError, AttributeError, IndexError) as error:
        if machine := machine_reason(error):
            raise MachineError(f"{path}: can't be read ({machine})") from None
        if isinstance(error, PermissionError):
            raise FileError(f"{path}: can't be read ({error.strerror})") from None
        detail = getattr(error, "strerror", None) or str(error).splitlines()[0][:80]
        detail = DAMAGED if "NetCDF:" in detail else detail
        raise CorruptError(f"not a readable {kind} ({detail})", path, mend) from None


def _sealed(path: Path) -> bytes:
    """The hash that a file ends with, if it does; `ValueError` if it is not that of its bytes."""
    content, seal, digest = read_regular(path, MOST_BYTES).rpartition(SEAL)
    if not seal or len(digest) != len(_digest(b"")):
        return b""
    if digest != _digest(content):
        raise ValueError("what it holds is not what was written")
    return digest


def _digest(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest().encode()


def _read_elsewhere(path: Path) -> None:
    """Raise `ValueError` if the library can't read a file, crashes, or does not come to an end."""
    command = [sys.executable, "-P", "-c", READ, str(path.absolute()), str(MOST_BYTES)]
    limit = LIMIT + path.stat().st_size / SPEED
    try:
        ended = subprocess.run(command, capture_output=True, timeout=limit, check=False)  # noqa: S603
    except subprocess.TimeoutExpired:
        raise ValueError(f"damaged: reading it does not end in {limit:g} s") from None
    if ended.returncode == 3:
        raise ValueError(f"its variables have more than {MOST_BYTES} bytes")
    if ended.returncode:
        raise ValueError(DAMAGED)
