"""What a few runs of a car itself say of its reduced model, which was learnt from other cars."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.reduction.cars import difference
from vehiclemor.reduction.interface import ReducedModel, offline_cost
from vehiclemor.reduction.training import Training
from vehiclemor.registry import component
from vehiclemor.signals import Signal
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Trajectory, Trust

# Runs that check a car.
CHECKING = 4
# How many times the errors that are known of the first car those of another may be: cars differ,
# and so do the errors of models that are fitted to each, but by less.
TRUSTED = 2.0
# Errors of this part of the outputs' variation are as good as none: a tenth of a line's width in a
# figure.  That those of the first car are smaller still says nothing against another.
NOTHING = 1e-4


class Input(NamedTuple):
    """A registered maneuver with its factors."""

    maneuver: str
    frequency: float
    amplitude: float

    @property
    def made(self) -> Maneuver:
        """The maneuver itself."""
        return component("maneuver", self.maneuver).perturbed(self.frequency, self.amplitude)


class Sampled(NamedTuple):
    """Any other maneuver at its output times."""

    times: np.ndarray
    values: np.ndarray
    inputs: tuple[str, ...]

    @property
    def made(self) -> Maneuver:
        """The maneuver, linear between the samples."""
        step = self.times[1] - self.times[0]
        return Signal.from_samples(
            self.times, self.values, inputs=self.inputs, output_step=float(step)
        )


def registered(maneuver: Maneuver) -> Input | None:
    """A maneuver by its name, if it has one."""
    entry = Input(maneuver.name, maneuver.frequency_factor, maneuver.amplitude_factor)
    try:
        return entry if entry.made == maneuver else None
    except InputError:
        return None


class CarChecks(NamedTuple):
    """Runs that check the reduced model of a car.

    Attributes
    ----------
    inputs, starts
        Inputs and names of the starts of some training runs.
    known
        Errors (units,) of a model that was learnt from the first car alone, on that car.
    """

    inputs: tuple[Input | Sampled, ...]
    starts: tuple[str, ...]
    known: np.ndarray

    def errors(self, reduced: Any) -> tuple[np.ndarray, np.ndarray, list[Trajectory]]:
        """Errors of a reduced model, how much the outputs vary, and the full runs.

        Both are root mean squares (units,) over runs, times and all outputs of a unit: an error of
        one output that happens to be small says little.
        """
        model: Model = reduced.model
        units = [output.unit for output in model.definition.outputs]
        same = np.equal.outer(list(dict.fromkeys(units)), units).astype(float)
        errors, sizes, runs = np.zeros(len(units)), np.zeros(len(units)), []
        for entry, start in zip(self.inputs, self.starts, strict=True):
            maneuver = entry.made
            full, run = (ready.simulate(maneuver, start) for ready in (model, reduced))
            errors += np.mean((run.outputs - full.outputs) ** 2, axis=0)
            sizes += np.var(full.outputs, axis=0)
            runs.append(full)
        return np.sqrt(same @ errors), np.sqrt(same @ sizes), runs


def doubted(reduced: Any) -> Trust | None:
    """What a reduced model tells of its car in every run, if there is a doubt."""
    why = getattr(reduced, "doubt", "")
    return Trust(np.inf, 0.0, why) if why else None


def checked(reduced: Any, checks: CarChecks | None, began: float, further: int = 0) -> Any:
    """A reduced model with what the checks say of its car, and what it has cost since it began."""
    if checks is None:
        return replace(reduced, offline=offline_cost(began, reduced.model, (), further))
    errors, _, runs = checks.errors(reduced)
    worst, why = float(np.max(errors / checks.known)), ""
    # What has failed is no number.
    if not worst <= TRUSTED:
        of = "a model of the first car alone"
        why = f"errors in runs that check this car, {worst:.2g} times those of {of}"
    cost = offline_cost(began, reduced.model, runs, further)
    return replace(reduced, checks=checks, doubt=why, offline=cost)


def fitted_and_checked(
    fit: Callable[[Any, Training], ReducedModel], model: Model, training: Training
) -> ReducedModel:
    """What a fit (model, training) gives; learnt from several cars, its own is checked.

    It then has `checks` and `doubt`, and so have those of other cars.
    """
    began, first = time.process_time(), training[0].model
    found = fit(model, training)
    own = [run for run in training if not difference(first, run.model)]
    if len(own) == len(training):
        return found
    alone: Any = fit(first, own)
    # Starts that are states are not those of another car.
    chosen = [run for run in own if isinstance(run.start, str)] or own
    chosen = chosen[:: -(-len(chosen) // CHECKING)]
    given = [run.maneuver for run in chosen]
    checks = CarChecks(
        tuple(registered(m) or Sampled(m.times, m.at(m.times), m.inputs) for m in given),
        tuple(r.start if isinstance(r.start, str) else first.starts[0] for r in chosen),
        np.zeros(0),
    )
    errors, sizes, runs = checks.errors(alone)
    known = np.maximum(errors, NOTHING * sizes) + np.finfo(float).tiny
    further = found.offline.evaluations + alone.offline.evaluations
    further += offline_cost(began, model, runs).evaluations
    return checked(found, checks._replace(known=known), began, further)
