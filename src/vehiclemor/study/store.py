"""Result files: one netCDF-4 file for each cell, moved into place when complete."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.errors import FileError

if TYPE_CHECKING:
    import numpy as np
    import xarray as xr

TEMPORARY = ".partial-"


def prepare_folder(folder: Path) -> None:
    """Make a results folder and prove that it can be written.

    Raises
    ------
    FileError
        If it is a file, or can't be made or written.
    """
    try:
        for part in ("cells", "studies"):
            (folder / part).mkdir(parents=True, exist_ok=True)
            probe = folder / part / f"{TEMPORARY}{os.getpid()}-probe"
            probe.touch()
            probe.unlink()
    except (FileExistsError, NotADirectoryError):
        raise FileError(f"{folder}: not a folder") from None
    except OSError as error:
        raise FileError(f"{folder}: can't be written ({error.strerror})") from None
    _remove_leftovers(folder / "cells")
    _remove_leftovers(folder / "studies")


def _remove_leftovers(folder: Path) -> None:
    """Remove partial files of processes that are no more; finished files are never touched."""
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
    return True


def cell_path(folder: Path, key: str) -> Path:
    """File of the cell with this key."""
    return folder / "cells" / f"{key}.nc"


def write_dataset(dataset: xr.Dataset, path: Path) -> None:
    """Write a dataset under a temporary name, then move it into place.

    Raises
    ------
    FileError
        If the folder can't be written.
    """
    temporary = path.with_name(f"{TEMPORARY}{os.getpid()}-{path.name}")
    try:
        dataset.to_netcdf(temporary, engine="netcdf4", format="NETCDF4")
        os.replace(temporary, path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise FileError(f"{path}: can't be written ({error.strerror or error})") from None


def read_dataset(path: Path, attribute: str, expected: str) -> xr.Dataset:
    """Read a result file of this package into memory.

    Parameters
    ----------
    attribute, expected
        Global attribute that tells whose file it is, and its value.

    Raises
    ------
    FileError
        If the file is missing, corrupt, or not the expected one; it is left as it is.
    """
    import xarray as xr

    with _readable(path), xr.open_dataset(path, engine="netcdf4") as opened:
        dataset = opened.load()
    _check_owner(path, dataset.attrs, attribute, expected)
    return dataset


def up_to_date(path: Path, attribute: str, key: str) -> xr.Dataset | None:
    """A result file of this package that was made for this key, if there is one."""
    if not path.exists():
        return None
    dataset = read_dataset(path, "source", "vehiclemor")
    return dataset if dataset.attrs.get(attribute) == key else None


def read_arrays(path: Path, attribute: str, expected: str) -> dict[str, np.ndarray]:
    """Arrays of a result file by name; as `read_dataset`, but three times faster."""
    import netCDF4

    with _readable(path), netCDF4.Dataset(path) as file:
        file.set_auto_maskandscale(False)
        attributes = {name: file.getncattr(name) for name in file.ncattrs()}
        arrays = {name: variable[...] for name, variable in file.variables.items()}
    _check_owner(path, attributes, attribute, expected)
    return arrays


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    if not path.is_file():
        raise FileError(f"{path}: no such result file")
    try:
        yield
    except (OSError, ValueError, RuntimeError, KeyError) as error:
        reason = error.strerror if isinstance(error, OSError) else None
        detail = reason or str(error).splitlines()[0][:80]
        raise FileError(
            f"{path}: not a readable result file ({detail}); move it away and run again"
        ) from None


def _check_owner(path: Path, attributes: dict, attribute: str, expected: str) -> None:
    if attributes.get(attribute) != expected:
        raise FileError(
            f"{path}: not the result that belongs here ({attribute} is not {expected}); "
            f"move it away and run again"
        )
