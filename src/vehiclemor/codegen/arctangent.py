"""Arctangent without branches, so that a loop over arguments becomes vector code."""

import numpy as np

# Rational approximation on [-0.66, 0.66] with two reductions of the argument: S. L. Moshier,
# Methods and Programs for Mathematical Functions (Ellis Horwood, 1989), Cephes library, atan.c.
TAN_3_PI_8 = 2.41421356237309504880
HALF_PI = 1.57079632679489661923
QUARTER_PI = 0.785398163397448309616
# What the double nearest to pi/2 leaves out.
REST_OF_HALF_PI = 6.123233995736765886130e-17


def atan(x):
    """Arctangent in rad, within 2.3e-16 relative.

    Parameters
    ----------
    x : float

    Returns
    -------
    float
        Not a number where x is none.
    """
    size = np.abs(x)
    large = size > TAN_3_PI_8
    middle = size > 0.66
    above = size - 1.0 if middle else size
    above = -1.0 if large else above
    below = size + 1.0 if middle else 1.0
    below = size if large else below
    offset = QUARTER_PI if middle else 0.0
    offset = HALF_PI if large else offset
    rest = 0.5 * REST_OF_HALF_PI if middle else 0.0
    rest = REST_OF_HALF_PI if large else rest
    y = above / below
    z = y * y
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
    return -value if x < 0.0 else value
