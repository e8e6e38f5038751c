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
        table = pd.read_csv(path, skipinitialspace=True)
    except FileNotFoundError:
        raise FileError(f"{path}: no such file") from None
    except OSError as error:
        raise FileError(f"{path}: can't be read ({error.strerror})") from None
    except ValueError as error:
        raise FileError(f"{path}: no CSV file: {one_line(error)}") from None
    return {str(name): table[name].to_numpy() for name in table.columns}


def array_columns(data: Any, time: str) -> dict[str, np.ndarray]:
    """Columns (n,) of labelled data along the times, these among them.

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
    if isinstance(data, xr.DataArray):
        others = [name for name in data.dims if name != time]
        data = data.to_dataset(dim=others[0]) if others else data.to_dataset(name=data.name)
    own = {name: array for name, array in data.data_vars.items() if array.dims == (time,)}
    columns = {str(name): array.to_numpy() for name, array in own.items()}
    return columns | {time: data[time].to_numpy()}
