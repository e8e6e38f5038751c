"""Grids: every combination of a study file's values, each an experiment with one test scenario.

An experiment is made when it is asked for, and dropped after that: of a grid only the keys are
kept.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from vehiclemor.errors import (
    FileError,
    GeometryError,
    InputError,
    PlugInError,
    VehiclemorError,
)
from vehiclemor.registry import component, unknown
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model
from vehiclemor.study.evaluate import refusal
from vehiclemor.study.experiment import (
    Experiment,
    Settings,
    complete_settings,
    default_settings,
    make_experiment,
)
from vehiclemor.study.plans.study_file import (
    FACTORS,
    PARAMETER,
    TEXTS,
    Sampling,
    StudyFile,
    values,
)
from vehiclemor.study.plans.training import training_set
from vehiclemor.study.scenario import Overrides, Scenario, Values, check, overrides, with_parameters

# Place in the grid: one index per dimension.
Place = tuple[int, ...]
# Histories of a study that are held at once.
MOST_BYTES = 4e9
# A key is 20 characters of ASCII.
KEY = "S20"


class Run(NamedTuple):
    """All of a point that determines training and test scenarios.

    Attributes
    ----------
    learner
        The method, where the training depends on it.
    """

    maneuver: str
    factors: tuple[float, float]
    start: str
    car: Overrides
    training: tuple[str, ...]
    learner: str
    pairs: tuple[tuple[float, float], ...]

    @property
    def test(self) -> Scenario:
        """What is tested."""
        return Scenario.of(self.maneuver, self.factors, self.start, None, self.car)


# As many as stand side by side in a grid, whose settings vary in between.
@lru_cache(maxsize=1024)
def _scenarios(model: Model, run: Run) -> tuple[tuple[Scenario, ...], tuple[Scenario]]:
    """Training and test scenarios of a run."""
    test = run.test
    return training_set(model, run.learner, run.training, test, run.pairs), (test,)


@lru_cache(maxsize=4096)
def _complete(
    model: Model, method: str, given: tuple[tuple[str, Any], ...], preset: str
) -> Settings:
    return Values(complete_settings(model, method, dict(given), preset))


@dataclass(frozen=True, eq=False)
class Grid:
    """Experiments of a study on its dimensions.

    Attributes
    ----------
    model
        With the study's own parameters.
    dimensions
        Name -> values of every grid dimension, `label` of the methods last.
    samples
        Name of what is sampled -> values on the dimension `sample`.
    """

    name: str
    definition: StudyFile
    model: Model
    dimensions: dict[str, list[Any]]
    samples: dict[str, list[float]]

    @property
    def sizes(self) -> Place:
        """Number of values of every dimension."""
        return tuple(len(entry) for entry in self.dimensions.values())

    @cached_property
    def unique(self) -> UniqueCells:
        """Key -> experiment, each once, in grid order, made when it is asked for."""
        return UniqueCells(self)

    @cached_property
    def keys(self) -> np.ndarray:
        """Keys of the experiments at all places."""
        found = np.empty(self.sizes, KEY)
        for method in range(self.sizes[-1]):
            own = self._own_places(method)
            keys = [self.cell(place).key for place in itertools.product(*own)]
            found[..., method] = np.array(keys, KEY).reshape([len(part) for part in own[:-1]])
        return found

    def cell(self, place: Place) -> Experiment:
        """The experiment at a place."""
        point = self.point(place)
        study, label = self.definition, point["label"]
        entry, names = study.labelled[label], self._settings[label]
        given = entry.settings | {d: point[d] for d in study.grid if d in names}
        settings = _complete(self.model, entry.method, tuple(given.items()), entry.preset)
        training, test = _scenarios(self.model, self._run(point))
        return make_experiment(self.model, entry.method, settings, training, test, study.keep)

    def point(self, place: Place) -> dict[str, Any]:
        """Name of a dimension, or of what is sampled -> value at a place."""
        point = {d: found[i] for (d, found), i in zip(self.dimensions.items(), place, strict=True)}
        return point | {name: found[point["sample"]] for name, found in self.samples.items()}

    def check(self) -> None:
        """Raise `VehiclemorError` if a run can't be made, or no settings of a method fit."""
        names = {name for found in self._settings.values() for name in found} | {"label"}
        ranges = [
            range(1 if name in names else len(found)) for name, found in self.dimensions.items()
        ]
        runs = [self._run(self.point(place)) for place in itertools.product(*ranges)]
        if self.definition.keep == "trajectories":
            self._check_histories({run.maneuver for run in runs})
        for run in runs:
            _check_run(self.model, run)
        for method in range(self.sizes[-1]):
            self._check_some_fit(method)

    def _check_histories(self, maneuvers: set[str]) -> None:
        """Raise `InputError` if the histories of all runs can't be held, or not side by side."""
        first, *others = [component("maneuver", name) for name in maneuvers]
        model, number = self.model, math.prod(self.sizes)
        columns = len(model.coordinates) + len(model.speeds) + 2 * len(model.outputs)
        size = 8.0 * first.samples * columns * number
        if size > MOST_BYTES:
            raise InputError(
                f"histories of {number} runs take {size / 1e9:.0f} GB, more than "
                f'{MOST_BYTES / 1e9:g}: give keep = "metrics", or make several studies of it'
            )
        if any(not np.array_equal(first.times, other.times) for other in others):
            raise InputError('maneuvers of other output times need keep = "metrics"')

    def _run(self, point: Mapping[str, Any]) -> Run:
        """What the values of a point say about input, start, car and training."""
        study, entry = self.definition, self.definition.labelled[point["label"]]
        car = {n.removeprefix(PARAMETER): v for n, v in point.items() if n.startswith(PARAMETER)}
        training = entry.training or point.get("training", study.training)
        training = tuple(training) if isinstance(training, list) else (training,)
        return Run(
            point.get("maneuver", study.maneuver or self.model.definition.maneuver),
            (point[FACTORS[0]], point[FACTORS[1]]),
            point["start"],
            overrides(car),
            training,
            entry.method if "protocol" in training else "",
            tuple((pair[0], pair[1]) for pair in study.training_set),
        )

    @cached_property
    def _settings(self) -> dict[str, set[str]]:
        """Label of a method -> names of its settings."""
        methods = self.definition.labelled.items()
        return {label: set(default_settings(self.model, entry.method)) for label, entry in methods}

    def _own_places(self, method: int) -> list[range]:
        """Indices of every dimension at which the experiments of a method differ."""
        own = self._settings[self.dimensions["label"][method]]
        others = set().union(*self._settings.values()) - own
        sizes = [1 if d in others else len(found) for d, found in self.dimensions.items()]
        return [*map(range, sizes[:-1]), range(method, method + 1)]

    def _check_some_fit(self, method: int) -> None:
        """Raise the first error if no cell of a method has settings that fit the model.

        Corners of a grid may not fit, such as a rank above the number of snapshots; if nothing
        does, the study is wrong.
        """
        first = ""
        for place in itertools.product(*self._own_places(method)):
            cell = self.cell(place)
            found = refusal(self.model, cell)
            # Of a method that refuses the model nothing is set; a bug is a result.
            if found is None or found.status != "rejected" or not cell.settings:
                return
            first = first or found.message
        raise InputError(first)


