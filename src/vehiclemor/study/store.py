"""Result files: one netCDF-4 file for each experiment, moved into place when complete.

Each holds a hash of its content, which is checked whenever it is read.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.errors import FileError, MachineError, machine_reason
from vehiclemor.files import make_folder, probe_folder, remove_leftovers, write_whole

if TYPE_CHECKING:
    import netCDF4
    import numpy as np
    import xarray as xr

# Group of a result file with the hash of all that stands outside of it, and the ending of results
# that the next run tries again.
INTEGRITY, BROKEN = "integrity", ".error.nc"


def prepare_folder(folder: Path) -> None:
    """Make a results folder and prove that it can be written.

    Raises
    ------
    VehiclemorError
        If it is a file, or can't be made or written.
    """
    make_folder(folder)
    for part in (folder / "cells", folder / "studies"):
        make_folder(part)
        probe_folder(part)


def remove_partial(folder: Path) -> None:
    """Remove what processes that are no more have not finished to write."""
    for part in (folder / "cells", folder / "studies"):
        with suppress(OSError):
            remove_leftovers(part)


def cell_path(folder: Path, key: str) -> Path:
    """File of the experiment with this key."""
    return folder / "cells" / f"{key}.nc"


def broken_path(folder: Path, key: str) -> Path:
    """File of the experiment with this key, where a bug has ended it: the next run tries again."""
    return folder / "cells" / f"{key}{BROKEN}"


def result_path(folder: Path, key: str) -> Path:
    """The one of the two that there is."""
    path = cell_path(folder, key)
    return path if path.exists() else broken_path(folder, key)


def write_cell(dataset: xr.Dataset, folder: Path, key: str) -> None:
    """Store the result of an experiment; one of a bug apart from those that are finished."""
    broken = "error" in dataset["status"].values
    write_dataset(dataset, (broken_path if broken else cell_path)(folder, key))
    if not broken:
        broken_path(folder, key).unlink(missing_ok=True)


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
        If the file is missing, corrupt, or not the expected one; it is left as it is.
    """
    import xarray as xr
    from xarray.backends import NetCDF4DataStore

    with _opened(path, attribute, expected) as file:
        file.set_auto_maskandscale(True)
        return xr.open_dataset(NetCDF4DataStore(file)).load()


def read_arrays(path: Path, attribute: str, expected: str) -> dict[str, np.ndarray]:
    """Arrays of a result file by name; as `read_dataset`, but three times faster."""
    with _opened(path, attribute, expected) as file:
        return {name: variable[...] for name, variable in file.variables.items()}


@contextmanager
def _opened(path: Path, attribute: str, expected: str) -> Iterator[netCDF4.Dataset]:
    """A result file that is whole and the expected one."""
    with opened(path, "result file", "; move it away and run again") as file:
        if getattr(file, attribute, None) != expected:
            raise FileError(
                f"{path}: not the result that belongs here ({attribute} is not {expected}); "
                f"move it away and run again"
            )
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
        what = f"is a folder, not a {kind}" if path.exists() else f"no such {kind}"
        raise FileError(f"{path}: {what}")
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
        raise FileError(f"{path}: not a readable {kind} ({detail}){mend}") from None


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


def stored(
    path: Path,
    attribute: str,
    key: str,
    make: Callable[[], xr.Dataset],
    sources: Iterable[Path] = (),
    study_file: str = "",
) -> xr.Dataset:
    """What a file holds if it was made for this key, else what `make` gives, stored there.

    Parameters
    ----------
    attribute
        Global attribute that holds the key.
    sources
        Files that it was made from; if one of them is as new, it is made again.
    study_file
        That it comes from, if it is the result of a study.

    Raises
    ------
    FileError
        If the result of another study is stored there.
    """
    if path.exists():
        dataset = read_dataset(path, "source", "vehiclemor")
        written = path.stat().st_mtime_ns
        current = all(source.stat().st_mtime_ns < written for source in sources)
        if current and dataset.attrs.get(attribute) == key:
            return dataset
        other = dataset.attrs.get("study_file", study_file)
        if other != study_file:
            raise FileError(
                f"{path}: holds the results of {other}, a study file of the same name; "
                f"rename one of them, or move the results away"
            )
    make_folder(path.parent)
    dataset = make().assign_attrs({attribute: key})
    if study_file:
        dataset.attrs["study_file"] = study_file
    write_dataset(dataset, path)
    return dataset
