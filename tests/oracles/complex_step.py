"""Text of kernels run by Python over complex numbers: their derivatives without differences.

The imaginary part of F(x + i h v) / h is F's derivative along v, exact to rounding for a tiny h
(W. Squire, G. Trapp, SIAM Review 40 (1998), 110-112).
"""

import cmath
import math
from collections.abc import Sequence
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import numpy as np

from vehiclemor.codegen.vector_lanes import LANES, padded

TINY = 1e-30


def _atan2(y: complex, x: complex) -> complex:
    """Angle in the right quadrant, its imaginary part by the derivative of the angle."""
    y, x = complex(y), complex(x)
    change = (y.imag * x.real - x.imag * y.real) / (x.real**2 + y.real**2)
    return complex(math.atan2(y.real, x.real), change)


def _absolute(x: complex) -> complex:
    return x if complex(x).real >= 0.0 else -x


def _sincos_batch(work: np.ndarray, first: int) -> None:
    for k in range(first, first + LANES):
        work[k + LANES], work[k + 2 * LANES] = np.sin(work[k]), np.cos(work[k])


def _atan_batch(work: np.ndarray, first: int) -> None:
    for k in range(first, first + LANES):
        work[k + LANES] = np.arctan(work[k])


FUNCTIONS = ("sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "exp", "log", "sinh", "cosh")


@lru_cache(maxsize=16)
def kernel_function(text: str) -> Any:
    """The function of a kernel's text, which takes real or complex arrays."""
    own = {name: getattr(cmath, name) for name in (*FUNCTIONS, "tanh")}
    # Targets of a weighted sum are a tuple: how many there are is known where it is called.
    lines = []
    for line in text.splitlines():
        if "weighted_sums(" in line:
            targets = line.split("=")[0].strip().strip("()").rstrip(",").count(",") + 1
            line = line.rstrip()[:-1] + f", {targets})"  # noqa: PLW2901
        lines.append(line)

    def weighted_sums(array: Any, first: int, terms: Sequence[Any], targets: int) -> Any:
        rows = array[first : first + len(terms) * padded(targets)].reshape(len(terms), -1)
        return np.array(terms) @ rows[:, :targets]

    namespace = {
        "math": SimpleNamespace(**own, atan2=_atan2, fabs=_absolute),
        "abs": _absolute,
        "atan": cmath.atan,
        "sincos_one": lambda angle: (cmath.sin(angle), cmath.cos(angle)),
        "sincos_batch": _sincos_batch,
        "atan_batch": _atan_batch,
        "weighted_sums": weighted_sums,
    }
    before = set(namespace)
    exec("\n".join(lines), namespace)  # noqa: S102 - the package's own source
    (name,) = set(namespace) - before - {"__builtins__"}
    return namespace[name]


def derivative_along(
    text: str, arrays: Sequence[np.ndarray], directions: Sequence[np.ndarray], shape: Any
) -> np.ndarray:
    """Derivative of a kernel's result at some arguments along a direction of each of them."""
    result, work = np.zeros(shape, dtype=complex), np.zeros(4096, dtype=complex)
    moved = [a + 1j * TINY * d for a, d in zip(arrays, directions, strict=True)]
    kernel_function(text)(*moved, work, result)
    return result.imag / TINY


def jacobian(text: str, arrays: Sequence[np.ndarray], place: int, shape: Any) -> np.ndarray:
    """Derivatives (*shape, n) by the entries of the argument at a place."""
    columns = []
    for unit in np.eye(len(arrays[place])):
        directions = [np.zeros_like(array) for array in arrays]
        directions[place] = unit
        columns.append(derivative_along(text, arrays, directions, shape))
    return np.stack(columns, axis=-1)
