"""Result files: one netCDF-4 file for each experiment, moved into place when complete."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.errors import FileError
from vehiclemor.files import make_folder, remove_leftovers, temporary_path, write_whole

if TYPE_CHECKING:
    import numpy as np
    import xarray as xr


def prepare_folder(folder: Path) -> None:
    """Make a results folder and prove that it can be written.

    Raises
    ------
    FileError
        If it is a file, or can't be made or written.
    """
    for part in (folder / "cells", folder / "studies"):
        make_folder(part)
        probe = temporary_path(part / "probe")
        try:
            probe.touch()
            probe.unlink()
        except OSError as error:
            raise FileError(f"{folder}: can't be written ({error.strerror})") from None
        remove_leftovers(part)


def cell_path(folder: Path, key: str) -> Path:
    """File of the experiment with this key."""
    return folder / "cells" / f"{key}.nc"


def write_dataset(dataset: xr.Dataset, path: Path) -> None:
    """Write a dataset as a whole file."""
    write_whole(path, lambda temporary: dataset.to_netcdf(temporary, engine="netcdf4"))


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


def stored(
    path: Path,
    attribute: str,
    key: str,
    make: Callable[[], xr.Dataset],
    sources: Iterable[Path] = (),
) -> xr.Dataset:
    """What a file holds if it was made for this key, else what `make` gives, stored there.

    Parameters
    ----------
    attribute
        Global attribute that holds the key.
    sources
        Files that it was made from; if one of them is as new, it is made again.
    """
    if path.exists():
        dataset = read_dataset(path, "source", "vehiclemor")
        written = path.stat().st_mtime_ns
        current = all(source.stat().st_mtime_ns < written for source in sources)
        if current and dataset.attrs.get(attribute) == key:
            return dataset
    dataset = make().assign_attrs({attribute: key})
    write_dataset(dataset, path)
    return dataset


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
