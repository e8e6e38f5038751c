"""The results folder: a file for each cell, beside those of `combined.py` for each study.

Files are written whole and moved into place.  What is not as it was written is set aside, named,
and made again.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterable
from contextlib import suppress
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

ASIDE = "set-aside"
_LOG = logging.getLogger("vehiclemor")


def prepare_folder(folder: Path) -> None:
    """Make a results folder, prove that it can be written, and remove old parts of files.

    Raises
    ------
    VehiclemorError
        If it is a file, or can't be made or written.
    """
    for part in (folder / "cells", folder / "studies"):
        make_folder(part)
        probe_folder(part)
        with suppress(OSError):
            remove_leftovers(part)


def cell_path(folder: Path, key: str) -> Path:
    """File of the experiment with this key."""
    return folder / "cells" / key[:2] / f"{key}{cell_file.ENDING}"


def write_cell(dataset: xr.Dataset, folder: Path, key: str, seconds: float = np.nan) -> None:
    """Store the result of an experiment, and the seconds that it took."""
    write_encoded(cell_file.encoded(dataset, key, seconds), folder, key)


def write_encoded(content: bytes, folder: Path, key: str) -> None:
    """Store the content of a cell's file."""
    path = cell_path(folder, key)

    def write(temporary: Path) -> None:
        if not path.parent.is_dir():
            path.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_bytes(content)

    # Where parts of files are looked for there are no other files.
    write_whole(path, write, folder / "cells")


def read_cell(folder: Path, key: str) -> xr.Dataset:
    """Result of an experiment.

    Raises
    ------
    FileError
        If it is missing; `SpoiledError` if it is not what was written.
    """
    return _read(folder, key).dataset()


def read_arrays(folder: Path, key: str) -> dict[str, np.ndarray]:
    """Arrays of a result by name, text as objects; as `read_cell`, but several times faster."""
    return {name: array[()] for name, (_, array, _) in _read(folder, key).variables.items()}


def cell_end(folder: Path, key: str) -> tuple[cell_file.End, bool]:
    """How an experiment has ended, and whether it is finished; errors as of `read_cell`."""
    path = cell_path(folder, key)
    try:
        end = cell_file.end_of(path, key)
    except OSError as error:
        raise _unreadable(path, error) from None
    return end, not end.broken


def _read(folder: Path, key: str) -> cell_file.Cell:
    path = cell_path(folder, key)
    try:
        return cell_file.decoded(path.read_bytes(), key)
    except OSError as error:
        raise _unreadable(path, error) from None
    except SpoiledError as error:
        raise SpoiledError(error.reason, path, "; run again") from None


def _unreadable(path: Path, error: OSError) -> FileError | MachineError:
    if isinstance(error, IsADirectoryError):
        return SpoiledError("is a folder, not a result file", path, "; run again")
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
    finished = set()
    for key in keys:
        path = cell_path(folder, key)
        if not path.exists():
            continue
        try:
            cell = _read(folder, key)
            if cell.layout != expected(key):
                raise SpoiledError("what it holds is no result of its experiment")
            if not cell.end.broken:
                finished.add(key)
        except SpoiledError as error:
            set_aside(path, folder / "cells", error.reason)
    return finished


def set_aside(path: Path, part: Path, reason: str) -> None:
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
    _LOG.warning("%s: %s; moved to %s, and computed again", path, reason, target)
