"""Training runs: full-order simulations that a method may learn from."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vehiclemor.maneuver import Maneuver
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start, Trajectory


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
