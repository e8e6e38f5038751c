"""Maneuvers: input time histories that studies scale in frequency and amplitude."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from itertools import islice
from typing import Any

import numpy as np

from vehiclemor.arguments import count, line_of_text, loop_array, number, quoted, real_array, within
from vehiclemor.exceptions import InputError, PlugInError, blamed
from vehiclemor.inputs.columns import listed
from vehiclemor.inputs.excitation import (
    FACTORS,
    LONGEST_DURATION,
    MOST_SAMPLES,
    Excitation,
    cached,
    checked_factor,
    checked_times,
)
from vehiclemor.inputs.polynomial_loops import Pieces
from vehiclemor.inputs.polynomials import fitted_pieces
from vehiclemor.multibody.quantities import integral_of
from vehiclemor.registry import component

MOST_CORNERS = 10_000
MOST_SEED = 999_999
# Maneuvers with cached results: more than the sampled runs of a protocol, over which all rows go.
CACHED = 512


@dataclass(frozen=True)
class Maneuver(Excitation):
    """Inputs u(t) as functions of time and of two factors.

    Attributes
    ----------
    name, summary
        Registered name and one line.
    signal
        (time (n,) in s, frequency factor, amplitude factor) -> inputs (n, number of inputs), SI.
    inputs
        Names of the inputs, equal to the model's.
    duration
        Length in s; it does not change with the factors.
    samples
        Number of equidistant output times, both ends included.
    corners
        Frequency factor -> times (s) at which the inputs are not smooth.
    frequency_factor, amplitude_factor
        Perturbation; 1 is the nominal maneuver.
    linear_in_amplitude
        Whether all inputs are proportional to the amplitude factor: then runs that differ in it
        alone share their polynomials.
    member
        Of a family, such as roads of other seeds: number -> maneuver, whose name is `NAME:NUMBER`.
    """

    name: str
    summary: str
    signal: Callable[[np.ndarray, float, float], np.ndarray]
    inputs: tuple[str, ...]
    duration: float
    samples: int
    corners: Callable[[float], tuple[float, ...]]
    frequency_factor: float = 1.0
    amplitude_factor: float = 1.0
    linear_in_amplitude: bool = False
    member: Callable[[int], Maneuver] | None = None

    def __post_init__(self) -> None:
        """Refuse what is no maneuver, so that its author reads one clear line."""
        for text in ("name", "summary"):
            line_of_text(f"{text} of a maneuver", getattr(self, text))
        functions = {"signal": self.signal, "corners": self.corners}
        if self.member is not None:
            functions["member"] = self.member
        for name, function in functions.items():
            if not callable(function):
                raise InputError(f"{self}: {name} is not a function")
        object.__setattr__(self, "inputs", listed(self.inputs, f"{self}: inputs"))
        if number(f"{self}: duration", self.duration) <= 0.0:
            raise InputError(f"{self}: duration is {self.duration:g} s, not positive")
        within(f"{self}: duration", self.duration, (0.0, LONGEST_DURATION), " s")
        count(f"{self}: samples", self.samples, most=MOST_SAMPLES)
        for name in FACTORS:
            factor = checked_factor(name, getattr(self, f"{name}_factor"))
            object.__setattr__(self, f"{name}_factor", factor)

    def __str__(self) -> str:
        return f"maneuver {self.name!r}"

    def __hash__(self) -> int:
        # Every cache of a run asks for it; what differs is mostly here.
        return hash((self.name, self.signal, self.frequency_factor, self.amplitude_factor))

    @cached_property
    def results(self) -> dict[Any, Any]:
        """Cached results, which equal maneuvers share."""
        return _results(self)

    @property
    def break_points(self) -> tuple[float, ...]:
        """Times in s inside the run at which the inputs are not smooth."""
        with blamed(f"{self}: corners", self.corners):
            corners = islice(self.corners(self.frequency_factor), MOST_CORNERS + 1)
            times = real_array([*corners] or np.zeros(0))
        if times.ndim != 1 or not np.isfinite(times).all():
            raise PlugInError(f"{self}: corners are {quoted(times)}, not a list of times in s")
        if len(times) > MOST_CORNERS:
            raise PlugInError(f"{self}: there are more than {MOST_CORNERS} corners")
        return tuple(times.tolist())

    def at(self, times: np.ndarray) -> np.ndarray:
        """Inputs (n, number of inputs) at times (n,) in s."""
        times = checked_times(times)
        with blamed(f"{self}: signal", self.signal):
            values = self.signal(times, self.frequency_factor, self.amplitude_factor)
            values = real_array(values)
        if values.shape != (*times.shape, len(self.inputs)):
            raise PlugInError(
                f"{self}: signal gives an array of shape {values.shape} at {times.size} times, "
                f"not ({times.size}, {len(self.inputs)}): one column for each input"
            )
        return values

    def for_inputs(self, names: tuple[str, ...], defaults: tuple[float, ...] = ()) -> Maneuver:
        """The maneuver with all inputs of a model; itself where it can't be completed.

        What it lacks is at its default, 0 by default; a derivative of what it gives is not.
        """
        lacking = [name for name in names if name not in self.inputs]
        derived = any(integral_of(name) in self.inputs for name in lacking)
        if self.inputs == names or derived or not {*self.inputs} <= {*names}:
            return self
        values = tuple(defaults) or (0.0,) * len(names)
        signal = _Completed(self.signal, tuple(map(names.index, self.inputs)), values)
        at_zero = not any(dict(zip(names, values, strict=True))[name] for name in lacking)
        linear = self.linear_in_amplitude and at_zero
        return replace(self, inputs=names, signal=signal, linear_in_amplitude=linear)

    def perturbed(self, frequency: float = 1.0, amplitude: float = 1.0) -> Maneuver:
        """The maneuver with its factors set; `InputError` if one is out of its bounds."""
        return replace(self, frequency_factor=frequency, amplitude_factor=amplitude)

    @property
    @cached
    def pieces(self) -> Pieces:
        """Inputs as piecewise polynomials, fitted as far as `polynomials.ACCURACY`."""
        unit = self._of_unit_amplitude()
        if unit is None:
            return fitted_pieces(self)
        coefficients = self.amplitude_factor * unit.pieces.coefficients
        return unit.pieces._replace(coefficients=coefficients)

    def _at_output_times(self) -> np.ndarray:
        unit = self._of_unit_amplitude()
        if unit is None:
            return loop_array(self.at(self.times))
        return self.amplitude_factor * unit.recorded_inputs[1]

    def _of_unit_amplitude(self) -> Maneuver | None:
        """The maneuver to which this one is proportional, if it declares that it is."""
        if not self.linear_in_amplitude or self.amplitude_factor == 1.0:
            return None
        unit = self.perturbed(self.frequency_factor)
        return unit if _is_linear(unit) else None


@dataclass(frozen=True)
class _Completed:
    """A signal with a column for every input of a model, constant where it has none."""

    signal: Callable[..., np.ndarray]
    columns: tuple[int, ...]
    defaults: tuple[float, ...]

    def __call__(self, times: np.ndarray, *factors: float) -> np.ndarray:
        values = np.tile(np.array(self.defaults), (len(times), 1))
        values[:, self.columns] = self.signal(times, *factors)
        return values


@lru_cache(maxsize=CACHED)
def _results(maneuver: Maneuver) -> dict[Any, Any]:  # noqa: ARG001
    return {}


@cached
def _is_linear(unit: Maneuver) -> bool:
    """Whether it is proportional as it declares: a copy with another signal may not be."""
    doubled = unit.perturbed(unit.frequency_factor, 2.0).at(unit.times)
    return bool(np.array_equal(doubled, 2.0 * unit.at(unit.times)))


def family(first: Maneuver) -> Maneuver:
    """The maneuver as a family: the number of a member is the seed of its signal."""
    return replace(first, member=partial(_member, first))


@lru_cache(maxsize=4096)
def _member(first: Maneuver, seed: int) -> Maneuver:
    count(f"seed of {first.name}", seed, least=0, most=MOST_SEED)
    of_first: Any = first.signal
    signal = replace(of_first, seed=seed)
    corners = getattr(signal, "corners", first.corners)
    return replace(first, name=f"{first.name}:{seed}", signal=signal, corners=corners)


def smooth(frequency: float) -> tuple[float, ...]:
    """No corners."""
    del frequency
    return ()


def registered(name: str) -> Maneuver:
    """The maneuver of a name; `InputError` if none has it, with a hint if it looks like a file."""
    try:
        return component("maneuver", name)
    except InputError as error:
        if isinstance(name, str) and "." in name:
            hint = "a CSV file is read by vm.Signal.from_csv, in a shell by --maneuver FILE.csv"
            raise InputError(f"{error}; {hint}") from None
        raise


def maneuver(name: str, frequency: float = 1.0, amplitude: float = 1.0) -> Maneuver:
    """A registered maneuver, see `maneuvers()`, with factors on its frequency and amplitude."""
    return registered(name).perturbed(frequency, amplitude)
