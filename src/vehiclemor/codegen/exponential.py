"""Exponential function without branches and calls: around a call all registers are saved."""

import math

import numpy as np

# Cody-Waite splitting of log 2 and a rational approximation: S. L. Moshier, Methods and Programs
# for Mathematical Functions (Ellis Horwood, 1989), the Cephes library's exp.c.
ONE_OVER_LOG_2 = 1.44269504088896340736
LOG_2_1 = 6.93145751953125e-1
LOG_2_2 = 1.42860682030941723212e-6
# Beyond these the result is infinite or zero.
LARGEST = 710.0
SMALLEST = -746.0


def exp(x: float) -> float:
    """Exponential function, within 2.5e-16 relative; not a number where x is none."""
    x = LARGEST if x > LARGEST else x
    x = SMALLEST if x < SMALLEST else x
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
    return (y * power_of_two(half)) * power_of_two(power - half)


def power_of_two(exponent: float) -> float:
    """Two to a whole number between -1022 and 1023; in machine code by the number's bits."""
    return math.ldexp(1.0, int(exponent)) if exponent == exponent else exponent
