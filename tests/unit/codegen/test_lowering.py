"""Kernels compute what the expressions say, in exactly the counted operations."""

import numpy as np
import pytest
import sympy as sp

from tests.oracles import complex_step
from tests.oracles.kinematics import residual
from tests.unit.programs import run
from vehiclemor.codegen.lowering import kernels_of
from vehiclemor.codegen.operations import COUNTED
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
        (x - y, {"add": 1}),
        (-x * y, {"negate": 1, "multiply": 1}),
        (x**2, {"multiply": 1}),
        (x**4, {"multiply": 3}),
        (x**5, {"power": 1}),
        (x / y, {"divide": 1}),
        (1 / x**2, {"multiply": 1, "divide": 1}),
        (1 / sp.sqrt(x), {"sqrt": 1, "divide": 1}),
        (sp.sqrt(x * y), {"sqrt": 1, "multiply": 1}),
        (sp.sin(x) * sp.cos(x) + sp.atan2(x, y), {"trigonometric": 3, "multiply": 1, "add": 1}),
        (sp.Piecewise((x * y, x < y), (x, True)), {"multiply": 1}),
        (sp.Float(2.5) * x - 1, {"multiply": 1, "add": 1}),
    ],
    ids=str,
)
def test_operation_counts_of_expressions_counted_by_hand(expression, expected):
    counts = kernels_of(program_of(expression))["f"].counts
    assert counts == dict.fromkeys(COUNTED, 0) | expected | {"total": sum(expected.values())}


def test_each_angle_of_the_model_is_evaluated_once(model):
    for name in ("residual", "residual_jacobian", "newton_step"):
        assert model.operation_counts[name]["trigonometric"] == 2 * 7
    # The eighth pivot is the rack's, which is 1.
    assert model.operation_counts["newton_step"]["divide"] == 7
    assert model.operation_counts["residual_jacobian"]["divide"] == 0


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
        exact = complex_step.jacobian(kernel, (q, u, model.constants), 0)
        np.testing.assert_allclose(model.jacobian(q, u), exact, rtol=0, atol=2e-15)


def test_tangent_kernels_are_the_products_of_the_jacobian(model, rng):
    q, u = rng.uniform(-1.0, 1.0, 8), rng.uniform(-0.1, 0.1, 2)
    kernels = model.equations.kernels
    parts = np.full(kernels.sources["tangent_parts"].sizes[-1], np.nan)
    kernels.call("tangent_parts", q, u, model.constants, parts)
    np.testing.assert_allclose(parts[-8:], model.residual(q, u), atol=1e-15)
    for column in rng.standard_normal((5, 8)):
        result = np.full(8, np.nan)
        kernels.call("tangent", parts, column, result)
        np.testing.assert_allclose(result, model.jacobian(q, u) @ column, atol=1e-14)
    # What is always the same is not evaluated: fewer entries than the matrix has.
    assert len(parts) < 8 + np.count_nonzero(model.jacobian(q, u))


@pytest.mark.parametrize(
    ("result", "size", "named"),
    [(1, 2, "1"), (sp.nan, 1, "nan"), (sp.zoo, 1, "zoo"), (sp.I, 1, "I"), (y, 1, "y")],
)
def test_results_that_are_none_are_named(result, size, named):
    with pytest.raises(ValueError, match=rf"\b{named}\b"):
        assemble(Tape(), {"x": [x]}, [], {"f": ([result], (size,))})


@pytest.mark.parametrize(
    ("expression", "named"),
    [
        (sp.sin(x + y), "sin"),
        (sp.gamma(x), "gamma"),
        (sp.Max(x, y), "Max"),
        (sp.Piecewise((x, x < y), (y, x > 2 * y)), "x > 2"),
    ],
)
def test_what_kernels_cant_do_is_refused(expression, named):
    with pytest.raises(ValueError, match=named):
        kernels_of(program_of(expression))
