"""Maneuvers: input time histories that studies scale in frequency and amplitude."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np

from vehiclemor.arguments import count, line_of_text, number, quoted, real_array, within
from vehiclemor.exceptions import InputError, PlugInError, blamed
from vehiclemor.registry import component
from vehiclemor.short_repr import ShortRepr

# Bounds far beyond anything that is meant.  A maneuver that is a thousand times slower does not
# begin within its run, one that is a thousand times faster is over between two output times.
FACTORS = {"frequency": (1e-3, 1e3), "amplitude": (-1e6, 1e6)}
LONGEST_DURATION = 1e5
MOST_SAMPLES = 10_000_000
MOST_CORNERS = 10_000


@dataclass(frozen=True)
class Maneuver(ShortRepr):
    """Inputs u(t) of a model over a fixed duration.

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
        alone share what is made of the signal.
    member
        Of a family, such as roads of other seeds: number -> maneuver, whose name is `NAME:NUMBER`.
    """

    repr_fields = ("name", "inputs", "duration", "samples", "frequency_factor", "amplitude_factor")

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
    member: "Callable[[int], Maneuver] | None" = None

    def __post_init__(self) -> None:
        """Refuse what is no maneuver, so that its author reads one clear line."""
        for text in ("name", "summary"):
            line_of_text(f"{text} of a maneuver", getattr(self, text))
        for function in ("signal", "corners", *["member"] * (self.member is not None)):
            if not callable(getattr(self, function)):
                raise InputError(f"{self}: {function} is not a function")
        if isinstance(self.inputs, list):
            object.__setattr__(self, "inputs", tuple(self.inputs))
        if not (isinstance(self.inputs, tuple) and all(isinstance(i, str) for i in self.inputs)):
            raise InputError(f"{self}: inputs is {quoted(self.inputs)}, not a tuple of names")
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

    @property
    def times(self) -> np.ndarray:
        """Equidistant output times (samples,) in s."""
        return np.linspace(0.0, self.duration, self.samples)

    @property
    def break_points(self) -> tuple[float, ...]:
        """Times in s inside the run at which the inputs are not smooth."""
        with blamed(f"{self}: corners", self.corners):
            found = self.corners(self.frequency_factor)
            times = real_array([*islice(found, MOST_CORNERS + 1)] or np.zeros(0))
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

    def perturbed(self, frequency: float = 1.0, amplitude: float = 1.0) -> "Maneuver":
        """The maneuver with its factors set; `InputError` if one is out of its bounds."""
        return replace(self, frequency_factor=frequency, amplitude_factor=amplitude)

    def for_inputs(self, names: tuple[str, ...]) -> "Maneuver":  # noqa: ARG002
        """The maneuver as a model with these inputs takes it."""
        return self


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
    factor = number(f"{name} factor", value)
    if name == "frequency" and factor <= 0.0:
        raise InputError(f"{name} factor: {factor:g} is not positive")
    return within(f"{name} factor", factor, FACTORS[name])


def smooth(frequency: float) -> tuple[float, ...]:
    """No corners."""
    del frequency
    return ()


def maneuver(name: str, frequency: float = 1.0, amplitude: float = 1.0) -> Maneuver:
    """A registered maneuver, see `maneuvers()`, with factors on its frequency and amplitude."""
    return component("maneuver", name).perturbed(frequency, amplitude)
