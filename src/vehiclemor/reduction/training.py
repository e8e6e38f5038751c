"""Training runs: full-order simulations that a method may learn from."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.registry import unknown
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start, Trajectory

POLICIES = {
    "matched": "trained on the very run that it is tested on (paper, section 3)",
    "nominal": "trained on the unperturbed run (paper, section 4)",
    "set": "trained on a listed set of frequency and amplitude factors",
}


@dataclass(frozen=True)
class TrainingRun(ShortRepr):
    """One maneuver of the full-order model, solved wherever a method asks."""

    model: Model
    maneuver: Maneuver
    start: Start

    def at(self, times: np.ndarray) -> Trajectory:
        """Full-order trajectory, solved exactly at the given increasing times (samples,) in s."""
        return self.model.simulate(self.maneuver, self.start, times)

    def recorded(self) -> Trajectory:
        """Full-order trajectory at the maneuver's output times."""
        return self.at(self.maneuver.times)

    def snapshots(self, count: int) -> Trajectory:
        """Full-order trajectory at so many equidistant times, both ends included."""
        return self.at(np.linspace(0.0, self.maneuver.duration, count))


Training = Sequence[TrainingRun]


def training_runs(
    model: Model,
    maneuver: Maneuver,
    start: Start,
    policy: str,
    factors: Sequence[tuple[float, float]] = (),
) -> tuple[TrainingRun, ...]:
    """Training runs for what a reduced model is tested on, see `policy_factors`."""
    pairs = policy_factors(maneuver, policy, factors)
    return tuple(TrainingRun(model, maneuver.perturbed(*pair), start) for pair in pairs)


def policy_factors(
    maneuver: Maneuver, policy: str, factors: Sequence[tuple[float, float]] = ()
) -> tuple[tuple[float, float], ...]:
    """(frequency, amplitude) factors of the runs of one of `POLICIES`; those of `set` are given.

    Raises
    ------
    InputError
        If the policy is unknown, or `set` without factors.
    """
    if policy == "matched":
        return ((maneuver.frequency_factor, maneuver.amplitude_factor),)
    if policy == "nominal":
        return ((1.0, 1.0),)
    if policy == "set":
        if not factors:
            raise InputError("the training policy 'set' needs training_set: pairs of factors")
        return tuple(factors)
    raise unknown("training policy", policy, POLICIES)
