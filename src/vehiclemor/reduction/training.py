"""Training runs: full-order simulations that a method may learn from."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.registry import component, names, unknown
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start, Trajectory

POLICIES = {
    "matched": "trained on the very run that it is tested on (paper, section 3)",
    "nominal": "trained on the model's own maneuver, unperturbed (paper, section 4)",
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
    training: str,
    factors: Sequence[tuple[float, float]] = (),
) -> tuple[TrainingRun, ...]:
    """Training runs for what a reduced model is tested on, see `trained_maneuvers`."""
    runs = trained_maneuvers(model, maneuver, training, factors)
    return tuple(TrainingRun(model, run, start) for run in runs)


def trained_maneuvers(
    model: Model, tested: Maneuver, training: str, factors: Sequence[tuple[float, float]] = ()
) -> tuple[Maneuver, ...]:
    """What one of `POLICIES`, or the name of a maneuver, trains on.

    Parameters
    ----------
    tested
        What the reduced model is tested on; `set` takes it with each pair of factors (frequency,
        amplitude).

    Raises
    ------
    InputError
        If there is no such policy or maneuver, or `set` without factors.
    """
    if training == "matched":
        return (tested,)
    if training == "set":
        if not factors:
            raise InputError("training 'set' needs training_set: pairs of factors")
        return tuple(tested.perturbed(*pair) for pair in factors)
    name = model.definition.maneuver if training == "nominal" else training
    if name not in names("maneuver"):
        raise unknown("training", training, [*POLICIES, *names("maneuver")])
    return (component("maneuver", name),)
