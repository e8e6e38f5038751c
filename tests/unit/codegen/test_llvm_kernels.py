"""Machine code written from a kernel's text computes what the text says."""

import ctypes
import math

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from llvmlite import ir

from tests.unit.programs import precise, run
from vehiclemor.codegen.kernel_text import kernel_source
from vehiclemor.codegen.kernels import Kernels, kernel_sources
from vehiclemor.codegen.llvm_kernels import Rows, emit
from vehiclemor.codegen.operations import Kernel
from vehiclemor.codegen.weighted_sums import padded
from vehiclemor.symbolic.program import Program, assemble
from vehiclemor.symbolic.tape import Tape

x, y, p = sp.symbols("x y p", real=True)


def compiled(text: str):
    """A function of arrays from the text of one kernel."""
    kernels = Kernels(kernel_sources(text))
    (name,) = kernels.sources
    return lambda *arrays: kernels.call(name, *arrays)


def result_of(program: Program, values: dict[sp.Symbol, float]) -> np.ndarray:
    kernels = Kernels(kernel_sources(kernel_source(program)))
    constants = np.full(len(program.constant_symbols), np.nan)
    kernels.call("constants", np.array([values[s] for s in program.parameters]), constants)
    arguments = [np.array([values[s] for s in symbols]) for symbols in program.arguments.values()]
    result = np.full(program.functions["f"].shape, np.nan)
    kernels.call("f", *arguments, constants, result)
    return result


OPERATIONS = (
    "{a} * {b} - {c}",
    "-{a} + 0.5 * {b}",
    "{a} / (2.0 + abs({b}))",
    "math.sqrt(1.0 + {a} * {a})",
    "math.exp(-abs({a}))",
    "atan({a})",
    "math.atan2({a}, 3.0 + {b} * {b})",
)


def random_text(seed: int, length: int = 60) -> str:
    rng = np.random.default_rng(seed)
    names, lines = ["_x[0]", "_x[1]", "_x[2]"], []
    for number in range(length):
        a, b, c = (names[int(k)] for k in rng.integers(len(names), size=3))
        if rng.integers(8) == 0:
            lines.append(f"s{number}, v{number} = sincos_one({a})")
        else:
            operation = OPERATIONS[int(rng.integers(len(OPERATIONS)))]
            lines.append(f"v{number} = {operation.format(a=a, b=b, c=c)}")
        names.append(f"v{number}")
    lines += [f"_result[{k}] = {name}" for k, name in enumerate(names[3:])]
    return "\n    ".join(["def random(_x, _result):", *lines]) + "\n"


@settings(max_examples=3, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1), st.lists(st.floats(-2, 2), min_size=3, max_size=3))
def test_random_programs_equal_plain_python(seed, numbers):
    text = random_text(seed)
    plain = {
        "math": math,
        "atan": math.atan,
        "sincos_one": lambda angle: (math.sin(angle), math.cos(angle)),
    }
    exec(text, plain)  # noqa: S102
    found, expected = np.full(60, np.nan), np.full(60, np.nan)
    plain["random"](np.array(numbers), expected)
    compiled(text)(np.array(numbers), found)
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-13)


def test_functions_and_powers_of_both_printers_keep_their_values():
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


