"""Named values with units that a script measures and keeps in a results folder."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.files import make_folder
from vehiclemor.netcdf_file import read_dataset, write_dataset
from vehiclemor.provenance import attributes

if TYPE_CHECKING:
    import xarray as xr

# `name, unit` -> value.
Values = dict[str, float]


def measured_values(
    path: Path, title: str, parts: Sequence[Callable[[], Values]], anew: bool
) -> xr.Dataset:
    """What a file holds; measured where there is none, or once more."""
    import xarray as xr

    if anew or not path.exists():
        values: Values = {}
        for part in parts:
            began = time.perf_counter()
            values |= part()
            name = (part.func if isinstance(part, partial) else part).__name__
            print(f"{name}: {time.perf_counter() - began:.0f} s", file=sys.stderr)
        names, units = zip(*(name.rsplit(", ", 1) for name in values), strict=True)
        coordinates = {"name": list(names), "output_unit": ("name", list(units))}
        data = xr.Dataset({"value": ("name", [*map(float, values.values())])}, coordinates)
        make_folder(path.parent)
        write_dataset(data.assign_attrs(attributes(title, "")), path)
    return read_dataset(path, "title", title)
