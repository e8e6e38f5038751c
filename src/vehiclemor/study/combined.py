"""Combined datasets of studies, and times: netCDF files that belong to a content, not to a name."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.files import make_folder
from vehiclemor.study.netcdf_file import global_attributes, read_dataset, write_dataset
from vehiclemor.study.store import set_aside

if TYPE_CHECKING:
    import xarray as xr

_LOG = logging.getLogger("vehiclemor")


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
