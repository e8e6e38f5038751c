"""Checks of arguments: numbers, counts, arrays, folders; and of the arrays of loaded models.

Compiled code reads and writes at fixed offsets, or as far as an array is long: a file with wrong
sizes would reach into other memory.  A class that may be part of a saved model has a method
`check_sizes`, which raises `ValueError` where its fields don't fit.
"""

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vehiclemor.exceptions import InputError
from vehiclemor.short_repr import shortened

# Processes, names in a list, and numbers of a range.
MOST_JOBS, MOST_NAMES, MOST_NUMBERS = 1024, 10_000, 100_000_000
# Pydantic's word for a bound, and its kind of an error -> ours.
BOUNDS = {"ge": "at least", "gt": "above", "le": "at most", "lt": "below"}
ERRORS = {
    "bool_type": "is {}, neither true nor false",
    "int_type": "is {}, not an integer",
    "float_type": "is {}, not a number",
    "string_type": "is {}, not a text",
    "list_type": "is {}, not a list",
    "dict_type": "is {}, not a table",
    "missing": "is missing",
    "extra_forbidden": "is not a known key",
}


def quoted(value: object) -> str:
    """A value as an error shows it: one line, cut short."""
    return shortened(repr(value))


def complaint(error: Mapping[str, Any]) -> str:
    """What is wrong with a value, of an error of pydantic, in the words of this package."""
    value, limits = error["input"], error.get("ctx", {})
    for limit, words in BOUNDS.items():
        if limit in limits:
            return f"is {value:g}; it must be {words} {limits[limit]:g}"
    if error["type"] == "literal_error":
        allowed = limits["expected"].replace(" or ", ", ").replace("'", "")
        return f"is {quoted(value)}; allowed: {allowed}"
    if error["type"] in ERRORS:
        return ERRORS[error["type"]].format(quoted(value))
    return error["msg"].removeprefix("Value error, ").replace(" after validation", "")


def line_of_text(name: str, value: object) -> str:
    """A text in one line without control characters; `InputError` if it is none."""
    if not isinstance(value, str) or not value.isprintable():
        raise InputError(f"{name} is {quoted(value)}, not a line of text")
    return value


def real_array(value: Any) -> np.ndarray:
    """Floats of a number or nested lists of numbers; `TypeError` of text, dates and the like."""
    try:
        # A range takes no memory before it becomes an array.
        large = isinstance(value, range) and value[MOST_NUMBERS:]
        array = None if large or np.ma.is_masked(value) else np.asarray(value)
    except (ArithmeticError, LookupError, MemoryError, TypeError, ValueError):
        array = None
    if array is None or array.dtype.kind not in "iuf":
        raise TypeError(f"{quoted(value)} is not a number or a list of numbers")
    return array.astype(float, copy=False)


def number(name: str, value: object) -> float:
    """A finite real number, or `InputError`."""
    try:
        array = real_array(value)
    except (TypeError, ValueError):
        array = None
    if array is None or array.ndim:
        raise InputError(f"{name}: {quoted(value)} is not a number")
    if not math.isfinite(array):
        raise InputError(f"{name}: {float(array)} is not finite")
    return float(array)


def within(name: str, value: float, bounds: tuple[float, float], unit: str = "") -> float:
    """The value; `InputError` if it lies outside its bounds."""
    if value < bounds[0]:
        raise InputError(f"{name}: {value:g}{unit} is below {bounds[0]:g}{unit}")
    if value > bounds[1]:
        raise InputError(f"{name}: {value:g}{unit} is above {bounds[1]:g}{unit}")
    return value


def count(name: str, value: object, least: int = 1, most: int | None = None) -> int:
    """An integer within bounds, or `InputError`."""
    integer = isinstance(value, int | np.integer) and not isinstance(value, bool | np.timedelta64)
    if not integer or int(value) < least or (most and int(value) > most):  # type: ignore[arg-type]
        bounds = f"at least {least}" + (f", at most {most}" if most else "")
        raise InputError(f"{name} is {quoted(value)}; it must be a whole number, {bounds}")
    return int(value)  # type: ignore[arg-type]


def flag(name: str, value: object) -> bool:
    """True or False, or `InputError`."""
    if not isinstance(value, bool | np.bool_):
        raise InputError(f"{name} is {quoted(value)}, neither True nor False")
    return bool(value)


def file_path(name: str, value: object) -> Path:
    """Path of a file or folder; `InputError` if it is none, or an empty one."""
    try:
        text = os.fspath(value)  # type: ignore[call-overload]
        # Results name their source files, in UTF-8 and in one line.
        if not (isinstance(text, str) and text.encode()) or min(text) < " ":
            raise TypeError
        path = Path(text)
        path.exists()
    except OSError as error:
        raise InputError(f"{name}: {quoted(value)} is not a path ({error.strerror})") from None
    except (TypeError, ValueError):
        raise InputError(f"{name}: {quoted(value)} is not a path") from None
    return path


def study_names(name: str, value: Any) -> list[str]:
    """Names of studies, or paths of their files, of which one may stand alone; or `InputError`."""
    entries = [value] if isinstance(value, str | os.PathLike) else value
    if not isinstance(entries, Sequence) or entries[MOST_NAMES:]:
        raise InputError(f"{name} is {quoted(value)}, not a list of names or files of studies")
    return [str(file_path(name, entry)) for entry in entries]


def loop_array(values: Any) -> np.ndarray:
    """Floats in the one kind of array that the loops are compiled for."""
    if type(values) is np.ndarray and values.dtype == np.float64 and values.flags.carray:
        return values
    return np.require(real_array(values), float, ("C", "A", "W"))


def require(fits: bool, what: str) -> None:
    """Raise `ValueError` unless something fits."""
    if not fits:
        raise ValueError(f"{what} does not fit the rest")


def check_shapes(what: str, *arrays: Sequence[Any]) -> None:
    """Require arrays of floats; each stands with its shape."""
    for array, *shape in arrays:
        require(array.dtype == float and array.shape == tuple(shape), what)


def check_indices(what: str, indices: Sequence[Any], size: int) -> None:
    """Require integers from zero to below a size."""
    require(all(type(index) is int and 0 <= index < size for index in indices), what)


def check_distinct_indices(what: str, indices: Sequence[Any], size: int) -> None:
    """Require indices that are all different."""
    check_indices(what, indices, size)
    require(len({*indices}) == len(indices), what)
