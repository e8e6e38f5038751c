"""Kernels compute what expressions say, counted; they are compiled when they are first used."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp

from tests.oracles import complex_step
from tests.oracles.double_wishbone import residual
from tests.unit.kernels import kernel
from tests.unit.programs import run
from vehiclemor.codegen import cache
from vehiclemor.codegen import kernels as module
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.lowering import kernels_of
from vehiclemor.codegen.operations import COUNTED, Kernel
from vehiclemor.multibody.double_wishbone.definition import DEFINITION
from vehiclemor.symbolic.program import Program, assemble
from vehiclemor.symbolic.tape import Tape

x, y, p = sp.symbols("x y p", real=True)


@pytest.fixture(scope="module")
def program() -> Program:
    """The double wishbone's."""
    return DEFINITION.derive()


def program_of(expression: sp.Expr) -> Program:
    # The second result gives the program a constant.
    return assemble(Tape(), {"q": [x, y]}, [p], {"f": ([expression, p], (2,))})


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        (x * y + x, {"add": 1, "multiply": 1}),
        (x**2, {"multiply": 1}),
        (x**4, {"multiply": 3}),
        (x**5, {"power": 1}),
        (1 / x**2, {"multiply": 1, "divide": 1}),
        (sp.sqrt(x * y), {"sqrt": 1, "multiply": 1}),
        (sp.sin(x) * sp.cos(x) + sp.atan2(x, y), {"trigonometric": 3, "multiply": 1, "add": 1}),
        (sp.Piecewise((x * y, x < y), (x, True)), {"multiply": 1}),
    ],
    ids=str,
)
def test_operation_counts_of_expressions_counted_by_hand(expression, expected):
    counts = kernels_of(program_of(expression))["f"].counts
    assert counts == dict.fromkeys(COUNTED, 0) | expected | {"total": sum(expected.values())}


def test_kernels_are_the_specified_residual_and_its_derivatives(model, program, points, rng):
    names = program.arguments
    parameters = dict(zip(program.parameters, model.parameters.flat(), strict=True))
    kernel = model.equations.sources["residual"]
    for _ in range(20):
        q, u = rng.uniform(-1.5, 1.5, 8), rng.uniform(-0.3, 0.3, 2)
        expected = residual(points, q, u)
        np.testing.assert_allclose(model.residual(q, u), expected, rtol=0, atol=2e-15)
        values = dict(zip([*names["q"], *names["u"]], [*q, *u], strict=True)) | parameters
        np.testing.assert_allclose(run(program, "residual", values), expected, rtol=0, atol=2e-15)
        for place, by in enumerate(("state", "inputs")):
            exact = complex_step.jacobian(kernel, (q, u, model.constants), place)
            jacobian = model.jacobian(q, u, by, "residual")
            np.testing.assert_allclose(jacobian, exact, rtol=0, atol=2e-15)


@pytest.mark.parametrize(
    ("result", "size", "named"), [(1, 2, "1"), (sp.nan, 1, "nan"), (y, 1, "y")]
)
def test_results_that_are_none_are_named(result, size, named):
    with pytest.raises(ValueError, match=rf"\b{named}\b"):
        assemble(Tape(), {"x": [x]}, [], {"f": ([result], (size,))})


@pytest.mark.parametrize(
    ("expression", "named"),
    [
        (sp.sin(x + y), "sin"),
        (sp.gamma(x), "gamma"),
        (sp.sign(x), "sign"),
        (sp.Piecewise((x, x < y), (y, x > 2 * y)), "x > 2"),
    ],
)
def test_what_kernels_cant_do_is_refused(expression, named):
    with pytest.raises(ValueError, match=named):
        kernels_of(program_of(expression))


def times(factor: float) -> Kernel:
    def double(x, result):
        result[0] = factor * x[0]

    return kernel(double)


def product(x, u, constants, result):
    result[0, 0] = x[0] * u[1]
    result[0, 1] = constants[3]


DOUBLE, PRODUCT = times(2.0), kernel(product, columns=2)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("VEHICLEMOR_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "kernels"


def names(folder: Path) -> list[str]:
    return sorted(path.name.rpartition("-")[0] for path in folder.glob("*"))


def loaded(source) -> int:
    """As in a process of its own."""
    return module._machine.__wrapped__(source)[0]


def test_a_kernel_knows_what_it_wants_of_its_arrays():
    assert PRODUCT.arguments == ("_x", "_u", "_constants", "_result")
    assert PRODUCT.sizes == (1, 2, 4, 2)
    PRODUCT.check(1, 2, 4)
    with pytest.raises(ValueError, match="_u"):
        PRODUCT.check(1, 1)
    result = np.empty((1, 2))
    arrays = np.array([3.0]), np.array([0.0, 5.0]), np.array([0.0, 0.0, 0.0, 7.0])
    Kernels([PRODUCT]).call("product", *arrays, result)
    assert result.tolist() == [[15.0, 7.0]]


def test_another_operation_compiler_or_processor_is_another_file(folder, monkeypatch):
    loaded(DOUBLE)
    loaded(DOUBLE)
    assert names(folder) == ["double"]
    loaded(times(3.0))
    assert names(folder) == ["double"] * 2
    for number, function in enumerate(("source_digest", "compiler_identity"), 3):
        with monkeypatch.context() as patch:
            patch.setattr(module, function, lambda *_: "another")
            loaded(DOUBLE)
        assert names(folder) == ["double"] * number
    loaded(DOUBLE)
    assert len(names(folder)) == 4


def test_the_identity_of_the_compiler_names_versions_and_processor(monkeypatch):
    import llvmlite.binding as llvm

    identity, real = cache.compiler_identity.__wrapped__, cache.version
    before = identity()
    features = SimpleNamespace(flatten=lambda: "-avx2")
    changes = [(llvm, "get_host_cpu_name", lambda: "z80")]
    changes += [(llvm, "get_host_cpu_features", lambda: features)]
    changes += [
        (cache, "version", lambda n, p=package: "0.0.1" if n == p else real(n))
        for package in cache.COMPILER_PACKAGES
    ]
    for where, name, changed in changes:
        with monkeypatch.context() as patch:
            patch.setattr(where, name, changed)
            assert identity() != before
    assert identity() == before


def test_what_is_missing_has_no_address():
    kernels = Kernels([DOUBLE])
    assert "triple" not in kernels
    assert kernels.address("triple") == 0
    _, _, code = module._machine.__wrapped__(kernels.sources["double"])
    with pytest.raises(ImportError, match="triple"):
        code.address("triple")
