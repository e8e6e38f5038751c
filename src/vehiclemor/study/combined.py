"""Combined datasets of studies, and times: netCDF files that belong to a content, not to a name."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

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
    edited = owner.study_file == held.get("study_file", owner.study_file)
    if edited or owner.content == held.get("content"):
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
        Gives the files that it was made from; if one of them is missing it is made again, and if a
        bug has ended one of its cells.
    owner
        Of the result of a study.
    """
    dataset = None
    for place in (path, *sorted(path.parent.glob("[!.]*.nc"))):
        if global_attributes(place).get(attribute) == key and all(p.exists() for p in sources()):
            dataset = read_dataset(place, "source", "vehiclemor")
            dataset.encoding["source"] = str(place)
            if "status" in dataset and "error" in dataset["status"].values:
                dataset = None
            elif place == path or owner is None:
                return dataset
            break
    make_folder(path.parent)
    if path.exists() and global_attributes(path).get("source") != "vehiclemor":
        set_aside(path, path.parent, "not as it was written, or no result of this package")
    dataset = make() if dataset is None else dataset
    dataset = dataset.assign_attrs({attribute: key} | (owner._asdict() if owner else {}))
    write_dataset(dataset, path)
    dataset.encoding["source"] = str(path)
    return dataset
