"""The results folder: a file for each cell, beside those of `combined.py` for each study.

Files are written whole and moved into place.  What is not as it was written is set aside, named,
and made again.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vehiclemor.errors import FileError, MachineError, SpoiledError, machine_reason
from vehiclemor.files import (
    make_folder,
    not_written,
    probe_folder,
    remove_leftovers,
    write_whole,
)
from vehiclemor.study import cell_file

if TYPE_CHECKING:
    import xarray as xr

# Ending of results of a bug, which the next run tries again.
BROKEN = f".error{cell_file.ENDING}"
ASIDE = "set-aside"
# Cells that are set aside are named up to this number.
NAMED = 5
_LOG = logging.getLogger("vehiclemor")


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
    return folder / "cells" / key[:2] / f"{key}{cell_file.ENDING}"


def broken_path(folder: Path, key: str) -> Path:
    """File of the experiment with this key, where a bug has ended it: the next run tries again."""
    return folder / "cells" / key[:2] / f"{key}{BROKEN}"


def result_path(folder: Path, key: str) -> Path:
    """The one of the two that there is."""
    path = cell_path(folder, key)
    return path if path.exists() else broken_path(folder, key)


def write_cell(dataset: xr.Dataset, folder: Path, key: str, seconds: float = np.nan) -> None:
    """Store the result of an experiment, and the seconds that it took."""
    broken = "error" in dataset.variables["status"].values
    write_encoded(cell_file.encoded(dataset, key, seconds), folder, key, broken=broken)


def write_encoded(content: bytes, folder: Path, key: str, *, broken: bool) -> None:
    """Store the content of a cell's file; that of a bug apart from those that are finished."""
    path = (broken_path if broken else cell_path)(folder, key)

    def write(temporary: Path) -> None:
        if not path.parent.is_dir():
            path.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_bytes(content)

    # Where parts of files are looked for there are no other files.
    write_whole(path, write, folder / "cells")
    if not broken:
        broken_path(folder, key).unlink(missing_ok=True)


def read_cell(folder: Path, key: str) -> xr.Dataset:
    """Result of an experiment.

    Raises
    ------
    FileError
        If it is missing; `SpoiledError` if it is not what was written.
    """
    with _found(folder, key) as content:
        return cell_file.dataset_of(content, key)


def read_arrays(folder: Path, key: str) -> dict[str, np.ndarray]:
    """Arrays of a result by name; as `read_cell`, but several times faster."""
    with _found(folder, key) as content:
        return cell_file.arrays_of(content, key)


def cell_end(folder: Path, key: str) -> tuple[cell_file.End, bool]:
    """How an experiment has ended, and whether it is finished; errors as of `read_cell`."""
    path = result_path(folder, key)
    try:
        return cell_file.end_of(path, key), not path.name.endswith(BROKEN)
    except OSError as error:
        raise _unreadable(path, error) from None


@contextmanager
def _found(folder: Path, key: str) -> Iterator[bytes]:
    path = result_path(folder, key)
    try:
        yield _content(path)
    except SpoiledError as error:
        raise SpoiledError(error.reason, path, "; run again") from None


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise _unreadable(path, error) from None


def _unreadable(path: Path, error: OSError) -> FileError | MachineError:
    if isinstance(error, IsADirectoryError):
        return SpoiledError("is a folder, not a result file")
    if isinstance(error, FileNotFoundError):
        return FileError(f"{path}: no such result file; run again")
    machine = machine_reason(error)
    kind = MachineError if machine else FileError
    return kind(f"{path}: can't be read ({machine or error.strerror})")


def finished_cells(
    folder: Path, keys: Iterable[str], expected: Callable[[str], cell_file.Layout]
) -> set[str]:
    """Those of some experiments that are stored; cells that are not as written are set aside.

    Parameters
    ----------
    expected
        Gives what the cell of a key holds.
    """
    finished, spoiled = set(), 0
    for key in keys:
        path = cell_path(folder, key)
        if not path.exists():
            continue
        try:
            if cell_file.layout(_content(path), key) != expected(key):
                raise SpoiledError("what it holds is no result of its experiment")
            finished.add(key)
        except SpoiledError as error:
            spoiled += 1
            set_aside(path, folder / "cells", error.reason, quiet=spoiled > NAMED)
    if spoiled > NAMED:
        _LOG.warning("%s: %d such cells in all", folder / "cells" / ASIDE, spoiled)
    return finished


def set_aside(path: Path, part: Path, reason: str, *, quiet: bool = False) -> None:
    """Move what is not as it was written out of the way, and name it.

    Parameters
    ----------
    part
        The folder `cells` or `studies`.

    Raises
    ------
    VehiclemorError
        If it can't be moved.
    """
    target, number = part / ASIDE / path.name, 1
    while target.exists():
        target = part / ASIDE / f"{path.stem}-{(number := number + 1)}{path.suffix}"
    make_folder(target.parent)
    try:
        os.replace(path, target)
    except FileNotFoundError:
        # Another process was quicker.
        return
    except OSError as error:
        raise not_written(target, error) from None
    if not quiet:
        _LOG.warning("%s: %s; moved to %s, and computed again", path, reason, target)
