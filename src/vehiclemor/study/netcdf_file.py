"""Datasets as whole netCDF-4 files: combined results, single runs, saved models.

Each holds a hash of its content, which is checked whenever it is read.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vehiclemor.errors import FileError, MachineError, SpoiledError, machine_reason
from vehiclemor.files import write_whole

if TYPE_CHECKING:
    import netCDF4
    import xarray as xr

# Group of a file with the hash of all that stands outside of it.
INTEGRITY = "integrity"


def write_dataset(dataset: xr.Dataset, path: Path) -> None:
    """Write a dataset as a whole file."""
    import netCDF4
    from xarray.backends import NetCDF4DataStore

    def write(temporary: Path) -> None:
        try:
            with netCDF4.Dataset(temporary, "w") as file:
                dataset.dump_to_store(NetCDF4DataStore(file))
                file.createGroup(INTEGRITY).sha256 = _digest(file)
        except (OSError, RuntimeError):
            # The library hides the reason; plain writing of as much as there is tells it.
            temporary.write_bytes(bytes(dataset.nbytes + (1 << 16)))
            raise

    try:
        write_whole(path, write)
    except RuntimeError as error:
        raise FileError(f"{path}: can't be written ({error})") from None


def read_dataset(path: Path, attribute: str, expected: str) -> xr.Dataset:
    """Read a result file of this package into memory.

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

    with _opened(path, attribute, expected) as file:
        file.set_auto_maskandscale(True)
        return xr.open_dataset(NetCDF4DataStore(file)).load()


def global_attributes(path: Path) -> dict[str, Any]:
    """Attributes of a file, unchecked; none if it is missing or can't be read."""
    import netCDF4

    try:
        with netCDF4.Dataset(path) as file:
            return {name: file.getncattr(name) for name in file.ncattrs()}
    except (OSError, RuntimeError):
        return {}


@contextmanager
def _opened(path: Path, attribute: str, expected: str) -> Iterator[netCDF4.Dataset]:
    """A result file that is whole and the expected one."""
    with opened(path, "result file", "; move it away and run again") as file:
        if getattr(file, attribute, None) != expected:
            reason = f"not the result that belongs here ({attribute} is not {expected})"
            raise SpoiledError(reason, path, "; move it away and run again")
        yield file


@contextmanager
def opened(path: Path, kind: str, mend: str = "") -> Iterator[netCDF4.Dataset]:
    """A netCDF file that is whole.

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
        with netCDF4.Dataset(path) as file:
            file.set_auto_maskandscale(False)
            if INTEGRITY in file.groups and file[INTEGRITY].sha256 != _digest(file):
                raise ValueError("what it holds is not what was written")
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


def _digest(file: netCDF4.Dataset) -> str:
    """Hash of the variables and attributes of a file."""
    import numpy as np

    digest = hashlib.sha256()
    for owner in (file, *file.variables.values()):
        described = {name: str(owner.getncattr(name)) for name in sorted(owner.ncattrs())}
        digest.update(repr(described).encode())
    file.set_auto_maskandscale(False)
    for name, variable in file.variables.items():
        values = np.asarray(variable[...])
        digest.update(f"{name} {variable.dimensions} {values.dtype} {values.shape}".encode())
        text = values.dtype.kind in "OUS"
        digest.update("\n".join(map(str, values.ravel())).encode() if text else values.tobytes())
    return digest.hexdigest()
