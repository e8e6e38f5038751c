"""Datasets as whole netCDF-4 files: combined results, single runs, saved models.

Each ends with the hash of its bytes, which is checked before the library reads them: of damaged
ones it may never come back.  Other files are first read in a process that can be ended.
"""

from __future__ import annotations

import hashlib
import itertools
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from vehiclemor.errors import FileError, MachineError, SpoiledError, machine_reason
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
    for variable in file.variables.values() if int(sys.argv[2]) else ():
        variable[...]
"""
LIMIT = 10.0
# Bytes of the largest part of a dataset that is made, written or checked at a time, and of the
# smallest file that is read only where it is asked for.
PART, LARGE = 1 << 24, 1 << 28
# One slice of each dimension.
Region = tuple[slice, ...]


class Parts(NamedTuple):
    """A dataset that is too large to be held.

    Attributes
    ----------
    dimensions
        Those along which it is in parts.
    parts
        Region of these dimensions, and what the dataset has there; the first begins at zero.
    """

    dimensions: tuple[str, ...]
    parts: Iterator[tuple[Region, xr.Dataset]]


def write_dataset(dataset: xr.Dataset, path: Path) -> None:
    """Write a dataset as a whole file."""
    from xarray.backends import NetCDF4DataStore

    _write(path, lambda file: dataset.dump_to_store(NetCDF4DataStore(file)), dataset.nbytes)


def write_parts(parts: Parts, path: Path, further: Mapping[str, object]) -> None:
    """Write a dataset as a whole file, part by part, with further attributes."""
    from xarray.backends import NetCDF4DataStore

    def fill(file: netCDF4.Dataset) -> None:
        _, first = next(parts.parts)
        found = first.variables.items()
        grown = [str(n) for n, v in found if set(v.dims) & set(parts.dimensions)]
        first.assign_attrs(further).dump_to_store(
            NetCDF4DataStore(file),
            encoding={name: {"chunksizes": first[name].shape} for name in grown},
            unlimited_dims=list(parts.dimensions),
        )
        file.set_auto_maskandscale(False)
        for name in grown:
            # Chunks are written whole and once: kept ones would fill the memory.
            file[name].set_var_chunk_cache(size=1)
        for region, part in parts.parts:
            at = dict(zip(parts.dimensions, region, strict=True))
            for name in grown:
                place = tuple(at.get(str(d), slice(None)) for d in part[name].dims)
                file[name][place] = part[name].values

    _write(path, fill, PART)


def _write(path: Path, fill: Callable[[netCDF4.Dataset], object], size: int) -> None:
    """Write a file that `fill` fills with about so many bytes."""
    import netCDF4

    def write(temporary: Path) -> None:
        try:
            with netCDF4.Dataset(temporary, "w") as file:
                fill(file)
                file.createGroup(INTEGRITY)
            _seal(temporary)
        except (OSError, RuntimeError):
            # The library hides the reason; plain writing of as much as there is tells it.
            temporary.write_bytes(bytes(size + (1 << 16)))
            raise

    try:
        write_whole(path, write)
    except RuntimeError as error:
        raise FileError(f"{path}: can't be written ({error})") from None


def read_dataset(path: Path, attribute: str, expected: str) -> xr.Dataset:
    """Read a result file of this package into memory; a large one where it is asked for.

    Parameters
    ----------
    attribute, expected
        Global attribute that tells whose file it is, and its value.

    Raises
    ------
    FileError
        If the file is missing; `SpoiledError` if it is corrupt, or not the expected one. It is left
        as it is.
    """
    import xarray as xr
    from xarray.backends import NetCDF4DataStore

    mend = "; move it away and run again"
    with opened(path, "result file", mend) as file:
        if getattr(file, attribute, None) != expected:
            reason = f"not the result that belongs here ({attribute} is not {expected})"
            raise SpoiledError(reason, path, mend)
        if path.stat().st_size < LARGE:
            file.set_auto_maskandscale(True)
            return xr.open_dataset(NetCDF4DataStore(file)).load()
    return opened_lazily(path)


def opened_lazily(path: Path) -> xr.Dataset:
    """A dataset that is read where it is asked for; with dask in the parts that were written."""
    import xarray as xr

    chunks: Any = {} if find_spec("dask") else None
    return xr.open_dataset(path, engine="netcdf4", cache=False, chunks=chunks)


def regions(sizes: Sequence[int], at_once: int) -> Iterator[Region]:
    """Parts of an array of at most so many elements that cover it, in the order of its elements."""
    split, inside = len(sizes), 1
    while split and inside * sizes[split - 1] <= at_once:
        split -= 1
        inside *= sizes[split]
    if not split:
        yield tuple(slice(0, size) for size in sizes)
        return
    step = max(at_once // inside, 1)
    rest = tuple(slice(0, size) for size in sizes[split:])
    for lead in itertools.product(*map(range, sizes[: split - 1])):
        before = tuple(slice(i, i + 1) for i in lead)
        for begin in range(0, sizes[split - 1], step):
            yield (*before, slice(begin, min(begin + step, sizes[split - 1])), *rest)


def global_attributes(path: Path) -> dict[str, Any]:
    """Attributes of a file of this package that is whole; of no other."""
    import netCDF4

    try:
        if not _sealed(path):
            return {}
        with netCDF4.Dataset(path) as file:
            return {name: file.getncattr(name) for name in file.ncattrs()}
    except (OSError, ValueError):
        return {}


@contextmanager
def opened(path: Path, kind: str, mend: str = "") -> Iterator[netCDF4.Dataset]:
    """A netCDF file that is as it was written; of others, one that the library can read.

    Parameters
    ----------
    kind, mend
        What an error calls it, and what it tells to do.
    """
    import netCDF4

    if not path.is_file():
        if path.exists():
            raise SpoiledError(f"is a folder, not a {kind}", path)
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
        reason = error.strerror if isinstance(error, OSError) else None
        detail = reason or str(error).splitlines()[0][:80]
        detail = "damaged, or no netCDF-4 file" if "NetCDF:" in detail else detail
        if isinstance(error, PermissionError):
            raise FileError(f"{path}: can't be read ({detail})") from None
        raise SpoiledError(f"not a readable {kind} ({detail})", path, mend) from None


def _seal(path: Path) -> None:
    """Append the hash of its bytes to a file."""
    with path.open("r+b") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        file.write(SEAL + digest.encode())


def _sealed(path: Path) -> bool:
    """Whether a file ends with the hash of its bytes; `ValueError` if with another one."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        size = max(file.seek(0, os.SEEK_END) - len(SEAL) - 2 * digest.digest_size, 0)
        file.seek(size)
        end = file.read()
        if not end.startswith(SEAL):
            return False
        file.seek(0)
        for begin in range(0, size, PART):
            digest.update(file.read(min(size - begin, PART)))
    if end.removeprefix(SEAL) != digest.hexdigest().encode():
        raise ValueError("what it holds is not what was written")
    return True


def _read_elsewhere(path: Path) -> None:
    """Raise `ValueError` if the library can't read a file, crashes, or does not come to an end."""
    whole = path.stat().st_size < LARGE
    command = [sys.executable, "-P", "-c", READ, str(path.absolute()), str(int(whole))]
    try:
        ended = subprocess.run(command, capture_output=True, timeout=LIMIT, check=False)  # noqa: S603
    except subprocess.TimeoutExpired:
        raise ValueError(f"damaged: reading it does not end in {LIMIT:g} s") from None
    if ended.returncode:
        raise ValueError("damaged, or no netCDF-4 file")
