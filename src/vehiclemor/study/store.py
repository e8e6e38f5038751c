"""The results folder: a file for each run, and one for each study, with its combined dataset.

Files appear under their names when they are complete.  What is not as it was written is
quarantined, named, and computed again.  A combined dataset is identified by a hash of its study
file.

The file of a run has its arrays as safetensors, all else as JSON in the header, and there a hash of
the file, so that a part, or a flipped bit, is never read as a result.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from vehiclemor.exceptions import CorruptError, FileError, MachineError, machine_reason
from vehiclemor.files import (
    make_folder,
    not_written,
    probe_folder,
    read_regular,
    remove_leftovers,
    write_whole,
)
from vehiclemor.netcdf_file import global_attributes, read_dataset, write_dataset
from vehiclemor.short_repr import shortened

QUARANTINE = "quarantine"
# Bytes of a run's file: more than any history has.
MOST_BYTES = 1 << 30
ENDING, SCHEMA = ".safetensors", "vehiclemor run 4"
# Bytes that say how long the header is; and where the hash stands, for which there are zeros while
# it is computed.
PREFIX, HASH, ZEROS = 8, '"sha256":"{}"', "0" * 64
MEND = "; move it away and run again"
# Of a variable.
ATTRIBUTES = {"units", "long_name", "clock"}
# What comes of a text that is none of ours.
WRONG = ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError
_LOG = logging.getLogger("vehiclemor")


class StoredRun(NamedTuple):
    """What the file of a run holds: variables as xarray takes them, text as objects."""

    variables: dict[str, tuple[list[str], np.ndarray, dict[str, Any]]]
    coordinates: list[str]
    attributes: dict[str, Any]

    @property
    def ends(self) -> Counter[tuple[str, str]]:
        """(status, message) -> number of its scenarios."""
        texts = (self.variables[name][1].ravel().tolist() for name in ("status", "message"))
        return Counter(zip(*texts, strict=True))

    @property
    def warned(self) -> int:
        """How many of its scenarios are ok, but not to be trusted."""
        warned = self.variables["warned"][1] if "warned" in self.variables else False
        return int(np.sum((self.variables["status"][1] == "ok") & warned))

    @property
    def layout(self) -> dict[str, tuple[list[str], tuple[int, ...], str]]:
        """Name -> dimensions, shape and kind of a variable."""
        return {
            name: (dimensions, array.shape, array.dtype.kind)
            for name, (dimensions, array, _) in self.variables.items()
        }

    @property
    def broken(self) -> bool:
        """Whether a bug has ended it: the next run tries it again."""
        return "error" in self.variables["status"][1].ravel().tolist()

    def dataset(self) -> xr.Dataset:
        """As it was stored."""
        return xr.Dataset(self.variables, attrs=self.attributes).set_coords(self.coordinates)


def encoded(dataset: xr.Dataset, key: str) -> bytes:
    """Content of the file of a run: variables of numbers, truths or text; attributes for JSON."""
    from safetensors.numpy import save

    arrays: dict[str, np.ndarray] = {}
    described: dict[str, dict[str, Any]] = {}
    for name, variable in dataset.variables.items():
        values = variable.values
        entry = described[str(name)] = {"dimensions": variable.dims, "attributes": variable.attrs}
        if values.dtype.kind in "OU":
            entry |= {"shape": values.shape, "text": values.ravel().tolist()}
            "".join(entry["text"])
        else:
            arrays[str(name)] = np.ascontiguousarray(values).reshape(values.shape)
    coordinates = [str(name) for name in dataset.coords]
    content = {"variables": described, "coordinates": coordinates, "attributes": dataset.attrs}
    header = {"schema": SCHEMA, "key": key, "sha256": ZEROS}
    file = save(arrays, header | {"dataset": json.dumps(content, default=_plain)})
    return _with_hash(file, ZEROS, hashlib.sha256(file).hexdigest())


def decoded(content: bytes, key: str) -> StoredRun:
    """What the content of a file holds; `CorruptError` if it is not what was written for a key."""
    from safetensors import SafetensorError
    from safetensors.numpy import load

    size = int.from_bytes(content[:PREFIX], "little")
    try:
        header = json.loads(content[PREFIX : PREFIX + size])["__metadata__"]
        if (schema := header["schema"]) != SCHEMA:
            raise CorruptError(f"{shortened(schema)!r}, where this version writes {SCHEMA!r}")
        if (other := header["key"]) != key:
            raise CorruptError(f"not the result that belongs here, but of {shortened(other)}")
        digest = header["sha256"]
        if hashlib.sha256(_with_hash(content, digest, ZEROS)).hexdigest() != digest:
            raise CorruptError("what it holds is not what was written")
        described, arrays = json.loads(header["dataset"]), load(content)
        run = StoredRun({}, list(described["coordinates"]), dict(described["attributes"]))
        texts = [*run.coordinates, *run.attributes.values()]
        for name, entry in described["variables"].items():
            if "text" in entry:
                arrays[name] = np.array(entry["text"], dtype=object).reshape(entry["shape"])
            dimensions, attributes = list(entry["dimensions"]), dict(entry["attributes"])
            run.variables[name] = dimensions, arrays[name], attributes
            texts += [*dimensions, *attributes.values(), *entry.get("text", [])]
        # Of anything but texts it raises an error.
        "".join(texts).encode()
        _check_layout(run)
        return run
    except (*WRONG, SafetensorError):
        raise CorruptError("damaged, or no result of this package") from None


def _check_layout(run: StoredRun) -> None:
    """Raise `ValueError` if variables don't make a dataset, or there is no end of the run."""
    sizes: dict[str, int] = {}
    for name, (dimensions, array, attributes) in run.variables.items():
        once = len({*dimensions}) == array.ndim and (array.ndim < 2 or name not in dimensions)
        fit = [*map(sizes.setdefault, dimensions, array.shape)] == [*array.shape]
        if not (once and fit and attributes.keys() <= ATTRIBUTES):
            raise ValueError(name)
    ends = [run.variables[name][1].dtype for name in ("status", "message")]
    named = all(map(str.isidentifier, [*run.variables, *sizes, *run.attributes]))
    if ends != [object, object] or not (named and {*run.coordinates} <= run.variables.keys()):
        raise ValueError("status")


