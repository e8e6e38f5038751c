"""Operations of kernels run by NumPy: along arrays, or over complex numbers.

The imaginary part of F(x + i h v) / h is F's derivative along v, exact to rounding for a tiny h
(W. Squire, G. Trapp, SIAM Review 40 (1998), 110-112).
"""

import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from vehiclemor.codegen.operations import Kernel
from vehiclemor.codegen.vector_lanes import padded

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
PLAIN = ("sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "exp", "log", "sinh", "cosh", "tanh")
FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{name: getattr(np, NAMED.get(name, name)) for name in PLAIN},
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "divide": operator.truediv,
    "power": operator.pow,
    "negate": operator.neg,
    "abs": lambda x: np.where(np.real(x) >= 0.0, x, -x),
    "atan2": _atan2,
    "select": np.where,
    "<": _compared(operator.lt),
    "<=": _compared(operator.le),
    ">": _compared(operator.gt),
    ">=": _compared(operator.ge),
    "==": _compared(operator.eq),
    "!=": _compared(operator.ne),
    "sincos": lambda x: [np.sin(x), np.cos(x)],
}


def results(kernel: Kernel, arrays: Mapping[str, Sequence[Any]]) -> list[Any]:
    """Results of a kernel, row by row; entries of its arguments may be arrays."""
    values: list[Any] = []
    stored = {}
    for kind, arguments, detail in kernel.operations:
        given = [values[number] for number in arguments]
        match kind:
            case "number":
                found: Any = np.float64(detail)
            case "entry":
                found = arrays[detail[0]][detail[1]]
            case "store":
                found = stored[detail] = given[0]
            case "part":
                found = given[0][detail]
            case "sums":
                array, first, targets = detail
                rows = np.array(arrays[array][first : first + len(given) * padded(targets)])
                rows = rows.reshape(len(given), padded(targets), *rows.shape[1:])
                found = [
                    sum(w * f for w, f in zip(rows[:, k], given, strict=True))
                    for k in range(targets)
                ]
            case "batch" if detail == "sincos":
                found = [f(value) for f in (np.sin, np.cos) for value in given]
            case "batch":
                found = [np.arctan(value) for value in given]
            case _:
                found = FUNCTIONS[kind](*given)
        values.append(found)
    return [stored[place] for place in sorted(stored)]


def value(kernel: Kernel, *arrays: np.ndarray) -> np.ndarray:
    """Results of a kernel at its arguments, the result excepted."""
    return np.array(results(kernel, dict(zip(kernel.arguments, arrays, strict=False))))


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


def products(sensitivity: Any, arrays: Sequence[np.ndarray], seeds: np.ndarray) -> np.ndarray:
    """What a `Sensitivity` gives along all seeds at once, without machine code.

    To compile the longest takes a quarter of a minute.
    """
    kernel = sensitivity.kernel
    given = dict(zip(kernel.arguments, [*arrays, seeds.T], strict=False))
    found = [np.broadcast_to(result, len(seeds)) for result in results(kernel, given)]
    return np.column_stack(found)
