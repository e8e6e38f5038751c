"""Named columns of tables, from which signals are made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vehiclemor.arguments import quoted
from vehiclemor.exceptions import FileError, InputError, one_line

# What may stand between columns in the place of the separator that is expected.
SEPARATORS = ",;\t| "


def csv_samples(
    path: Path,
    separator: str,
    decimal: str,
    time: str,
    inputs: str | Sequence[str] | Mapping[str, str],
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Times (n,), inputs (n, inputs) and their names, of columns of a CSV file, else of all.

    `FileError` if it is no such file, `InputError` if there is no such column.
    """
    import pandas as pd

    for name, mark in {"separator": separator, "decimal": decimal}.items():
        if not isinstance(mark, str) or len(mark) != 1:
            raise InputError(f"{name} is {quoted(mark)}, not a character")
    if separator == decimal:
        raise InputError(f"separator and decimal are both {separator!r}: set separator=';'")
    read = partial(pd.read_csv, path, sep=separator, decimal=decimal, skipinitialspace=True)
    try:
        with path.open(encoding="utf-8-sig") as file:
            _check_separator(path, separator, file.readline(), file.readline())
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
    table.columns = table.columns.astype(str)
    chosen = inputs or [name for name in table if name != time]
    columns = chosen if isinstance(chosen, Mapping) else {name: name for name in listed(chosen)}
    for name in listed([time, *columns.values()]):
        if name not in table:
            option = "time" if name == time else "inputs"
            known = f"set {option}= to one of {', '.join(table)}"
            raise InputError(f"{path}: there is no column {quoted(name)}: {known}")
        if table[name].dtype.kind not in "iuf":
            texts = table[name].astype(str).str.replace(decimal, ".", regex=False)
            numbers: Any = pd.to_numeric(texts, errors="coerce")
            odd = texts[np.isnan(numbers)].iloc[0]
            hint = ": is decimal=',' meant?" if "," in odd else ""
            raise InputError(f"{path}: column {name!r} holds {quoted(odd)}, not a number{hint}")
    values = np.column_stack([table[name] for name in columns.values()] or [np.empty(0)])
    return table[time].to_numpy(), values, [*columns]


def _check_separator(path: Path, separator: str, header: str, row: str) -> None:
    """Raise `FileError` if other characters stand between the columns of the first two lines."""
    other = [character for character in SEPARATORS if character in header.strip()]
    if other and separator not in header:
        decimal = " with decimal=','" if other[0] == ";" and "," in row else ""
        raise FileError(
            f"{path}: one column, {quoted(header.strip())}: "
            f"is separator={other[0]!r}{decimal} meant?"
        )


def listed(inputs: Any) -> tuple[str, ...]:
    """Names, of which one may stand alone."""
    names = (inputs,) if isinstance(inputs, str) else inputs
    if not isinstance(names, Sequence) or not all(isinstance(name, str) for name in names):
        raise InputError(f"inputs is {quoted(inputs)}, not a list of names")
    return tuple(names)
