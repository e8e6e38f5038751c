"""What a reduced model knows: how far a run goes in its training ranges.

Errors of vehicles and mechanisms are estimated, see `error_estimate`; of structures, single states
and models without error bounds this tells what it can.  All that can be exceeded is a range with a
name: states or features along a run (`trust_of`), inputs as signals, initial speeds and durations
(`InputRange`).  Each range gives how much of it a run uses and since when it is beyond; `trust_in`
combines them in one trust.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from vehiclemor.arguments import check_shapes
from vehiclemor.inputs.checks import completed
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Trust

# Edges in Hz of bands in which inputs of structures are known, and time (s) between samples.  A
# reduced structure holds motion up to a frequency: on a corrugated road hardly anything is slower.
BANDS, SAMPLING = (16.0, 32.0, 64.0, 128.0, 256.0, 500.0), 1e-3
# How many times the share of a band may pass that in the training: roads differ by chance.
CHANCE = 3.0
# Share of a band that needs no training.
QUIET = 1e-2
# One part in a million is rounding.
EDGE = 1.0 + 1e-6
# An input that was zero in training may be nothing else.
NOTHING = 1e-12
# Least part of the speed by which a run may start faster or slower.
SPEED_SLACK = 0.01


def trust_of(times: np.ndarray, used: np.ndarray, names: Sequence[str]) -> Trust:
    """Trust of a run, from how much it uses (samples, ranges) of the named ranges; 1 is the edge.

    What is no number is beyond it.
    """
    return trust_in(ranges_of(times, used, names))


def ranges_of(
    times: np.ndarray, used: np.ndarray, names: Sequence[str]
) -> dict[str, tuple[float, float]]:
    """How much a run uses of each range, and since when (s) it is beyond it."""
    used = np.abs(used)
    largest = np.fmax.reduce(used, axis=0, initial=0.0)
    beyond = ~(used <= 1.0)
    since = np.where(beyond.any(axis=0), times[beyond.argmax(axis=0)], np.inf)
    return dict(zip(names, zip(largest.tolist(), since.tolist(), strict=True), strict=True))


def trust_in(ranges: Mapping[str, tuple[float, float]]) -> Trust:
    """Trust of a run, from how much it uses of each range and since when (s) it is beyond it."""
    indicator = max((used for used, _ in ranges.values()), default=0.0)
    name, (used, until) = min(
        ranges.items(), key=lambda item: item[1][1], default=("", (0.0, np.inf))
    )
    if until == np.inf:
        return Trust(indicator)
    # Of what was zero in training no multiple tells anything.
    factor = f" by a factor of {used:.3g}" if used < 1e6 else ""
    return Trust(indicator, until, f"{name} leaves its known range{factor}")


@lru_cache(maxsize=512)
def bands_of(maneuver: Excitation) -> np.ndarray:
    """Magnitudes of the inputs, and shares of `BANDS` in their RMS values, (6, inputs)."""
    count = max(round(maneuver.duration / SAMPLING), 2)
    values = maneuver.at(np.linspace(0.0, maneuver.duration, count, endpoint=False))
    # There and back, so that its ends fit and no jump between them seems quick.
    mirrored = np.vstack([values, values[::-1]])
    power = np.abs(np.fft.rfft(mirrored, axis=0)) ** 2 * (2.0 / len(mirrored) ** 2)
    # The mean is no motion.
    hertz = np.fft.rfftfreq(len(mirrored), maneuver.duration / count)[1:]
    total = np.maximum(power[1:].sum(axis=0), NOTHING**2)
    inside = [(low < hertz) & (hertz <= high) for low, high in pairwise(BANDS)]
    shares = [np.sqrt(power[1:][band].sum(axis=0) / total) for band in inside]
    return np.vstack([np.abs(values).max(axis=0), shares])


@dataclass(frozen=True)
class InputRange:
    """Inputs, initial speeds and durations of the training runs: a method's least claim."""

    # Magnitudes of the inputs (1, inputs) at output times; of a structure these and shares of
    # `BANDS` in their RMS values (6, inputs).
    largest: np.ndarray
    # Middle of the initial speeds in m/s, and how far they lie from it.
    speed: float
    reach: float
    # Duration of the longest run in s; any is known of a model without memory.
    longest: float

    def check_sizes(self) -> None:
        """Raise `ValueError` if the magnitudes are no table of floats."""
        check_shapes("largest", (self.largest, len(self.largest), *self.largest.shape[1:2]))

    @property
    def _sizes(self) -> np.ndarray:
        # In a file that was written by hand they may be zero.
        return np.maximum(self.largest, NOTHING)

    def trust(self, model: Model, maneuver: Excitation, speed: float) -> Trust:
        """How far a run with an initial speed in m/s goes in the range."""
        maneuver = completed(maneuver, model.definition)
        names = [f"input {name}" for name in model.inputs]
        if model.kind == "structural":
            bands = ["", *(f", {low:g} to {high:g} Hz" for low, high in pairwise(BANDS))]
            names = [f"{name}{band}" for name in names for band in bands]
            times, used = np.zeros(1), (bands_of(maneuver) / self._sizes).T.reshape(1, -1)
        else:
            times, inputs = maneuver.recorded_inputs
            used = inputs / self._sizes[0]
        ranges = ranges_of(times, used, names)
        if model.kind != "ae":
            off = abs(speed - self.speed) / self.reach
            ranges["initial speed"] = off, 0.0 if off > 1.0 else np.inf
        lasts = maneuver.duration / self.longest
        ranges["duration"] = lasts, self.longest if lasts > 1.0 else np.inf
        return trust_in(ranges)

    def trust_of_inputs(self, names: Sequence[str], inputs: np.ndarray) -> Trust:
        """How far inputs (samples, inputs) go in the range, each for itself."""
        names = [f"input {name}" for name in names]
        return trust_of(np.zeros(len(inputs)), inputs / self._sizes[0], names)


def input_range(model: Model, runs: Sequence[tuple[Excitation, float]]) -> InputRange:
    """Range of some training runs, each a maneuver and an initial speed in m/s."""
    maneuvers = [completed(maneuver, model.definition) for maneuver, _ in runs]
    speeds = [speed for _, speed in runs]
    low, high = min(speeds), max(speeds)
    middle = 0.5 * (low + high)
    reach = EDGE * (max(0.5 * (high - low), SPEED_SLACK * middle) or 1.0)
    longest = max(maneuver.duration for maneuver in maneuvers)
    lasts = np.inf if model.kind == "ae" else EDGE * longest
    if model.kind == "structural":
        largest = np.max([bands_of(maneuver) for maneuver in maneuvers], axis=0)
        # A share so small does not matter.
        largest[1:] = np.maximum(CHANCE * largest[1:], QUIET)
    else:
        samples = [np.abs(maneuver.at(maneuver.times)).max(axis=0) for maneuver in maneuvers]
        largest = np.max(samples, axis=0)[None]
    return InputRange(EDGE * np.maximum(largest, NOTHING), middle, reach, lasts)


def band_range(model: Model, highest: float) -> InputRange:
    """Range of a structure's inputs of which all is known up to so many Hz, without training."""
    shares = np.where(np.array(BANDS[:-1]) < highest, np.inf, EDGE * QUIET)
    largest = np.tile(np.append(np.inf, shares)[:, None], len(model.inputs))
    return InputRange(largest, 0.0, np.inf, np.inf)
