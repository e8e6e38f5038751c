"""Excitations: inputs u(t) that drive a model over a fixed duration, as piecewise polynomials."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Hashable
from dataclasses import replace
from functools import cache, cached_property, lru_cache, wraps
from typing import Any, NamedTuple, Self, TypeVar

import numpy as np

from vehiclemor.arguments import loop_array, number, quoted, real_array, within
from vehiclemor.codegen.loops import Loop, Ready, loops, ready
from vehiclemor.exceptions import InputError
from vehiclemor.inputs.polynomial_loops import Pieces
from vehiclemor.short_repr import ShortRepr

# Bounds far beyond anything that is meant.  A maneuver that is a thousand times slower does not
# begin within its run, one that is a thousand times faster is over between two output times.
FACTORS = {"frequency": (1e-3, 1e3), "amplitude": (-1e6, 1e6)}
LONGEST_DURATION = 1e5
MOST_SAMPLES = 10_000_000

Result = TypeVar("Result")


def cached(compute: Callable[..., Result]) -> Callable[..., Result]:
    """A function of an excitation that computes each result once, see `Excitation.results`."""

    @wraps(compute)
    def result(excitation: Excitation, *arguments: Hashable) -> Result:
        key = compute, *arguments
        if key not in excitation.results:
            excitation.results[key] = compute(excitation, *arguments)
        return excitation.results[key]

    return result


class Jumps(NamedTuple):
    """Times (jumps,) in s at which jumps begin, how long they last; by how much inputs change."""

    begins: np.ndarray
    lengths: np.ndarray
    sizes: np.ndarray


@lru_cache(maxsize=64)
def _equidistant(duration: float, samples: int) -> np.ndarray:
    times = np.linspace(0.0, duration, samples)
    times.flags.writeable = False
    return times


class Excitation(ShortRepr):
    """Inputs of a model over a fixed duration: a `Maneuver` of functions, a `Signal` of samples."""

    repr_fields = ("name", "inputs", "duration", "samples", "frequency_factor", "amplitude_factor")

    name: str
    summary: str
    inputs: tuple[str, ...]
    duration: float
    samples: int
    frequency_factor: float
    amplitude_factor: float

    @cached_property
    def results(self) -> dict[Any, Any]:
        """Results that are `cached`, by function and arguments."""
        return {}

    @property
    def times(self) -> np.ndarray:
        """Equidistant output times (samples,) in s, read-only."""
        return _equidistant(self.duration, self.samples)

    @property
    @abstractmethod
    def break_points(self) -> tuple[float, ...]:
        """Times in s inside the run at which the inputs are not smooth."""

    @property
    @abstractmethod
    def pieces(self) -> Pieces:
        """Inputs as piecewise polynomials; `InputError` if they have none."""

    @abstractmethod
    def at(self, times: np.ndarray) -> np.ndarray:
        """Inputs (n, number of inputs) at times (n,) in s."""

    @abstractmethod
    def perturbed(self, frequency: float = 1.0, amplitude: float = 1.0) -> Self:
        """The excitation with its factors set; `InputError` if one is out of its bounds."""

    @abstractmethod
    def for_inputs(self, names: tuple[str, ...], defaults: tuple[float, ...] = ()) -> Self:
        """The excitation of a model with these inputs, those that it lacks at their defaults.

        Defaults are 0 by default.  An excitation that gives further inputs is returned as it is.
        """

    def subdivided(self, parts: int) -> Self:
        """The same inputs, each interval between output times divided into so many parts."""
        return replace(self, samples=(self.samples - 1) * parts + 1)  # type: ignore[type-var]

    @property
    @cached
    def packed_pieces(self) -> Ready:
        """The pieces as an argument of compiled loops."""
        return ready(self.pieces)

    @property
    @cached
    def recorded_inputs(self) -> tuple[np.ndarray, np.ndarray]:
        """Output times (samples,) in s and inputs (samples, inputs) at these, read-only."""
        inputs = self._at_output_times()
        inputs.flags.writeable = False
        return self.times, inputs

    @abstractmethod
    def _at_output_times(self) -> np.ndarray:
        """Inputs (samples, inputs) at the output times."""

    @property
    @cached
    def jumps(self) -> Jumps:
        """Jumps of the inputs inside the run."""
        edges, first, _, coefficients = self.pieces
        after = first[1:-1]
        sizes = coefficients[after, 0] - coefficients[after - 1].sum(axis=1)
        return Jumps(edges[1:-1], np.zeros(len(after)), sizes)

    def extent(self, limits: np.ndarray) -> np.ndarray:
        """Smallest and largest inputs, also between output times, and when limits are passed.

        Times are in s, infinite of inputs that stay within their limits (2, inputs).
        """
        result = np.empty((3, self.pieces.coefficients.shape[2]))
        polynomial_loops()["extent"](self.packed_pieces, loop_array(limits), result)
        return result


@cache
def polynomial_loops() -> dict[str, Loop]:
    """Compiled loops over pieces."""
    return loops(("inputs.polynomial_loops",), ("sampled", "extent"))


def values_at(pieces: Pieces, times: np.ndarray) -> np.ndarray:
    """Values (n, inputs) at times (n,) in s; at a jump those after it, at the end before."""
    order = np.argsort(times)
    increasing = np.empty((len(times), pieces.coefficients.shape[2]))
    polynomial_loops()["sampled"](pieces, times[order], increasing)
    values = np.empty_like(increasing)
    values[order] = increasing
    return values


def checked_times(times: Any) -> np.ndarray:
    """Finite times (n,) in s, or `InputError`."""
    try:
        array = real_array(times)
    except (TypeError, ValueError):
        array = np.array(np.nan)
    if array.ndim != 1 or not np.isfinite(array).all():
        raise InputError(f"times are {quoted(times)}, not a list of finite times in s")
    return array


def checked_factor(name: str, value: object) -> float:
    """A factor on the frequency or amplitude; `InputError` if it is none, or out of bounds."""
    return within(f"{name} factor", number(f"{name} factor", value), FACTORS[name])
