"""First-order systems whose right-hand side is Python: the compiled loops call back."""

import ctypes
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from vehiclemor.simulation.system import System

DOUBLES = ctypes.POINTER(ctypes.c_double)


class PythonKernels:
    """Stands for a system's kernels: of no text, which nothing can check."""

    sources: dict[str, Any] = {}  # noqa: RUF012 - never written

    def __init__(self, f: Callable[[np.ndarray, np.ndarray], Sequence], n: int, m: int) -> None:
        def derivative(x, u, constants, result):
            del constants
            values = f(np.ctypeslib.as_array(x, (n,)).copy(), np.ctypeslib.as_array(u, (m,)).copy())
            for k, value in enumerate(values):
                result[k] = value

        self._callback = ctypes.CFUNCTYPE(None, *[DOUBLES] * 4)(derivative)

    def call(self, name: str, *arrays: np.ndarray) -> None:
        assert name == "derivative"
        self._callback(*[array.ctypes.data_as(DOUBLES) for array in arrays])

    def __contains__(self, name: str) -> bool:
        return name in self.sources

    def address(self, name: str, lanes: int = 1, results: tuple[int, ...] = ()) -> int:
        assert (name, lanes, results) == ("derivative", 1, ())
        return ctypes.cast(self._callback, ctypes.c_void_p).value or 0


def python_system(f: Callable, reference: Sequence[float], inputs: int) -> System:
    """The system dx/dt = f(x, u) with its Jacobian frozen at the reference state."""
    n = len(reference)
    kernels: Any = PythonKernels(f, n, inputs)
    nothing = np.zeros(0, dtype=np.int64)
    return System(
        kernels, np.zeros(1), inputs, np.array(reference), np.ones(n), np.arange(n), nothing
    )
