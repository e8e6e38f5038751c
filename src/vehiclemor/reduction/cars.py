"""Cars that a reduced model was learnt from: the parameters that it knows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from vehiclemor.multibody.vehicle_parameters import DROP
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Trust

# Parameters that say how a run starts, not which car it is.
OF_STARTS = ("initial_speed", *DROP)
# Part of a parameter that is rounding.
ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Cars(ShortRepr):
    """Parameters of some cars of one model.

    Attributes
    ----------
    values
        All components (cars, components), SI units; each car once, in order.
    """

    values: np.ndarray

    def numbers(self, models: Iterable[Model]) -> list[int]:
        """Number of each model among the cars."""
        return [
            int(np.flatnonzero((self.values == _flat(model)).all(axis=1))[0]) for model in models
        ]

    @property
    def varied(self) -> np.ndarray:
        """Numbers of the components in which they differ."""
        return np.flatnonzero(np.ptp(self.values, axis=0) > 0.0)

    def places(self, values: np.ndarray) -> np.ndarray:
        """Components (..., components) as places (..., varied), -1 to 1 in the cars' box."""
        low, high = self.values[:, self.varied].min(axis=0), self.values[:, self.varied].max(axis=0)
        return (2.0 * values[..., self.varied] - low - high) / (high - low)

    def place(self, model: Model) -> np.ndarray:
        """Place (varied,) of a car in the box."""
        return self.places(_flat(model))

    def trust(self, model: Model) -> Trust:
        """How far a car lies in the box; outside of it nothing is trusted."""
        low, high, own = self.values.min(axis=0), self.values.max(axis=0), _flat(model)
        slack = ROUNDING * np.maximum(np.abs(low), np.abs(high))
        outside = np.flatnonzero((own < low - slack) | (own > high + slack))
        if not len(outside):
            return Trust(float(np.abs(self.place(model)).max(initial=0.0)))
        first, names = outside[0], _names(model)
        within = " to ".join(dict.fromkeys(f"{v:.6g}" for v in (low[first], high[first])))
        reason = f"{names[first]} is {own[first]:.6g}; the cars of the training have {within}"
        return Trust(np.inf, 0.0, reason)


def cars_of(models: Iterable[Model]) -> Cars:
    """The cars among some models, each once."""
    return Cars(np.array(list(dict.fromkeys(tuple(_flat(model).tolist()) for model in models))))


def difference(model: Model, other: Model) -> str:
    """The first parameter in which two cars differ; empty if they are one."""
    if model.parameters is other.parameters:
        return ""
    differs = np.flatnonzero(_flat(model) != _flat(other))
    return _names(model)[differs[0]] if len(differs) else ""


def _flat(model: Model) -> np.ndarray:
    """All components of the parameters; zero where they say how a run starts."""
    values, declared, place = model.parameters.flat(), model.definition.parameters, 0
    for name, entry in declared.items():
        if name in OF_STARTS:
            values[place : place + entry.size] = 0.0
        place += entry.size
    return values


def _names(model: Model) -> list[str]:
    declared = model.definition.parameters
    return [name for name, entry in declared.items() for _ in range(entry.size)]
