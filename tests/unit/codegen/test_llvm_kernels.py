"""Machine code written from a kernel's operations computes what they say."""

from functools import reduce

import numpy as np
import pytest
import sympy as sp

from tests.unit.kernels import kernel
from tests.unit.programs import precise, run
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.lowering import kernels_of
from vehiclemor.codegen.operations import Kernel, padded
from vehiclemor.symbolic.program import Program, assemble
from vehiclemor.symbolic.tape import Tape

x, y, p = sp.symbols("x y p", real=True)


def compiled(made: Kernel):
    """A function of arrays."""
    return lambda *arrays: Kernels([made]).call(made.name, *arrays)


def result_of(program: Program, values: dict[sp.Symbol, float]) -> np.ndarray:
    kernels = Kernels(kernels_of(program).values())
    constants = np.full(len(program.constants.results), np.nan)
    kernels.call("constants", np.array([values[s] for s in program.parameters]), constants)
    arguments = [np.array([values[s] for s in symbols]) for symbols in program.arguments.values()]
    result = np.full(program.functions["f"].shape, np.nan)
    kernels.call("f", *arguments, constants, result)
    return result


def test_operations_as_deep_as_files_may_have_them():
    def deep(x, result):
        (result[0],) = x.sums(1, 1, [reduce(lambda a, _: a * 1.001 + x[0], range(5000), x[0])])

    x, result = np.array([0.5, 2.0, 0.0, 0.0, 0.0]), np.empty(1)
    compiled(kernel(deep))(x, result)
    expected = reduce(lambda a, _: a * 1.001 + 0.5, range(5000), 0.5)
    np.testing.assert_allclose(result, 2.0 * expected, rtol=1e-12)


def test_functions_and_powers_keep_their_values():
    expressions = [
        sp.sqrt(x), sp.exp(-x), sp.Abs(x - y), sp.tan(x), sp.asin(x / 7), sp.acos(x / 7),
        sp.atan2(x - 2, y), sp.sinh(x), sp.cosh(x), sp.tanh(x), sp.log(x), x**7, -x, 1 / x**3,
        x ** sp.Rational(3, 2), x + p, sp.Float(2.5), sp.Integer(-3),
        sp.pi * y / x + sp.E, -y / (x + y),
        y / sp.sqrt(x), (x * y) ** -2, -(x**2) + y, x**3 - x**4 * y, 3 * x - 3 * y,
        sp.Rational(1, 3) * x - sp.Rational(1, 2) * y, sp.Float(0.12345678901234567) * x,
        sp.atan2(-x, y) + sp.asin(x / 7), sp.exp(-x) * y, -3 * x / (x + y) ** 2, x**2 / y**3,
    ]  # fmt: skip
    values = {x: 1.7, y: 2.3, p: 0.6}
    program = assemble(Tape(), {"q": [x, y]}, [p], {"f": (expressions, (31, 1))})
    expected = precise(expressions, values)
    np.testing.assert_allclose(run(program, "f", values).ravel(), expected, rtol=1e-14)
    found = result_of(program, values)
    assert found.shape == (31, 1)
    np.testing.assert_allclose(found.ravel(), expected, rtol=1e-14)


def test_arrays_of_another_kind_are_refused():
    def first(x, result):
        result[0] = x[0]

    run_first, result = compiled(kernel(first)), np.empty(1)
    for wrong in (np.arange(6.0)[::2], np.arange(3), np.zeros((2, 2)), np.zeros(2, np.float32)):
        with pytest.raises(TypeError, match="first: x must be a C-contiguous array of at least 1"):
            run_first(wrong, result)
    result.flags.writeable = False
    for wrong in (np.empty((1, 1)), np.empty(0), result):
        with pytest.raises(TypeError, match="first: result must be a C-contiguous"):
            run_first(np.zeros(2), wrong)


@pytest.mark.parametrize("targets", [1, 4, 5, 11])
def test_weighted_sums_are_products_with_the_coefficients(targets, rng):
    width, terms, first = padded(targets), 9, 3

    def sums(x, constants, result):
        for i, one in enumerate(constants.sums(first, targets, [x[j] for j in range(terms)])):
            result[i] = one

    run_sums = compiled(kernel(sums))
    x, c = rng.normal(size=terms), rng.normal(size=(terms, width))
    result = np.empty(targets)
    run_sums(x, np.concatenate([np.full(first, np.nan), c.ravel()]), result)
    np.testing.assert_allclose(result, x @ c[:, :targets], rtol=1e-13, atol=1e-14)
    # All that the vectors load must be there.
    with pytest.raises(TypeError, match="sums: constants must be"):
        run_sums(x, np.zeros(first + terms * width - 1), result)
