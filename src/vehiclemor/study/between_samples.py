"""Peaks and crossings of a sampled history between its samples, and how they move with it.

A polynomial goes through the seven samples about a place.  What is found is thus a function of the
samples alone, and its derivatives by them are exact.
"""

from typing import Any, NamedTuple

import numpy as np

from vehiclemor.errors import InputError

# Samples that a polynomial goes through.
POINTS = 7


class Found(NamedTuple):
    """A place between samples.

    Attributes
    ----------
    time
        In s.
    value, slope
        Of the history there; the slope is per second.
    weights
        Derivatives (samples,) of the value, at that time, by the samples.
    """

    time: float
    value: float
    slope: float
    weights: np.ndarray


def highest(time: np.ndarray, y: np.ndarray) -> Found:
    """Highest place of a history (samples,) at times (samples,), equal or not equal apart.

    By the envelope theorem the height moves as the history does there.
    """
    polynomial = _about(time, y, int(y.argmax()))
    slopes = np.polynomial.polynomial.polyder(polynomial.coefficients)
    roots = np.polynomial.polynomial.polyroots(slopes)
    real = roots.real[np.abs(roots.imag) <= 1e-9 * (1.0 + np.abs(roots.real))]
    # Between the neighbours of the highest sample, which is one of the candidates itself.
    low, high = polynomial.near
    candidates = [0.0, *real[(real > low) & (real < high)].tolist()]
    return max((polynomial.at(place) for place in candidates), key=lambda found: found.value)


def crossing(time: np.ndarray, y: np.ndarray, sample: int) -> Found:
    """Where a history is zero between a sample and the next, of which one is not above zero."""
    from scipy.optimize import brentq

    polynomial = _about(time, y, sample)
    end = polynomial.near[1]
    place: Any = brentq(lambda z: polynomial.at(z).value, 0.0, end, xtol=1e-14)
    return polynomial.at(float(place))


class _Polynomial(NamedTuple):
    """Polynomial through some samples in parts of their spacing.

    Attributes
    ----------
    time, unit
        Times (samples,) in s, and their spacing.
    first
        Number of the first sample.
    origin
        Time in s of the sample that is asked for, which is at place zero.
    near
        Places of its neighbours.
    powers
        Matrix (points, points) that makes coefficients of samples.
    coefficients
        Lowest power first.
    """

    time: np.ndarray
    unit: float
    first: int
    origin: float
    near: tuple[float, float]
    powers: np.ndarray
    coefficients: np.ndarray

    def at(self, place: float) -> Found:
        """What is at a place."""
        orders = np.arange(POINTS)
        row = place**orders
        rates = orders[1:] * place ** orders[:-1]
        weights = np.zeros(len(self.time))
        weights[self.first : self.first + POINTS] = row @ self.powers
        return Found(
            self.origin + place * self.unit,
            float(row @ self.coefficients),
            float(rates @ self.coefficients[1:]) / self.unit,
            weights,
        )


def _about(time: np.ndarray, y: np.ndarray, sample: int) -> _Polynomial:
    if len(time) < POINTS:
        raise InputError(f"{len(time)} samples are too few: {POINTS} are needed")
    first = min(max(sample - POINTS // 2, 0), len(time) - POINTS)
    points = slice(first, first + POINTS)
    origin, unit = float(time[sample]), float(time[points][-1] - time[points][0]) / (POINTS - 1)
    places = (time[points] - origin) / unit
    powers = np.linalg.inv(places[:, None] ** np.arange(POINTS))
    low, high = time[max(sample - 1, 0)], time[min(sample + 1, len(time) - 1)]
    near = float((low - origin) / unit), float((high - origin) / unit)
    return _Polynomial(time, unit, first, origin, near, powers, powers @ y[points])