def _check_run(model: Model, run: Run) -> None:
    """Raise `InputError` if the model can't be run so, with the parameters if it can't be made."""
    try:
        with_parameters(model, run.car)
    except VehiclemorError as error:
        told = ", ".join(f"{name} = {value}" for name, value in run.car)
        raise InputError(f"{told}: {error}") from None
    check(model, run.test)


class UniqueCells(Mapping[str, Experiment]):
    """Experiments of a grid by their keys, each once."""

    def __init__(self, grid: Grid) -> None:
        self._grid = grid
        self._keys, self._first = np.unique(grid.keys.ravel(), return_index=True)

    def __getitem__(self, key: str) -> Experiment:
        at = int(np.searchsorted(self._keys, np.bytes_(key)))
        if at == len(self._keys) or self._keys[at].decode() != key:
            raise KeyError(key)
        cell = self._grid.cell(np.unravel_index(self._first[at], self._grid.sizes))
        # Its hash is known: it is half of what planning takes.
        vars(cell)["key"] = key
        return cell

    def __iter__(self) -> Iterator[str]:
        for key in self._keys[np.argsort(self._first)]:
            yield key.decode()

    def __len__(self) -> int:
        return len(self._keys)


def expand(name: str, study: StudyFile) -> Grid:
    """All experiments of a study.

    Raises
    ------
    FileError
        If the study names something unknown or a setting does not fit.
    """
    try:
        model = build(study.model, overrides=study.parameters)
        samples = sampled(study.sampling) if study.sampling else {}
        dimensions = _dimensions(model, study, samples)
        grid = Grid(name, study, model, dimensions, samples)
        grid.check()
        assert grid.keys.size
        return grid
    except PlugInError:
        raise
    except (InputError, GeometryError) as error:
        raise FileError(f"study {name}: {error}") from None


def _dimensions(
    model: Model, study: StudyFile, samples: Mapping[str, list[float]]
) -> dict[str, list[Any]]:
    """Name -> values of every dimension, checked."""
    settings = {s for entry in study.methods for s in default_settings(model, entry.method)}
    known = settings | {*FACTORS, *TEXTS} | {f"{PARAMETER}{n}" for n in model.parameters.entries}
    for dimension in study.grid:
        if dimension not in known and not dimension.startswith(PARAMETER):
            raise unknown("grid dimension", dimension, known)
    dimensions: dict[str, list[Any]] = {name: [1.0] for name in FACTORS if name not in samples}
    dimensions |= {key: values(entry) for key, entry in study.grid.items()}
    if study.sampling:
        dimensions["sample"] = list(range(study.sampling.count))
    dimensions.setdefault("start", list(study.start or [model.starts[0]]))
    if len(set(dimensions["start"])) != len(dimensions["start"]):
        raise InputError("start has the same value twice")
    dimensions["label"] = list(study.labelled)
    return dimensions


def sampled(plan: Sampling) -> dict[str, list[float]]:
    """Name of a range -> its values (count,) at the points of a plan, the same for the same seed.

    A Latin hypercube has one point in each of `count` slices of every range (M. McKay, R. Beckman,
    W. Conover, Technometrics 21 (1979), 239-245).  Sobol points are scrambled (A. Owen, J.
    Complexity 14 (1998), 466-489).
    """
    from scipy.stats import qmc

    kind = qmc.Sobol if plan.plan == "sobol" else qmc.LatinHypercube
    points = kind(len(plan.ranges), rng=np.random.default_rng(plan.seed)).random(plan.count)
    low, high = np.array(list(plan.ranges.values())).T
    spread = low + (high - low) * points
    return {name: spread[:, j].tolist() for j, name in enumerate(plan.ranges)}
