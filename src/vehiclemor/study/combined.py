"""Combined datasets of studies, and times: netCDF files that belong to a content, not to a name."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from vehiclemor.errors import SpoiledError
from vehiclemor.files import make_folder
from vehiclemor.study.netcdf_file import global_attributes, read_dataset, write_dataset
from vehiclemor.study.store import set_aside

if TYPE_CHECKING:
    import xarray as xr


class Owner(NamedTuple):
    """The study that a combined dataset is of.

    Attributes
    ----------
    study
        Name of its results.
    study_file
        Where it comes from.
    content
        Hash of what that file says: two files of one name are two studies, and a file that was
        renamed is still the same.
    """

    study: str
    study_file: str
    content: str


def combined_path(folder: Path, owner: Owner) -> Path:
    """File of a study's combined dataset: `studies/<name>.nc`.

    If that holds another study's, a part of the content's hash is put to the name.
    """
    path = folder / "studies" / f"{owner.study}.nc"
    held = global_attributes(path)
    # A file that was edited in its place is the same study.
    if not held or owner.study_file == held.get("study_file", owner.study_file):
        return path
    if owner.content == held.get("content"):
        return path
    return path.with_stem(f"{owner.study}-{owner.content}")


def stored(
    path: Path,
    attribute: str,
    key: str,
    make: Callable[[], xr.Dataset],
    sources: Callable[[], Iterable[Path]] = list,
    owner: Owner | None = None,
) -> xr.Dataset:
    """What is stored for this key, here or under another name, else what `make` gives.

    The results of a study are then stored at `path`.  Where the file is tells the encoding `source`
    of what is returned.

    Parameters
    ----------
    attribute
        Global attribute that holds the key.
    sources
        Gives the files that it was made from; if one of them is missing or as new, it is made
        again.
    owner
        Of the result of a study.
    """
    dataset = _current(path, attribute, key, sources)
    if dataset is not None:
        return dataset
    same = _under_another_name(path, attribute, key, sources)
    if same is not None and owner is None:
        return same
    make_folder(path.parent)
    dataset = make() if same is None else same
    dataset = dataset.assign_attrs({attribute: key} | (owner._asdict() if owner else {}))
    write_dataset(dataset, path)
    dataset.encoding["source"] = str(path)
    return dataset


def _under_another_name(
    path: Path, attribute: str, key: str, sources: Callable[[], Iterable[Path]]
) -> xr.Dataset | None:
    """As `_current`, of any file beside: its study was renamed since."""
    for other in sorted(path.parent.glob("[!.]*.nc")):
        if other != path and global_attributes(other).get(attribute) == key:
            return _current(other, attribute, key, sources)
    return None


def _current(
    path: Path, attribute: str, key: str, sources: Callable[[], Iterable[Path]]
) -> xr.Dataset | None:
    """What a file holds, if that was made for this key from these sources as they are."""
    if not path.exists():
        return None
    try:
        dataset = read_dataset(path, "source", "vehiclemor")
    except SpoiledError as error:
        set_aside(path, path.parent, error.reason)
        return None
    if dataset.attrs.get(attribute) != key:
        return None
    written = path.stat().st_mtime_ns
    try:
        newest = max((source.stat().st_mtime_ns for source in sources()), default=-1)
    except FileNotFoundError:
        return None
    dataset.encoding["source"] = str(path)
    return dataset if newest < written else None