def _with_hash(content: bytes, old: str, new: str) -> bytes:
    return content.replace(HASH.format(old).encode(), HASH.format(new).encode(), 1)


def _plain(value: Any) -> Any:
    """What NumPy has of JSON's types."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} can't be stored")


def prepare_folder(folder: Path) -> None:
    """Make a results folder, prove that it can be written, and remove old parts of files."""
    for part in (folder / "cells", folder / "studies"):
        make_folder(part)
        probe_folder(part)
        with suppress(OSError):
            remove_leftovers(part)


def run_path(folder: Path, key: str) -> Path:
    """File of the experiment with this key."""
    return folder / "cells" / key[:2] / f"{key}{ENDING}"


def write_run(content: bytes, folder: Path, key: str) -> None:
    """Store the content of a run's file."""
    path = run_path(folder, key)
    path.parent.mkdir(parents=True, exist_ok=True)
    # Where parts of files are looked for there are no other files.
    write_whole(path, lambda temporary: temporary.write_bytes(content), folder / "cells")


def read_run(folder: Path, key: str) -> StoredRun:
    """Stored result; `FileError` if it is missing, `CorruptError` if not what was written."""
    path = run_path(folder, key)
    try:
        return decoded(read_regular(path, MOST_BYTES), key)
    except CorruptError as error:
        raise CorruptError(error.reason, path, "; run again") from None
    except ValueError as error:
        raise CorruptError(f"not a result file: {error}", path, "; run again") from None
    except FileNotFoundError:
        raise FileError(f"{path}: no such result file; run again") from None
    except OSError as error:
        machine = machine_reason(error)
        kind = MachineError if machine else FileError
        raise kind(f"{path}: can't be read ({machine or error.strerror})") from None


def is_stored(folder: Path, key: str) -> bool:
    """Whether a finished result is stored."""
    with suppress(FileError, MachineError):
        return not read_run(folder, key).broken
    return False


def finished_runs(folder: Path, keys: Iterable[str]) -> set[str]:
    """Those of some experiments that are stored; what is not as it was written is quarantined."""
    finished = set()
    for key in keys:
        path = run_path(folder, key)
        if os.path.lexists(path):
            try:
                if not read_run(folder, key).broken:
                    finished.add(key)
            except CorruptError as error:
                quarantine(path, folder / "cells", error.reason)
    return finished


def quarantine(path: Path, part: Path, reason: str) -> None:
    """Move what is not as it was written out of the way, and name it."""
    target, number = part / QUARANTINE / path.name, 1
    while target.exists():
        target = target.with_name(f"{path.stem}-{(number := number + 1)}{path.suffix}")
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
    attributes = global_attributes(path, stored=True)
    return path if attributes.get("content") == content else None


def stored(
    path: Path,
    attribute: str,
    key: str,
    make: Callable[[], xr.Dataset],
    sources: Callable[[], Iterable[Path]] = list,
    content: str = "",
) -> xr.Dataset:
    """What is stored for this key, else what `make` gives, which is then stored.

    That replaces the results of another study of that name, which can be combined again.
    The global `attribute` holds the key, `content` is the hash of a study file.  `make` is called
    again if one of its sources is missing, a bug has ended a run, or the attribute `missing` says
    that something was not measured.
    """
    # Asked before it is read: what another process stores meanwhile is none of others.
    there = os.path.lexists(path)
    held = global_attributes(path, stored=True)
    if held.get(attribute) == key and all(source.exists() for source in sources()):
        dataset = read_dataset(path, stored=True)
        # What a bug has ended is tried again.
        ended = "status" not in dataset or "error" not in dataset["status"].values
        if ended and not held.get("missing"):
            dataset.encoding["source"] = str(path)
            return dataset
    make_folder(path.parent)
    if there and held.get("source") != "vehiclemor":
        quarantine(path, path.parent, "not as it was written, or no result of this package")
    dataset = make().assign_attrs({attribute: key})
    if content:
        dataset = dataset.assign_attrs(content=content)
        if held.get("content", content) != content:
            _LOG.info("%s: replaces the results of another %s.toml", path, path.stem)
    write_dataset(dataset, path)
    dataset.encoding["source"] = str(path)
    return dataset
