"""What a reduced model knows: how far a run goes in the ranges that it has been made for."""

from collections.abc import Mapping, Sequence

import numpy as np

from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.simulation.input_polynomials import extent_of
from vehiclemor.simulation.trajectory import Trust

# One part in a million is rounding.
EDGE = 1.0 + 1e-6
# An input that was zero in training may be nothing else.
NOTHING = 1e-12


def trust_of(times: np.ndarray, used: np.ndarray, names: Sequence[str]) -> Trust:
    """Trust of a run, from how much it uses (samples, ranges) of the named ranges; 1 is the edge.

    What is no number is beyond it.
    """
    used = np.abs(used)
    largest = np.fmax.reduce(used, axis=0, initial=0.0)
    beyond = ~(used <= 1.0)
    since = np.where(beyond.any(axis=0), times[beyond.argmax(axis=0)], np.inf)
    found = zip(largest.tolist(), since.tolist(), strict=True)
    return trust_in(dict(zip(names, found, strict=True)))


def trust_in(ranges: Mapping[str, tuple[float, float]]) -> Trust:
    """Trust of a run, from how much it uses of each range and since when (s) it is beyond it."""
    indicator = max((used for used, _ in ranges.values()), default=0.0)
    name, (_, until) = min(ranges.items(), key=lambda item: item[1][1], default=("", (0.0, np.inf)))
    if until == np.inf:
        return Trust(indicator)
    # Of what was zero in training no multiple tells anything.
    times = f", in the run up to {indicator:.3g} times" if indicator < 1e6 else ""
    return Trust(indicator, until, f"{name} is beyond its known range{times}")


def largest_inputs(maneuvers: Sequence[Maneuver]) -> np.ndarray:
    """Largest sizes (3, inputs) of inputs, see `Extent`."""
    largest = [extent_of(maneuver).largest for maneuver in maneuvers]
    return EDGE * np.maximum(np.max(largest, axis=0), NOTHING)


def inputs_beyond(maneuver: Maneuver, known: np.ndarray) -> np.ndarray:
    """Times (inputs,) in s at which inputs pass what is known of them (3, inputs) first."""
    return extent_of(maneuver, np.array([-known[0], *known])).since
