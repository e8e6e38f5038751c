"""The results folder: a file for each cell, and one for each study, with its combined dataset.

Files are written whole and moved into place.  What is not as it was written is set aside, named,
and made again.  A combined dataset belongs to a content, not to a name.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterable, Iterator
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
from vehiclemor.netcdf_file import global_attributes, read_dataset, write_dataset
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


def read_cell(folder: Path, key: str) -> cell_file.Cell:
    """Stored result of an experiment.

    Raises
    ------
    FileError
        If it is missing; `SpoiledError` if it is not what was written.
    """
    path = cell_path(folder, key)
    try:
        return cell_file.decoded(path.read_bytes(), key)
    except OSError as error:
        raise _unreadable(path, error) from None
    except SpoiledError as error:
        raise SpoiledError(error.reason, path, "; run again") from None


def is_stored(folder: Path, key: str) -> bool:
    """Whether a finished result is stored."""
    with suppress(FileError, MachineError):
        return cell_path(folder, key).exists() and not read_cell(folder, key).broken
    return False


def _unreadable(path: Path, error: OSError) -> FileError | MachineError:
    if isinstance(error, IsADirectoryError):
        return SpoiledError("is a folder, not a result file", path, "; run again")
    if isinstance(error, FileNotFoundError):
        return FileError(f"{path}: no such result file; run again")
    machine = machine_reason(error)
    kind = MachineError if machine else FileError
    return kind(f"{path}: can't be read ({machine or error.strerror})")


def finished_cells(folder: Path, keys: Iterable[str]) -> set[str]:
    """Those of some experiments that are stored; what is not as it was written is set aside."""
    finished = set()
    for key in keys:
        path = cell_path(folder, key)
        if path.exists():
            try:
                if not read_cell(folder, key).broken:
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


def combined_path(folder: Path, study: str) -> Path:
    """File of the combined dataset of the study that has last run under this name."""
    return folder / "studies" / f"{study}.nc"


def result_path(folder: Path, study: str, content: str) -> Path | None:
    """As `combined_path`, if there is one, of the study file of this content."""
    path = combined_path(folder, study)
    return path if global_attributes(path).get("content") == content else None


def stored(
    path: Path,
    attribute: str,
    key: str,
    make: Callable[[], xr.Dataset],
    sources: Callable[[], Iterable[Path]] = list,
    content: str = "",
) -> xr.Dataset:
    """What is stored for this key, here or under another name, else what `make` gives.

    The results of a study are then stored at `path`, in the place of those of another study of that
    name, which can be combined again.  Where the file is tells the encoding `source` of what is
    returned.

    Parameters
    ----------
    attribute
        Global attribute that holds the key.
    sources
        Gives the files that it was made from; if one of them is missing it is made again, and if a
        bug has ended one of its cells.
    content
        Hash of what a study file says: a file that was renamed is still the same study.
    """
    dataset = next(_current(path, attribute, key, sources), None)
    if dataset is not None and (not content or dataset.encoding["source"] == str(path)):
        return dataset
    make_folder(path.parent)
    held = global_attributes(path)
    if path.exists() and held.get("source") != "vehiclemor":
        set_aside(path, path.parent, "not as it was written, or no result of this package")
    dataset = make() if dataset is None else dataset
    dataset = dataset.assign_attrs({attribute: key})
    if content:
        dataset = dataset.assign_attrs(study=path.stem, content=content)
        if held.get("content", content) != content:
            _LOG.info("%s: in the place of the results of another %s.toml", path, path.stem)
    write_dataset(dataset, path)
    dataset.encoding["source"] = str(path)
    return dataset


def _current(
    path: Path, attribute: str, key: str, sources: Callable[[], Iterable[Path]]
) -> Iterator[xr.Dataset]:
    """What is stored for a key, at this path or beside it: its study may have been renamed."""
    for place in (path, *sorted(path.parent.glob("[!.]*.nc"))):
        if global_attributes(place).get(attribute) == key and all(p.exists() for p in sources()):
            dataset = read_dataset(place, "source", "vehiclemor")
            dataset.encoding["source"] = str(place)
            # What a bug has ended is tried again.
            if "status" not in dataset or "error" not in dataset["status"].values:
                yield dataset
