"""Tangents of kernels against the complex step, lane by lane, and as linear maps."""

import numpy as np
import pytest

from tests.oracles import complex_step
from vehiclemor.codegen.kernels import KernelSource, kernel_sources
from vehiclemor.codegen.tangent import FEW, tangent
from vehiclemor.codegen.tangent_text import tangent_text
from vehiclemor.codegen.vector_lanes import DIRECTIONS

# All that texts of kernels may say, at arguments away from their kinks.
EVERYTHING = """def everything(_x, _u, _constants, _work, _result):
    a = _x[0]
    b = -_x[1]*_constants[0] + 0.5*a
    c = (a - b)*(a + 2.0)/(1.0 + b*b)
    d = math.sqrt(a*a + 1.0) - 1.0/math.sqrt(c*c + 0.5)
    e = math.exp(-b)*math.log(2.0 + a) + (a*a + 1.0)**1.7
    sine, cosine = sincos_one(a*b)
    (p, q, r) = weighted_sums(_constants, 1, (a*a, 3.0, b*c, sine, _u[0],))
    f = a if c < b else b*c
    g = math.atan2(a + 2.0, b) + math.asin(0.3*a) - math.acos(0.2*b) + math.tan(0.3*c)
    h = math.sinh(a)*math.cosh(b) - math.tanh(c) + math.atan(a*c) + atan(b)
    i = abs(c)*a + abs(-c) + math.fabs(b)
    _result[0] = a + b - (c - d)
    _result[1] = e*sine + cosine
    _result[2] = p*q - r + _u[0]*_constants[2]
    _result[3] = f + g*h
    _result[4] = i
    _result[5] = 2.0
    _result[6] = math.sin(a)*math.cos(b) - a/_constants[0]
"""
BATCHES = """def batches(_x, _work, _result):
    x0 = _x[0]*_x[1]
    _work[0] = x0
    _work[1] = _x[0]
    _work[2] = _x[1]
    {first}
    sincos_batch(_work, 0)
    _work[24] = _x[1]
    _work[25] = x0
    {second}
    atan_batch(_work, 24)
    sin_a = _work[8]
    cos_b = _work[17]
    _result[0] = sin_a*cos_b + _work[10]
    _result[1] = _work[32]*x0 - _work[33]
""".format(
    first="\n    ".join(f"_work[{k}] = 0.0" for k in range(3, 8)),
    second="\n    ".join(f"_work[{k}] = 0.0" for k in range(26, 32)),
)
X = np.array([0.7, -0.4])
U = np.array([0.3])
WEIGHTS = np.linspace(-1.0, 1.3, 21)


def _source(text: str) -> KernelSource:
    (source,) = kernel_sources(text).values()
    return source


@pytest.mark.parametrize(("argument", "place"), [("_x", 0), ("_u", 1)])
def test_every_function_has_its_derivative(argument, place):
    source, arrays = _source(EVERYTHING), (X, U, WEIGHTS)
    expected = complex_step.jacobian(source.text, arrays, place, 7)
    found = tangent(source, argument, 7, len(arrays[place])).jacobian(arrays)
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-15)


def test_functions_in_batches_too():
    source = _source(BATCHES)
    expected = complex_step.jacobian(source.text, (X,), 0, 2)
    np.testing.assert_allclose(tangent(source, "_x", 2, 2).jacobian((X,)), expected, rtol=1e-13)


def test_many_directions_are_each_what_one_is():
    found = tangent(_source(EVERYTHING), "_x", 7, 2)
    directions = np.random.default_rng(1).normal(size=(DIRECTIONS + FEW + 1, 2))
    together = found.columns((X, U, WEIGHTS), directions)
    one_by_one = [found.columns((X, U, WEIGHTS), row[None])[0] for row in directions]
    np.testing.assert_allclose(together, one_by_one, rtol=1e-14, atol=1e-15)
    # A tangent is linear in its direction.
    both = found.columns((X, U, WEIGHTS), (2.0 * directions[:1] - 3.0 * directions[1:2]))
    np.testing.assert_allclose(both[0], 2.0 * together[0] - 3.0 * together[1], rtol=1e-13)


def test_what_does_not_depend_on_the_argument_leaves_no_statement():
    text = tangent_text(EVERYTHING, ("_u",))
    assert "math.log" not in text
    assert "math.sinh" not in text
    assert "_result[0] = 0.0" in text
    assert tangent(_source(BATCHES), "_x", 2, 2).moving.tolist() == [0, 1]


@pytest.mark.parametrize(
    ("result", "at", "slopes"),
    [
        # At a kink the derivative towards larger arguments.
        ("abs(_x[0]) + _x[1]", (-1.0, 0.0), (-1.0, 1.0)),
        ("abs(_x[0]) + _x[1]", (0.0, 0.0), (1.0, 1.0)),
        # Of a norm that is zero that between its slopes.
        ("math.sqrt(_x[0]*_x[0] + _x[1]*_x[1])", (0.0, 0.0), (0.0, 0.0)),
        ("math.sqrt(_x[0]*_x[0] + _x[1]*_x[1])", (3.0, -4.0), (0.6, -0.8)),
    ],
)
def test_kinks(result, at, slopes):
    found = tangent(_source(f"def k(_x, _work, _result):\n    _result[0] = {result}\n"), "_x", 1, 2)
    np.testing.assert_allclose(found.jacobian((np.array(at),)), [slopes], rtol=1e-15)


def test_what_has_no_derivative_is_refused():
    for line, named in (("power_of_two(_x[0])", "power_of_two"), ("2.0**_x[0]", "exponent")):
        with pytest.raises(ValueError, match=named):
            tangent_text(f"def k(_x, _work, _result):\n    _result[0] = {line}\n", ("_x",))
    with pytest.raises(ValueError, match="weights"):
        tangent_text(EVERYTHING, ("_constants",))