@pytest.mark.parametrize("count", [2, 3, 8, 11])
@pytest.mark.parametrize("function", [sp.sin, sp.atan])
def test_batches_with_and_without_padding(count, function):
    symbols = sp.symbols(f"a:{count}", real=True)
    results = [function(s) + p for s in symbols]
    program = assemble(Tape(), {"q": symbols}, [p], {"f": (results, (count,))})
    values = dict(zip(symbols, np.linspace(-40.0, 55.0, count), strict=True)) | {p: 0.25}
    expected = run(program, "f", values)
    np.testing.assert_allclose(result_of(program, values), expected, rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize(
    "line",
    [
        "a = _x[0] % 2.0",
        "a = unknown",
        "a = [_x[0]]",
        "a = math.gamma(_x[0])",
        "a = math.sqrt(_x[0], 1.0)",
        "a = _x[i]",
        "a = _x[0, 0]",
        "a = _x[0] if 1 else 2.0",
        "a = _work[3]",
        "a = b = 1.0",
        "a += 1.0",
        "a, b = atan(_x[0])",
        "for i in range(3): pass",
        "return _x[0]",
        "exp_batch(_work, 0)",
        "_result[0, 0] = 1.0",
        "_other[0] = 1.0",
    ],
)
def test_what_is_not_straight_line_is_refused(line):
    text = f"def odd(_x, _work, _result):\n    {line}\n    _result[0] = 1.0\n"
    kind = ir.FunctionType(ir.VoidType(), [ir.DoubleType().as_pointer()] * 2)
    function = ir.Function(ir.Module(), kind, "odd")
    rows = {name: Rows(given) for name, given in zip(("_x", "_result"), function.args, strict=True)}
    builder = ir.IRBuilder(function.append_basic_block())
    with pytest.raises(ValueError, match=r"straight-line|unknown|index|shape"):
        emit(Kernel(text), builder, rows)


def test_arrays_of_another_kind_are_refused():
    kernel = compiled("def first(_x, _result):\n    _result[0] = _x[0]\n")
    result = np.empty(1)
    for wrong in (np.arange(6.0)[::2], np.arange(3), np.zeros((2, 2)), np.zeros(2, np.float32)):
        with pytest.raises(TypeError, match="first: x must be a C-contiguous array of at least 1"):
            kernel(wrong, result)
    result.flags.writeable = False
    for wrong in (np.empty((1, 1)), np.empty(0), result):
        with pytest.raises(TypeError, match="first: result must be a C-contiguous"):
            kernel(np.zeros(2), wrong)


@pytest.mark.parametrize("targets", [1, 4, 5, 11])
def test_weighted_sums_are_products_with_the_coefficients(targets, rng):
    width, terms, first = padded(targets), 9, 3
    names = ", ".join(f"s{i}" for i in range(targets))
    factors = ", ".join(f"_x[{j}]" for j in range(terms))
    lines = [f"({names},) = weighted_sums(_constants, {first}, ({factors},))"]
    lines += [f"_result[{i}] = s{i}" for i in range(targets)]
    kernel = compiled("def sums(_x, _constants, _result):\n    " + "\n    ".join(lines) + "\n")
    x, c = rng.normal(size=terms), rng.normal(size=(terms, width))
    result = np.empty(targets)
    kernel(x, np.concatenate([np.full(first, np.nan), c.ravel()]), result)
    np.testing.assert_allclose(result, x @ c[:, :targets], rtol=1e-13, atol=1e-14)
    # All that the vectors load must be there.
    with pytest.raises(TypeError, match="sums: constants must be"):
        kernel(x, np.zeros(first + terms * width - 1), result)


# Statements on whole vectors


def stepped(lines: str, size: int, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    result = np.full(size + 1, 7.0)
    compiled(f"def step(_x, _u, _result):\n    {lines}\n")(x, u, result)
    assert result[-1] == 7.0
    return result[:-1]


@pytest.mark.parametrize("n", [1, 4, 7])
def test_vectors_are_combined_and_magnitudes_added(n, rng):
    x, u = rng.normal(size=3 * n), rng.normal(size=1)
    lines = f"combine(_result[0], {n}, 2.0, _x[0], _u[0], _x[{n}], -0.5, _x[{2 * n}])"
    a, b, c = x.reshape(3, n)
    np.testing.assert_allclose(stepped(lines, n, x, u), 2.0 * a + u * b - 0.5 * c, rtol=1e-14)
    found = stepped(f"magnitudes(_result[0], {n}, _x[0], _x[{n}])", n, x, x)
    np.testing.assert_array_equal(found, np.abs(a) + np.abs(b))


@pytest.mark.parametrize(
    ("n", "columns"), [(4, ()), (8, (5,)), (8, (0, 2, 7)), (28, range(0, 28, 2))]
)
def test_a_product_takes_some_columns_and_keeps_other_places(n, columns, rng):
    rows, x = rng.normal(size=(len(columns), n)), rng.normal(size=n)
    kept = tuple(i for i in range(n) if i not in columns)
    lines = f"product(_result[0], {n}, _u[0], _x[0], {tuple(columns)}, {kept}, 0.25)"
    expected = x[list(columns)] @ rows
    expected[list(kept)] += 0.25 * x[list(kept)]
    np.testing.assert_allclose(stepped(lines, n, x, np.append(rows, 0.0)), expected, atol=1e-13)


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
