"""Directional derivatives of kernels against the complex step, one by one and as linear maps."""

import numpy as np
import pytest

from tests.oracles import complex_step
from tests.unit.kernels import batch, function, kernel, sincos
from vehiclemor.codegen.derivatives import derivative, jacobian_product


def everything(x, u, constants, result):
    """All that kernels may do, at arguments away from their kinks."""
    a = x[0]
    b = -x[1] * constants[0] + 0.5 * a
    c = (a - b) * (a + 2.0) / (1.0 + b * b)
    d = function("sqrt", a * a + 1.0) - 1.0 / function("sqrt", c * c + 0.5)
    power = function("power", a * a + 1.0, a.listing.number(1.7))
    e = function("exp", -b) * function("log", 2.0 + a) + power
    sine, cosine = sincos(a * b)
    p, q, r = constants.sums(1, 3, (a * a, 3.0, b * c, sine, u[0]))
    f = function("select", function("<", c, b), a, b * c)
    g = function("atan2", a + 2.0, b) + function("asin", 0.3 * a) - function("acos", 0.2 * b)
    g = g + function("tan", 0.3 * c)
    h = function("sinh", a) * function("cosh", b) - function("tanh", c) + function("atan", a * c)
    result[0] = a + b - (c - d)
    result[1] = e * sine + cosine
    result[2] = p * q - r + u[0] * constants[2]
    result[3] = f + g * h
    result[4] = abs(c) * a + abs(-c) + abs(b)
    result[5] = 2.0
    result[6] = function("sin", a) * function("cos", b) - a / constants[0]


def batches(x, result):
    """Functions of several values at once."""
    both = x[0] * x[1]
    of_angles = batch("sincos", [both, x[0], x[1], *[0.0] * 5])
    angles = batch("atan", [x[1], both, *[0.0] * 6])
    result[0] = of_angles[0] * of_angles[9] + of_angles[2]
    result[1] = angles[0] * both - angles[1]


EVERYTHING, BATCHES = kernel(everything), kernel(batches)
X = np.array([0.7, -0.4])
U = np.array([0.3])
WEIGHTS = np.linspace(-1.0, 1.3, 21)


@pytest.mark.parametrize(("argument", "place"), [("_x", 0), ("_u", 1)])
def test_every_function_has_its_derivative(argument, place):
    arrays = (X, U, WEIGHTS)
    expected = complex_step.jacobian(EVERYTHING, arrays, place)
    found = jacobian_product(EVERYTHING, argument, 7, len(arrays[place])).jacobian(arrays)
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-15)


def test_functions_in_batches_too():
    expected = complex_step.jacobian(BATCHES, (X,), 0)
    found = jacobian_product(BATCHES, "_x", 2, 2).jacobian((X,))
    np.testing.assert_allclose(found, expected, rtol=1e-13)


@pytest.mark.parametrize(
    ("norm", "at", "slopes"),
    [
        # At a kink the derivative towards larger arguments.
        (lambda x: abs(x[0]) + x[1], (-1.0, 0.0), (-1.0, 1.0)),
        (lambda x: abs(x[0]) + x[1], (0.0, 0.0), (1.0, 1.0)),
        # Of a norm that is zero that between its slopes.
        (lambda x: function("sqrt", x[0] * x[0] + x[1] * x[1]), (0.0, 0.0), (0.0, 0.0)),
        (lambda x: function("sqrt", x[0] * x[0] + x[1] * x[1]), (3.0, -4.0), (0.6, -0.8)),
    ],
)
def test_kinks(norm, at, slopes):
    def k(x, result):
        result[0] = norm(x)

    found = jacobian_product(kernel(k), "_x", 1, 2).jacobian((np.array(at),))
    np.testing.assert_allclose(found, [slopes], rtol=1e-15)


def test_what_has_no_derivative_is_refused():
    def two(x, result):
        result[0] = function("power_of_two", x[0])

    def power(x, result):
        result[0] = function("power", x[0].listing.number(2.0), x[0])

    def combine(x, result):
        x[0].listing.new("combine", 1.0, detail=(("_result", 0), 4, ("_x", 0)))

    for body, named in ((two, "power_of_two"), (power, "exponent"), (combine, "combine")):
        with pytest.raises(ValueError, match=named):
            derivative(kernel(body), ("_x",))
    with pytest.raises(ValueError, match="weights"):
        derivative(EVERYTHING, ("_constants",))
    with pytest.raises(ValueError, match="no argument _z"):
        derivative(EVERYTHING, ("_z",))
