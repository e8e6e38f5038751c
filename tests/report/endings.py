"""A reduction method whose runs end as they are told: full order, a little off."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vehiclemor.exceptions import InputError, UnreachableError
from vehiclemor.multibody.definition import KINDS
from vehiclemor.reduction.interface import Method, OfflineCost
from vehiclemor.reduction.settings import Settings
from vehiclemor.simulation.trajectory import Trust


class EndSettings(Settings):
    """How a run ends whose input goes above a value: after a part of it, off by a share."""

    end: str = "ok"
    above: float = 0.0
    part: float = 0.5
    off: float = 0.01


@dataclass(frozen=True)
class Ending:
    """Full order with what the settings say."""

    model: Any
    settings: EndSettings
    offline: OfflineCost
    order: int = 1

    def simulate(self, maneuver, start):
        """The full-order run, changed."""
        largest = abs(maneuver.at(maneuver.times)).max()
        end = self.settings.end if largest > self.settings.above else ""
        if end == "unreachable":
            raise UnreachableError("the wheel can't be there")
        if end == "error":
            raise RuntimeError("a bug")
        run = self.model.simulate(maneuver, start)
        if end == "exact":
            return run
        factor = 1.0 + self.settings.off
        states = {name: factor * getattr(run, name) for name in ("coordinates", "outputs")}
        if end == "diverged":
            for values in states.values():
                values[int(self.settings.part * len(values)) :] = np.nan
            return replace(run, **states, status="diverged", message="the step is too small")
        left = Trust(2.0, 0.5, "inputs that are told") if end == "untrusted" else None
        return replace(run, **states).judged(left or Trust(0.5))

    def best_approximation(self, states):
        """None."""


def fit(model, training, settings):
    """Nothing is learnt."""
    del training
    if settings.end == "rejected":
        raise InputError("it is told to refuse")
    return Ending(model, settings, OfflineCost())


METHOD = Method("endings", "ends as it is told", dict.fromkeys(KINDS, EndSettings), fit)
