"""Derivatives of whole runs by central differences, extrapolated to order 6."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np


def extrapolated(function: Callable[[float], np.ndarray], step: float) -> np.ndarray:
    """Derivative at zero of a smooth function of a number (L. F. Richardson, 1911)."""
    first = [(function(h) - function(-h)) / (2.0 * h) for h in (step, step / 2.0, step / 4.0)]
    second = [(4.0 * b - a) / 3.0 for a, b in pairwise(first)]
    return (16.0 * second[1] - second[0]) / 15.0
