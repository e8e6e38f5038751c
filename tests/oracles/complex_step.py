"""Operations of kernels run by NumPy: along arrays, or over complex numbers.

The imaginary part of F(x + i h v) / h is F's derivative along v, exact to rounding for a tiny h
(W. Squire, G. Trapp, SIAM Review 40 (1998), 110-112).
"""

import operator
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from vehiclemor.codegen.operations import Kernel
from vehiclemor.exporting import straight_line

TINY = 1e-30


def _atan2(y: Any, x: Any) -> Any:
    """Angle in the right quadrant, its imaginary part by the derivative of the angle."""
    real = np.arctan2(np.real(y), np.real(x))
    if not (np.iscomplexobj(y) or np.iscomplexobj(x)):
        return real
    change = np.imag(y) * np.real(x) - np.imag(x) * np.real(y)
    return real + 1j * change / (np.real(x) ** 2 + np.real(y) ** 2)


def _compared(compare: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    return lambda a, b: compare(np.real(a), np.real(b))


NAMED = {"asin": "arcsin", "acos": "arccos", "atan": "arctan"}
ORDERS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}
FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{n: getattr(np, NAMED.get(n, n)) for n in straight_line.FUNCTIONS if hasattr(np, n)},
    **{name: getattr(np, numpys) for name, numpys in NAMED.items()},
    **{sign: _compared(compare) for sign, compare in ORDERS.items()},
    "abs": lambda x: np.where(np.real(x) >= 0.0, x, -x),
    "atan2": _atan2,
    "select": np.where,
}


@lru_cache
def _lines(kernel: Kernel) -> straight_line.StraightLine:
    """A kernel without batches and sums."""
    lines = straight_line.Lines()
    given = {
        n: lines.entries(n, size) for n, size in zip(kernel.arguments, kernel.sizes, strict=True)
    }
    found = lines.include(kernel, given)
    return straight_line.StraightLine(lines.operations, [value.number for value in found])


def results(kernel: Kernel, arrays: Mapping[str, Sequence[Any]]) -> list[Any]:
    """Results of a kernel, row by row; entries of its arguments may be arrays."""
    return straight_line.evaluated(_lines(kernel), arrays, FUNCTIONS)


def derivative_along(
    kernel: Kernel, arrays: Sequence[np.ndarray], directions: Sequence[np.ndarray]
) -> np.ndarray:
    """Derivatives of results (m, ...) at some arguments along a direction (n, ...) of each."""
    moved = [
        a.reshape(a.shape + (1,) * (d.ndim - 1)) + 1j * TINY * d
        for a, d in zip(arrays, directions, strict=True)
    ]
    shape = np.broadcast_shapes(*(d.shape[1:] for d in directions))
    found = results(kernel, dict(zip(kernel.arguments, moved, strict=False)))
    return np.array([np.broadcast_to(np.imag(f), shape) for f in found]) / TINY


def jacobian(kernel: Kernel, arrays: Sequence[np.ndarray], place: int) -> np.ndarray:
    """Derivatives (m, n) of results by the entries of the argument at a place."""
    units = np.eye(len(arrays[place]))
    directions = [np.zeros((len(array), len(units))) for array in arrays]
    directions[place] = units
    return derivative_along(kernel, arrays, directions)


def products(jacobian: Any, arrays: Sequence[np.ndarray], seeds: np.ndarray) -> np.ndarray:
    """What a `JacobianProduct` gives along all seeds at once, without machine code.

    To compile the longest takes a quarter of a minute.
    """
    kernel = jacobian.kernel
    given = dict(zip(kernel.arguments, [*arrays, seeds.T], strict=False))
    found = [np.broadcast_to(result, len(seeds)) for result in results(kernel, given)]
    return np.column_stack(found)
