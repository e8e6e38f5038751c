"""Datasets as whole netCDF-4 files: combined results, single runs, saved models.

Each ends with the hash of its bytes, which is checked before the library reads them: of damaged
ones it may never come back.  Other files are first read in a process that can be ended.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vehiclemor.exceptions import CorruptError, FileError, MachineError, machine_reason
from vehiclemor.files import write_whole

if TYPE_CHECKING:
    import netCDF4
    import xarray as xr

# Group of a file that ends with the hash of its bytes, and what stands before that hash: behind the
# data, where no reader of netCDF looks.
INTEGRITY, SEAL = "integrity", b"\nvehiclemor sha256 "
# What reads a file of others, and the seconds that it may take.
READ = """
import sys, netCDF4
with netCDF4.Dataset(sys.argv[1]) as file:
    for owner in (file, *file.variables.values()):
        owner.__dict__
    for variable in file.variables.values():
        variable[...]
"""
LIMIT, DAMAGED = 10.0, "damaged, or no netCDF-4 file"


def write_dataset(dataset: xr.Dataset, path: Path) -> None:
    """Write a dataset as a whole file."""
    import netCDF4
    from xarray.backends import NetCDF4DataStore

    def write(temporary: Path) -> None:
        try:
            with netCDF4.Dataset(temporary, "w") as file:
                dataset.dump_to_store(NetCDF4DataStore(file))
                file.createGroup(INTEGRITY)
            with temporary.open("ab") as file:
                file.write(SEAL + _digest(temporary.read_bytes()))
        except (OSError, RuntimeError):
            # The library hides the reason; plain writing of as much as there is tells it.
            temporary.write_bytes(bytes(dataset.nbytes + (1 << 16)))
            raise

    try:
        write_whole(path, write)
    except RuntimeError as error:
        raise FileError(f"{path}: can't be written ({error})") from None


def read_dataset(path: Path, attribute: str, expected: str) -> xr.Dataset:
    """A result file of this package, whose global `attribute` has the `expected` value.

    `FileError` if it is missing; `CorruptError` if it is corrupt, or not the expected one.
    """
    import xarray as xr
    from xarray.backends import NetCDF4DataStore

    mend = "; move it away and run again"
    with opened(path, "result file", mend) as file:
        if getattr(file, attribute, None) != expected:
            reason = f"not the result that belongs here ({attribute} is not {expected})"
            raise CorruptError(reason, path, mend)
        file.set_auto_maskandscale(True)
        return xr.open_dataset(NetCDF4DataStore(file)).load()


def global_attributes(path: Path) -> dict[str, Any]:
    """Attributes of a file of this package that is whole; of no other."""
    import netCDF4

    try:
        if not (path.is_file() and _sealed(path)):
            return {}
        with netCDF4.Dataset(path) as file:
            return {name: file.getncattr(name) for name in file.ncattrs()}
    except (OSError, ValueError):
        return {}


@contextmanager
def opened(path: Path, kind: str, mend: str = "") -> Iterator[netCDF4.Dataset]:
    """A netCDF file that is as it was written; of others, one that the library can read.

    An error calls it a `kind`, and tells how to `mend` it.
    """
    import netCDF4

    if not path.is_file():
        if path.exists():
            raise CorruptError(f"is a folder or device, not a {kind}", path)
        raise FileError(f"{path}: no such {kind}")
    try:
        sealed = _sealed(path)
        if not sealed:
            _read_elsewhere(path)
        with netCDF4.Dataset(path) as file:
            file.set_auto_maskandscale(False)
            if INTEGRITY in file.groups and not sealed:
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


def _sealed(path: Path) -> bool:
    """Whether a file ends with the hash of its bytes; `ValueError` if with another one."""
    whole, seal, digest = path.read_bytes().rpartition(SEAL)
    if not seal or len(digest) != len(_digest(b"")):
        return False
    if digest != _digest(whole):
        raise ValueError("what it holds is not what was written")
    return True


def _digest(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest().encode()


def _read_elsewhere(path: Path) -> None:
    """Raise `ValueError` if the library can't read a file, crashes, or does not come to an end."""
    command = [sys.executable, "-P", "-c", READ, str(path.absolute())]
    try:
        ended = subprocess.run(command, capture_output=True, timeout=LIMIT, check=False)  # noqa: S603
    except subprocess.TimeoutExpired:
        raise ValueError(f"damaged: reading it does not end in {LIMIT:g} s") from None
    if ended.returncode:
        raise ValueError(DAMAGED)
