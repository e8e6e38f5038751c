"""Statements on whole vectors are what numpy computes."""

import ctypes

import numpy as np
import pytest

from vehiclemor.codegen.kernels import Kernels, kernel_sources

RNG = np.random.default_rng(5)


def run(lines: str, size: int, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    kernels = Kernels(kernel_sources(f"def step(_x, _u, _result):\n    {lines}\n"))
    result = np.full(size + 1, 7.0)
    kernels.call("step", x, u, result)
    assert result[-1] == 7.0
    return result[:-1]


@pytest.mark.parametrize("n", [1, 4, 7])
def test_vectors_are_combined_and_magnitudes_added(n):
    x, u = RNG.normal(size=3 * n), RNG.normal(size=1)
    lines = f"combine(_result[0], {n}, 2.0, _x[0], _u[0], _x[{n}], -0.5, _x[{2 * n}])"
    a, b, c = x.reshape(3, n)
    np.testing.assert_allclose(run(lines, n, x, u), 2.0 * a + u * b - 0.5 * c, rtol=1e-14)
    found = run(f"magnitudes(_result[0], {n}, _x[0], _x[{n}])", n, x, x)
    np.testing.assert_array_equal(found, np.abs(a) + np.abs(b))


@pytest.mark.parametrize(
    ("n", "columns"), [(4, ()), (8, (5,)), (8, (0, 2, 7)), (28, range(0, 28, 2))]
)
def test_a_product_takes_some_columns_and_keeps_other_places(n, columns):
    rows, x = RNG.normal(size=(len(columns), n)), RNG.normal(size=n)
    kept = tuple(i for i in range(n) if i not in columns)
    lines = f"product(_result[0], {n}, _u[0], _x[0], {tuple(columns)}, {kept}, 0.25)"
    expected = x[list(columns)] @ rows
    expected[list(kept)] += 0.25 * x[list(kept)]
    np.testing.assert_allclose(run(lines, n, x, np.append(rows, 0.0)), expected, atol=1e-13)


def test_a_kernel_executes_another_by_its_address():
    signature = ctypes.CFUNCTYPE(None, *[ctypes.POINTER(ctypes.c_double)] * 4)

    def body(x, u, constants, result):
        result[0] = x[0] + 10.0 * u[0] + 100.0 * constants[0]

    inner = signature(body)
    head = "def outer(_x, _u, _constants, _result, _kernels):"
    text = f"{head}\n    execute(_kernels[0], _x[1], _u[2], _constants[0], _result[1])\n"
    kernels = Kernels(kernel_sources(text))
    outer = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 5)(kernels.address("outer"))
    x, result = np.array([1.0, 2.0, 3.0]), np.zeros(3)
    addresses = np.array([ctypes.cast(inner, ctypes.c_void_p).value], dtype=np.int64)
    outer(*(array.ctypes.data for array in (x, x, x, result, addresses)))
    assert result.tolist() == [0.0, 2.0 + 30.0 + 100.0, 0.0]
