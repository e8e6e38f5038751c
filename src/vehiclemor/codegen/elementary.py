"""Elementary functions without branches and calls, written as operations of a value.

A kernel spends most of its time in trigonometric functions when each is a call of the C library.
Here a batch of them becomes vector code, both functions of an angle share one argument reduction,
and results do not depend on the version of the C library.

Approximations: S. L. Moshier, Methods and Programs for Mathematical Functions (Ellis Horwood,
1989), the Cephes library.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from vehiclemor.codegen.operations import Listing, Operation, Value

# Cody-Waite splitting of pi/2.
HALF_PI_1 = 1.57079625129699707031
HALF_PI_2 = 7.54978941586159635335e-8
HALF_PI_3 = 5.39030285815811843e-15
TWO_OVER_PI = 0.63661977236758134308

TAN_3_PI_8 = 2.41421356237309504880
HALF_PI = 1.57079632679489661923
QUARTER_PI = 0.785398163397448309616
# What the double nearest to pi/2 leaves out.
REST_OF_HALF_PI = 6.123233995736765886130e-17

# Cody-Waite splitting of log 2.
ONE_OVER_LOG_2 = 1.44269504088896340736
LOG_2_1 = 6.93145751953125e-1
LOG_2_2 = 1.42860682030941723212e-6
# Beyond these the exponential function is infinite or zero.
LARGEST = 710.0
SMALLEST = -746.0


def sincos(angle: Value) -> list[Value]:
    """Sine and cosine of an angle in rad; within 2e-16 for |angle| < 1e4.

    Not a number where the angle is not finite.
    """
    quadrant = np.floor(angle * TWO_OVER_PI + 0.5)
    y = ((angle - quadrant * HALF_PI_1) - quadrant * HALF_PI_2) - quadrant * HALF_PI_3
    z = y * y
    zz = z * z
    # Minimax polynomials on [-pi/4, pi/4]; pairs of coefficients (Estrin's scheme) shorten the
    # chain of dependent operations.
    s = -2.50507477628578072866e-8 + z * 1.58962301576546568060e-10
    s = (-1.98412698295895385996e-4 + z * 2.75573136213857245213e-6) + zz * s
    s = (-1.66666666666666307295e-1 + z * 8.33333333332211858878e-3) + zz * s
    s = y + (y * z) * s
    c = 2.08757008419747316778e-9 - z * 1.13585365213876817300e-11
    c = (2.48015872888517045348e-5 - z * 2.75573141792967388112e-7) + zz * c
    c = (4.16666666666665929218e-2 - z * 1.38888888888730564116e-3) + zz * c
    c = (1.0 - 0.5 * z) + zz * c
    half = quadrant * 0.5
    odd = np.not_equal(half, np.floor(half))
    quarter = np.floor(half) * 0.5
    minus_sine = np.not_equal(quarter, np.floor(quarter))
    quarter = np.floor((quadrant + 1.0) * 0.5) * 0.5
    minus_cosine = np.not_equal(quarter, np.floor(quarter))
    sine, cosine = select(odd, c, s), select(odd, s, c)
    return [select(minus_sine, -sine, sine), select(minus_cosine, -cosine, cosine)]


def atan(x: Value) -> list[Value]:
    """Arctangent in rad, within 2.3e-16 relative; not a number where x is none."""
    size = abs(x)
    large, middle = size > TAN_3_PI_8, size > 0.66
    # Two reductions of the argument.
    above = select(large, -1.0, select(middle, size - 1.0, size))
    below = select(large, size, select(middle, size + 1.0, 1.0))
    offset = select(large, HALF_PI, select(middle, QUARTER_PI, 0.0))
    rest = select(large, REST_OF_HALF_PI, select(middle, 0.5 * REST_OF_HALF_PI, 0.0))
    y = above / below
    z = y * y
    # Rational approximation on [-0.66, 0.66].
    p = -1.615753718733365076637e1 + z * -8.750608600031904122785e-1
    p = -7.500855792314704667340e1 + z * p
    p = -1.228866684490136173410e2 + z * p
    p = -6.485021904942025371773e1 + z * p
    q = 2.485846490142306297962e1 + z
    q = 1.650270098316988542046e2 + z * q
    q = 4.328810604912902668951e2 + z * q
    q = 4.853903996359136964868e2 + z * q
    q = 1.945506571482613964425e2 + z * q
    value = offset + (y + (y * (z * p / q) + rest))
    return [select(x < 0.0, -value, value)]


def exp(x: Value) -> list[Value]:
    """Exponential function, within 2.5e-16 relative; not a number where x is none."""
    x = select(x > LARGEST, LARGEST, x)
    x = select(x < SMALLEST, SMALLEST, x)
    power = np.floor(x * ONE_OVER_LOG_2 + 0.5)
    y = (x - power * LOG_2_1) - power * LOG_2_2
    z = y * y
    p = 3.02994407707441961300e-2 + z * 1.26177193074810590878e-4
    p = y * (9.99999999999999999910e-1 + z * p)
    q = 2.52448340349684104192e-3 + z * 3.00198505138664455042e-6
    q = 2.00000000000000000005 + z * (2.27265548208155028766e-1 + z * q)
    y = 1.0 + 2.0 * (p / (q - p))
    # In two factors, so that neither overflows where the result does not.
    half = np.floor(0.5 * power)
    part = y * x.listing.new("power_of_two", half)
    return [part * x.listing.new("power_of_two", power - half)]


def select(test: Value, then: Value | float, other: Value | float) -> Value:
    """One value or the other."""
    return test.listing.new("select", test, then, other)


ELEMENTARY: dict[str, Callable[[Value], list[Value]]] = {"sincos": sincos, "atan": atan, "exp": exp}


@cache
def elementary_operations(name: str) -> tuple[list[Operation], list[int]]:
    """Operations of a function, its argument the first one; numbers of its results."""
    listing = Listing()
    results = ELEMENTARY[name](listing.entry("", 0))
    return listing.operations, [result.number for result in results]
