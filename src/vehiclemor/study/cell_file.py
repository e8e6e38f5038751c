"""The file of one cell: its arrays as safetensors, all else as JSON in the header of the file.

The header holds a hash of the file, so a part, or a flipped bit, is never read as a result.  It
comes first: how a cell has ended is told without reading its arrays.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from pydantic import Field, TypeAdapter

from vehiclemor.errors import SpoiledError
from vehiclemor.short_repr import shortened
from vehiclemor.toml_files import FileSchema

if TYPE_CHECKING:
    import xarray as xr

ENDING, SCHEMA = ".safetensors", "vehiclemor cell 1"
# Where the hash stands; while it is computed there are zeros.
HASH, ZEROS = '"sha256":"{}"', "0" * 64
# Length of the header is told in so many bytes; and a first read that mostly has all of it.
PREFIX, FIRST = 8, 1 << 14
# Bytes that a variable may take which takes less in the file: text.
MOST = 1 << 28
# Status, message and number of runs.
RUNS = TypeAdapter(list[tuple[str, str, int]])
# Coordinates; and variable -> dimensions, shape, whether it is text, and all its attributes are.
Layout = tuple[set[str], dict[str, tuple[list[str], tuple[int, ...], bool, bool]]]
Made = TypeVar("Made")


class End(NamedTuple):
    """How a cell has ended.

    Attributes
    ----------
    runs
        (status, message) -> number of its runs.
    seconds
        That it took, its fit and the reference included; NaN if nobody has measured.
    """

    runs: dict[tuple[str, str], int]
    seconds: float


class Variable(FileSchema):
    """What the header says of a variable, and its text if it is that."""

    dimensions: list[str]
    attributes: dict[str, Any]
    type: str = Field(pattern=r"^[<>|][A-Za-z]\d*$")
    shape: tuple[int, ...] = ()
    text: list[str] | None = None


class Description(FileSchema):
    """What the header says of a dataset."""

    variables: dict[str, Variable]
    coordinates: list[str]
    attributes: dict[str, Any]


def encoded(dataset: xr.Dataset, key: str, seconds: float = np.nan) -> bytes:
    """Content of the file of a cell.

    Parameters
    ----------
    dataset
        Variables of numbers, truths or text; attributes that JSON has, or NumPy's of these.
    seconds
        That the cell took.
    """
    from safetensors.numpy import save

    arrays: dict[str, np.ndarray] = {}
    described: dict[str, dict[str, Any]] = {}
    for name, variable in dataset.variables.items():
        values = variable.values
        entry: dict[str, Any] = {
            "dimensions": variable.dims,
            "attributes": variable.attrs,
            "type": values.dtype.str,
        }
        if values.dtype.kind in "OU":
            entry |= {"shape": values.shape, "text": _text(values)}
        else:
            arrays[str(name)] = np.ascontiguousarray(values).reshape(values.shape)
        described[str(name)] = entry
    content = {
        "variables": described,
        "coordinates": [str(name) for name in dataset.coords],
        "attributes": dataset.attrs,
    }
    header = {
        "schema": SCHEMA,
        "key": key,
        "sha256": ZEROS,
        "seconds": repr(float(seconds)),
        "runs": json.dumps([[*end, count] for end, count in _runs(dataset).items()]),
        "dataset": json.dumps(content, default=_plain),
    }
    whole = save(arrays, header)
    return _filled(whole, ZEROS, hashlib.sha256(whole).hexdigest())


def arrays_of(content: bytes, key: str) -> dict[str, np.ndarray]:
    """Arrays of a cell by name, text as objects; what has no dimension is no array.

    Raises
    ------
    SpoiledError
        If the content is not what was written for this key.
    """
    return _decoded(content, key, lambda _, arrays: {n: array[()] for n, array in arrays.items()})


def dataset_of(content: bytes, key: str) -> xr.Dataset:
    """The dataset of a cell; `SpoiledError` as of `arrays_of`."""
    import xarray as xr

    def made(described: Description, arrays: dict[str, np.ndarray]) -> xr.Dataset:
        variables = {
            name: (entry.dimensions, arrays[name].astype(entry.type, copy=False), entry.attributes)
            for name, entry in described.variables.items()
        }
        dataset = xr.Dataset(variables, attrs=described.attributes)
        return dataset.set_coords(described.coordinates)

    return _decoded(content, key, made)


def layout(content: bytes, key: str) -> Layout:
    """What a cell holds, whatever the values; `SpoiledError` as of `arrays_of`."""

    def made(described: Description, arrays: dict[str, np.ndarray]) -> Layout:
        return set(described.coordinates), {
            name: (
                entry.dimensions,
                arrays[name].shape,
                entry.text is not None,
                all(isinstance(value, str) for value in entry.attributes.values()),
            )
            for name, entry in described.variables.items()
        }

    return _decoded(content, key, made)


def check(content: bytes, key: str) -> dict[str, str]:
    """Texts of the header of a file that is what was written for a key; else `SpoiledError`."""
    header = _header(content, key)
    digest = header.get("sha256", "")
    if hashlib.sha256(_filled(content, digest, ZEROS)).hexdigest() != digest:
        raise SpoiledError("what it holds is not what was written")
    return header


def end_of(path: Path, key: str) -> End:
    """How a cell has ended, from the header of its file alone; `SpoiledError` as of `arrays_of`."""
    with path.open("rb", buffering=0) as file:
        content = file.read(FIRST)
        if PREFIX + int.from_bytes(content[:PREFIX], "little") > len(content):
            content += file.read()
    return _end(_header(content, key))


def _end(header: dict[str, str]) -> End:
    try:
        runs = {(status, text): n for status, text, n in RUNS.validate_json(header["runs"])}
        return End(runs, float(header["seconds"]))
    except (ValueError, KeyError, TypeError):
        raise SpoiledError("damaged") from None


def _header(content: bytes, key: str) -> dict[str, str]:
    size = int.from_bytes(content[:PREFIX], "little")
    if len(content) < PREFIX + size:
        raise SpoiledError("truncated, or no result of this package")
    try:
        header = json.loads(content[PREFIX : PREFIX + size])["__metadata__"]
        schema, found = shortened(header["schema"]), shortened(header["key"])
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise SpoiledError("damaged, or no result of this package") from None
    if schema != SCHEMA:
        raise SpoiledError(f"{schema!r}, where this version writes {SCHEMA!r}")
    if found != key:
        raise SpoiledError(f"not the result that belongs here, but of {found}")
    return header


def _decoded(
    content: bytes, key: str, make: Callable[[Description, dict[str, np.ndarray]], Made]
) -> Made:
    """What is made of the arrays of a file, text as objects, and of what it says of them."""
    from safetensors import SafetensorError
    from safetensors.numpy import load

    header = check(content, key)
    _end(header)
    try:
        described, arrays = Description.model_validate_json(header["dataset"]), load(content)
        for name, entry in described.variables.items():
            if entry.text is not None:
                arrays[name] = np.array(entry.text, dtype=object).reshape(entry.shape)
            size, stored = arrays[name].size, arrays[name].nbytes
            if np.dtype(entry.type).itemsize * size > max(stored, MOST):
                raise ValueError
        return make(described, arrays)
    except (ArithmeticError, LookupError, SafetensorError, TypeError, ValueError):
        raise SpoiledError("what it holds is no result") from None


def _filled(content: bytes, old: str, new: str) -> bytes:
    """A file with another hash in its place, the first where its text stands."""
    return content.replace(HASH.format(old).encode(), HASH.format(new).encode(), 1)


def _text(values: np.ndarray) -> list[str]:
    found = values.ravel().tolist()
    if not all(isinstance(value, str) for value in found):
        raise TypeError("objects that are no text can't be stored")
    return found


def _plain(value: Any) -> Any:
    """What NumPy has of JSON's types."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} can't be stored")


def _runs(dataset: xr.Dataset) -> Counter[tuple[str, str]]:
    """(status, message) -> number of runs."""
    if not {"status", "message"} <= set(dataset.variables):
        return Counter()
    ends = (dataset.variables[n].values.ravel().tolist() for n in ("status", "message"))
    return Counter(zip(*ends, strict=True))
