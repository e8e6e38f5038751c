"""Named columns of tables, from which signals are made."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vehiclemor.arguments import quoted
from vehiclemor.errors import FileError, InputError, one_line


def csv_columns(path: Path) -> dict[str, np.ndarray]:
    """Columns (n,) of a CSV file by the names in its first line; `FileError` if it is none."""
    import pandas as pd

    try:
        # A longer row, of which an index would be made, is refused here; names are not yet altered.
        names = pd.read_csv(path, skipinitialspace=True, header=None, nrows=2, dtype=str).iloc[0]
        table = pd.read_csv(path, skipinitialspace=True)
    except FileNotFoundError:
        raise FileError(f"{path}: no such file") from None
    except OSError as error:
        raise FileError(f"{path}: can't be read ({error.strerror})") from None
    except ValueError as error:
        raise FileError(f"{path}: no CSV file: {one_line(error)}") from None
    if names.dropna().duplicated().any():
        raise FileError(f"{path}: columns have the same name")
    return {str(name): table[name].to_numpy() for name in table.columns}


def array_columns(data: Any, time: str) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Columns (n,) of labelled data along the times, these among them, and units that they tell.

    Raises
    ------
    InputError
        If they are no data of xarray, or have no times.
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
