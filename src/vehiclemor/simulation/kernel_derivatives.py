"""Analytic derivatives of kernels at a state: by the state, by the inputs, along the constants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vehiclemor.arguments import quoted
from vehiclemor.codegen.derivatives import Sensitivity, sensitivity
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.exceptions import InputError
from vehiclemor.registry import choice

# Places of the arguments of a kernel.
STATE, INPUTS, CONSTANTS = range(3)
PLACES = {"state": STATE, "inputs": INPUTS}
# State, inputs and constants, as kernels want them.
Arrays = tuple[np.ndarray, np.ndarray, np.ndarray]
# What derivatives are taken by: `state`, `inputs`, or names of parameters.
By = str | Sequence[str]


def partial(kernels: Kernels, name: str, arrays: Arrays, size: int, place: int) -> np.ndarray:
    """Derivatives (size, n) of a kernel's result by the entries of the argument at a place."""
    return _sensitivity(kernels, name, arrays, size, place).jacobian(arrays)


def directional(
    kernels: Kernels, name: str, arrays: Arrays, size: int, place: int, directions: np.ndarray
) -> np.ndarray:
    """Derivatives (k, size) of a kernel's result along directions (k, n) of one argument."""
    return _sensitivity(kernels, name, arrays, size, place).columns(arrays, directions)


def _sensitivity(kernels: Kernels, name: str, arrays: Arrays, size: int, place: int) -> Sensitivity:
    source = kernels.sources[name]
    return sensitivity(source, source.arguments[place], size, len(arrays[place]))


def parameter_names(by: Any) -> tuple[str, ...]:
    """Names of parameters that derivatives are by; none for state and inputs.

    `InputError` if it is neither a name nor a sequence of names.
    """
    if isinstance(by, str):
        return () if by in PLACES else (by,)
    names = tuple(by) if isinstance(by, Sequence) else ()
    if not names or not all(isinstance(name, str) for name in names):
        raise InputError(
            f"with_respect_to is {quoted(by)}, neither state nor inputs nor names of parameters"
        )
    return names


def chosen(of: Any, known: Mapping[str, str]) -> str:
    """What the derivatives are of, by its name; `InputError` if there is no such thing."""
    return known[choice("of", of, known)]
