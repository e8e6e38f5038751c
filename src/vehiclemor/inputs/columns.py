"""Named columns of tables, from which signals are made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vehiclemor.arguments import quoted
from vehiclemor.exceptions import FileError, InputError, one_line
from vehiclemor.files import NO_FILE

# What may stand between columns in the place of the separator that is expected.
SEPARATORS = ",;\t| "


def csv_samples(
    path: Path, separator: str, time: str, inputs: str | Sequence[str] | Mapping[str, str]
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Times (n,), inputs (n, inputs) and their names, of columns of a CSV file, else of all.

    `FileError` if it is no such file, `InputError` if there is no such column.
    """
    import pandas as pd

    if not isinstance(separator, str) or len(separator) != 1:
        raise InputError(f"separator is {quoted(separator)}, not a character")
    read = partial(pd.read_csv, path, sep=separator, skipinitialspace=True)
    if not isinstance(time, str):
        raise InputError(f"time is {quoted(time)}, not the name of a column")
    try:
        if path.exists() and not path.is_file():
            raise ValueError(NO_FILE)
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
    table.columns = table.columns.astype(str)
    named = inputs if isinstance(inputs, Mapping) else {name: name for name in listed(inputs)}
    named = named or {name: name for name in table if name != time}
    for name in listed([time, *named.values()]):
        if name not in table:
            known = ", ".join(table)
            raise InputError(f"{path}: there is no column {quoted(name)} among {known}")
    values = np.column_stack([table[name] for name in named.values()] or [np.empty(0)])
    return table[time].to_numpy(), values, [*named]


def listed(inputs: Any) -> tuple[str, ...]:
    """Names, of which one may stand alone."""
    names = (inputs,) if isinstance(inputs, str) else inputs
    if not isinstance(names, Sequence) or not all(isinstance(name, str) for name in names):
        raise InputError(f"inputs is {quoted(inputs)}, not a list of names")
    return tuple(names)
