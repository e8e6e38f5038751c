"""Named columns of tables, the samples of signals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vehiclemor.arguments import number, quoted, real_array
from vehiclemor.exceptions import FileError, InputError, one_line
from vehiclemor.files import NO_FILE
from vehiclemor.multibody.quantities import integral_of
from vehiclemor.registry import choice

# Usual separators of columns, to guess the one that is meant.
SEPARATORS = ",;\t| "
# Units of logged inputs -> SI.
UNITS = {"SI": 1.0, "rad": 1.0, "deg": np.pi / 180.0, "m": 1.0, "mm": 1e-3}
UNITS |= {"m/s": 1.0, "km/h": 1.0 / 3.6, "mph": 0.44704, "s": 1.0, "ms": 1e-3}


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

    if not isinstance(time, str):
        raise InputError(f"time is {quoted(time)}, not the name of a column")
    for name, mark in {"separator": separator, "decimal": decimal}.items():
        if not isinstance(mark, str) or len(mark) != 1:
            raise InputError(f"{name} is {quoted(mark)}, not a character")
    if separator == decimal:
        raise InputError(f"separator and decimal are both {separator!r}: set separator=';'")
    read = partial(pd.read_csv, path, sep=separator, decimal=decimal, skipinitialspace=True)
    try:
        if path.exists() and not path.is_file():
            raise ValueError(NO_FILE)
        with path.open(encoding="utf-8-sig") as file:
            _check_separator(path, separator, file.readline(), file.readline())
        # Rows longer than the first, which pandas would take for an index, are refused here; names
        # are as in the file.
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
    columns = inputs if isinstance(inputs, Mapping) else {name: name for name in listed(inputs)}
    columns = columns or {name: name for name in table if name != time}
    options = [*columns] if isinstance(inputs, Mapping) else ["inputs"] * len(columns)
    for option, name in zip(["time", *options], listed([time, *columns.values()]), strict=True):
        if name not in table:
            known = f"set {option}= to one of {', '.join(table)}"
            raise InputError(f"{path}: there is no column {quoted(name)}: {known}")
        if table[name].dtype.kind not in "iuf":
            texts = table[name].astype(str).str.replace(decimal, ".", regex=False)
            numbers: Any = pd.to_numeric(texts, errors="coerce")
            if numbers.isna().any():
                odd = texts[numbers.isna()].iloc[0]
                hint = ": is decimal=',' meant?" if "," in odd else ""
                raise InputError(f"{path}: column {name!r} holds {quoted(odd)}, not a number{hint}")
            table[name] = numbers
    values = np.column_stack([table[name] for name in columns.values()] or [np.empty(0)])
    return table[time].to_numpy(), values, [*columns]


def check_numbers(path: Path, columns: Sequence[str], table: np.ndarray, rows: Any) -> None:
    """Raise `InputError` if a cell of a table (rows, columns) is empty, or not finite."""
    missing = np.argwhere(~np.isfinite(table))
    if len(missing):
        row, column = missing[0]
        raise InputError(f"{path}: column {columns[column]!r} has no number in row {rows[row]}")


def _check_separator(path: Path, separator: str, header: str, row: str) -> None:
    """Raise `FileError` if other characters stand between the columns of the first two lines."""
    other = [character for character in SEPARATORS if character in header.strip()]
    if other and separator not in header:
        decimal = " with decimal=','" if other[0] == ";" and "," in row else ""
        raise FileError(
            f"{path}: one column, {quoted(header.strip())}: "
            f"is separator={other[0]!r}{decimal} meant?"
        )


def unit_factor(unit: str, ratio: float) -> float:
    """Factor from a logged column to an input in SI units."""
    if number("ratio", ratio) == 0.0:
        raise InputError("ratio is 0; it divides the columns")
    return UNITS[choice("unit", unit, UNITS)] / ratio


def sample_arrays(t: Any, u: Any) -> tuple[np.ndarray, np.ndarray]:
    """Times and values as floats; `InputError` if they are none."""
    try:
        return real_array(t), real_array(u)
    except (TypeError, ValueError) as error:
        raise InputError(f"samples of a signal: {error}") from None


def listed(given: Any, argument: str = "inputs") -> tuple[str, ...]:
    """Names, of which one may stand alone."""
    names = (given,) if isinstance(given, str) else given
    if not isinstance(names, Sequence) or not all(isinstance(name, str) for name in names):
        raise InputError(f"{argument} is {quoted(given)}, not a list of names")
    return tuple(names)


def column_names(inputs: Any, columns: int) -> tuple[str, ...]:
    """Names of the columns, or none."""
    names = listed(inputs)
    if len(set(names)) < len(names) or len(names) not in (0, columns):
        raise InputError(f"a signal of {columns} columns can't be named {quoted(names)}")
    return names


def derivative_order(name: str, inputs: Sequence[str]) -> int:
    """How often one of the inputs has been derived from the lowest of them."""
    lower = integral_of(name)
    return 1 + derivative_order(lower, inputs) if lower in inputs else 0
