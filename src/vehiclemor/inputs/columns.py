"""Named columns of tables, from which signals are made, and their SI units."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vehiclemor.arguments import quoted
from vehiclemor.exceptions import FileError, InputError, one_line

# What may stand between columns in the place of the separator that is expected.
SEPARATORS = ",;\t| "


def csv_columns(path: Path, separator: str) -> dict[str, np.ndarray]:
    """Columns (n,) of a CSV file by the names in its first line; `FileError` if it is none."""
    import pandas as pd

    if not isinstance(separator, str) or len(separator) != 1:
        raise InputError(f"separator is {quoted(separator)}, not a character")
    read = partial(pd.read_csv, path, sep=separator, skipinitialspace=True)
    try:
        # A longer row, of which an index would be made, is refused here; names are not yet altered.
        names = read(header=None, nrows=2, dtype=str).iloc[0]
        table = read()
    except FileNotFoundError:
        raise FileError(f"{path}: no such file") from None
    except OSError as error:
        raise FileError(f"{path}: can't be read ({error.strerror})") from None
    except ValueError as error:
        raise FileError(f"{path}: no CSV file: {one_line(error)}") from None
    if names.dropna().duplicated().any():
        raise FileError(f"{path}: columns have the same name")
    other = [character for character in SEPARATORS if character in str(names[0])]
    if len(names) == 1 and other:
        raise FileError(f"{path}: one column, {quoted(names[0])}: is separator={other[0]!r} meant?")
    return {str(name): table[name].to_numpy() for name in table.columns}


def array_columns(data: Any, time: str) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Columns (n,) of labelled data along the times, these among them, and units that they tell.

    `InputError` if they are no data of xarray, or have no times.
    """
    import xarray as xr

    if not isinstance(data, xr.DataArray | xr.Dataset):
        raise InputError(f"data is {quoted(data)}, neither a DataArray nor a Dataset of xarray")
    if time not in data.coords or data[time].dims != (time,):
        raise InputError(f"the data have no times: a coordinate {time!r} is needed")
    # Parts of an array don't repeat what it tells of itself.
    told = ""
    if isinstance(data, xr.DataArray):
        others, told = [name for name in data.dims if name != time], data.attrs.get("units", "")
        try:
            data = data.to_dataset(dim=others[0]) if others else data.to_dataset(name=data.name)
        except ValueError as error:
            raise InputError(f"the data: {one_line(error)}") from None
    own = {str(name): array for name, array in data.data_vars.items() if array.dims == (time,)}
    units = {name: str(array.attrs.get("units", told)) for name, array in own.items()}
    units[time] = str(data[time].attrs.get("units", ""))
    return {name: array.to_numpy() for name, array in (own | {time: data[time]}).items()}, units


def chosen_columns(
    where: str,
    columns: Mapping[str, np.ndarray],
    units: Mapping[str, str],
    time: str,
    inputs: str | Sequence[str] | Mapping[str, str],
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Times (n,), inputs (n, inputs) and their names, of the columns that are named, else of all.

    `InputError` if there is no such column, or it tells another unit than one of SI.
    """
    chosen = inputs or [name for name in columns if name != time]
    named = chosen if isinstance(chosen, Mapping) else {name: name for name in listed(chosen)}
    for name in listed([time, *named.values()]):
        if name not in columns:
            known = ", ".join(columns)
            raise InputError(f"{where}: there is no column {quoted(name)} among {known}")
        powers = base_units(units.get(name, ""))
        if powers is None or (name == time and powers not in ({}, {"s": 1})):
            wanted = "s" if name == time else "SI units such as m, rad or m/s"
            raise InputError(f"{where}: {quoted(name)} is in {units[name]}, not in {wanted}")
    values = np.column_stack([columns[name] for name in named.values()] or [np.empty(0)])
    return columns[time], values, [*named]


def listed(inputs: Any) -> tuple[str, ...]:
    """Names, of which one may stand alone."""
    names = (inputs,) if isinstance(inputs, str) else inputs
    if not isinstance(names, Sequence) or not all(isinstance(name, str) for name in names):
        raise InputError(f"inputs is {quoted(inputs)}, not a list of names")
    return tuple(names)


# Unit -> powers of base units.
DERIVED = {
    **{name: {name: 1} for name in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")},
    "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "Hz": {"s": -1},
}


def base_units(unit: str) -> dict[str, int] | None:
    """Powers of base units in a unit such as `N s/m` or `m s-1`; none where a name is unknown."""
    powers: dict[str, int] = {}
    numerator, *denominators = unit.split("/")
    for sign, part in ((1, numerator), *((-1, part) for part in denominators)):
        for factor in part.split():
            match = re.fullmatch(r"([A-Za-z]+)(?:\^?(-?\d+))?", factor)
            if factor == "1":
                continue
            if match is None or match[1] not in DERIVED:
                return None
            for base, power in DERIVED[match[1]].items():
                powers[base] = powers.get(base, 0) + sign * power * int(match[2] or 1)
    return powers
