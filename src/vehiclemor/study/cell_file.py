"""The file of one cell: its arrays as safetensors, all else as JSON in the header of the file.

The header holds a hash of the file, so a part, or a flipped bit, is never read as a result.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vehiclemor.errors import SpoiledError
from vehiclemor.short_repr import shortened

if TYPE_CHECKING:
    import xarray as xr

ENDING, SCHEMA = ".safetensors", "vehiclemor cell 3"
# Where the hash stands; while it is computed there are zeros.
HASH, ZEROS = '"sha256":"{}"', "0" * 64
# Length of the header is told in so many bytes.
PREFIX = 8
# What comes of a text that is none of ours.
WRONG = ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError


class Cell(NamedTuple):
    """What the file of a cell holds: variables as xarray takes them, text as objects.

    Attributes
    ----------
    seconds
        That it took, its fit and the reference included; NaN if nobody has measured.
    """

    variables: dict[str, tuple[list[str], np.ndarray, dict[str, Any]]]
    coordinates: list[str]
    attributes: dict[str, Any]
    seconds: float

    @property
    def ends(self) -> Counter[tuple[str, str]]:
        """(status, message) -> number of its runs."""
        texts = (self.variables[name][1].ravel().tolist() for name in ("status", "message"))
        return Counter(zip(*texts, strict=True))

    @property
    def broken(self) -> bool:
        """Whether a bug has ended it: the next run tries it again."""
        return "error" in self.variables["status"][1].ravel().tolist()

    def dataset(self) -> xr.Dataset:
        """As it was stored."""
        import xarray as xr

        return xr.Dataset(self.variables, attrs=self.attributes).set_coords(self.coordinates)


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
        entry = described[str(name)] = {"dimensions": variable.dims, "attributes": variable.attrs}
        if values.dtype.kind in "OU":
            entry |= {"shape": values.shape, "text": values.ravel().tolist()}
            "".join(entry["text"])
        else:
            arrays[str(name)] = np.ascontiguousarray(values).reshape(values.shape)
    content = {
        "variables": described,
        "coordinates": [str(name) for name in dataset.coords],
        "attributes": dataset.attrs,
        "seconds": float(seconds),
    }
    header = {
        "schema": SCHEMA,
        "key": key,
        "sha256": ZEROS,
        "dataset": json.dumps(content, default=_plain),
    }
    whole = save(arrays, header)
    return _filled(whole, ZEROS, hashlib.sha256(whole).hexdigest())


def decoded(content: bytes, key: str) -> Cell:
    """What the content of a file holds.

    Raises
    ------
    SpoiledError
        If it is not what was written for this key.
    """
    from safetensors import SafetensorError
    from safetensors.numpy import load

    size = int.from_bytes(content[:PREFIX], "little")
    if len(content) < PREFIX + size:
        raise SpoiledError("truncated, or no result of this package")
    try:
        header = json.loads(content[PREFIX : PREFIX + size])["__metadata__"]
        schema, found = shortened(header["schema"]), shortened(header["key"])
        if schema != SCHEMA:
            raise SpoiledError(f"{schema!r}, where this version writes {SCHEMA!r}")
        if found != key:
            raise SpoiledError(f"not the result that belongs here, but of {found}")
        digest = header["sha256"]
        if hashlib.sha256(_filled(content, digest, ZEROS)).hexdigest() != digest:
            raise SpoiledError("what it holds is not what was written")
        found, arrays, variables = json.loads(header["dataset"]), load(content), {}
        for name, entry in found["variables"].items():
            if "text" in entry:
                arrays[name] = np.array(entry["text"], dtype=object).reshape(entry["shape"])
            variables[name] = entry["dimensions"], arrays[name], dict(entry["attributes"])
        attributes, seconds = dict(found["attributes"]), float(found["seconds"])
        return Cell(variables, found["coordinates"], attributes, seconds)
    except (*WRONG, SafetensorError):
        raise SpoiledError("damaged, or no result of this package") from None


def _filled(content: bytes, old: str, new: str) -> bytes:
    """A file with another hash in its place, the first where its text stands."""
    return content.replace(HASH.format(old).encode(), HASH.format(new).encode(), 1)


def _plain(value: Any) -> Any:
    """What NumPy has of JSON's types."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} can't be stored")
