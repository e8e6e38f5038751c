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
from typing import Any

import numpy as np

from vehiclemor.errors import FileError, GeometryError, InputError, PlugInError
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.registry import component, unknown
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model
from vehiclemor.study.evaluate import refusal
from vehiclemor.study.experiment import Experiment, make_experiment
from vehiclemor.study.failure import Failure
from vehiclemor.study.method_settings import Settings, complete_settings, default_settings
from vehiclemor.study.plans.grid_runs import Run, check_run, run_at, scenarios
from vehiclemor.study.plans.sampling import sampled
from vehiclemor.study.plans.study_file import FACTORS, PARAMETER, TEXTS, StudyFile, values
from vehiclemor.study.scenario import Values

# Place in the grid: one index per dimension.
Place = tuple[int, ...]
# Histories of a study that are held at once.
MOST_BYTES = 4e9
# A key is 20 characters of ASCII.
KEY = "S20"


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
        training, test = scenarios(self.model, self._run(place))
        return make_experiment(self.model, entry.method, settings, training, (test,), study.keep)

    def point(self, place: Place) -> dict[str, Any]:
        """Name of a dimension, or of what is sampled -> value at a place."""
        point = {d: found[i] for (d, found), i in zip(self.dimensions.items(), place, strict=True)}
        return point | {name: found[point["sample"]] for name, found in self.samples.items()}

    def check(self) -> None:
        """Raise `VehiclemorError` if a run can't be made, or no settings of a method fit."""
        if self.definition.keep == "trajectories":
            self._check_size()
        names = {name for found in self._settings.values() for name in found}
        runs = [
            range(1 if name in names or name == "label" else size)
            for name, size in zip(self.dimensions, self.sizes, strict=True)
        ]
        for place in itertools.product(*runs):
            check_run(self.model, self._run(place))
        if self.definition.keep == "trajectories":
            known = [component("maneuver", name) for name in self.dimensions.get("maneuver", ())]
            if any(not np.array_equal(known[0].times, other.times) for other in known[1:]):
                raise InputError('maneuvers of other output times need keep = "metrics"')
        for method in range(self.sizes[-1]):
            self._some_fits(method)

    def _check_size(self) -> None:
        """Raise `InputError` if the histories of all runs can't be held."""
        maneuver: Maneuver = component("maneuver", self._run((0,) * len(self.sizes)).maneuver)
        model = self.model
        columns = len(model.coordinates) + len(model.speeds) + 2 * len(model.outputs)
        size = 8.0 * maneuver.samples * columns * math.prod(self.sizes)
        if size > MOST_BYTES:
            raise InputError(
                f"histories of {math.prod(self.sizes)} runs take {size / 1e9:.0f} GB, more than "
                f'{MOST_BYTES / 1e9:g}: give keep = "metrics", or make several studies of it'
            )

    def _run(self, place: Place) -> Run:
        fixed = {"maneuver": self.definition.maneuver or self.model.definition.maneuver}
        return run_at(self.definition, fixed | self.point(place))

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

    def _some_fits(self, method: int) -> None:
        """Raise the first error if no cell of a method has settings that fit the model.

        Corners of a grid may not fit, such as a rank above the number of snapshots; if nothing
        does, the study is wrong.
        """
        first: Failure | None = None
        for place in itertools.product(*self._own_places(method)):
            cell = self.cell(place)
            found = refusal(self.model, cell)
            # Of a method that refuses the model nothing is set; a bug is a result.
            if found is None or found.status != "rejected" or not cell.settings:
                return
            first = first or found
        if first is not None:
            raise InputError(first.message)


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
    known = (
        settings | {*FACTORS, *TEXTS} | {f"{PARAMETER}{name}" for name in model.parameters.entries}
    )
    for dimension in study.grid:
        if dimension not in known and not dimension.startswith(PARAMETER):
            raise unknown("grid dimension", dimension, known)
    dimensions: dict[str, list[Any]] = {
        factor: [1.0] for factor in FACTORS if factor not in samples
    }
    dimensions |= {key: values(entry) for key, entry in study.grid.items()}
    if study.sampling:
        dimensions["sample"] = list(range(study.sampling.count))
    dimensions.setdefault("start", list(study.start or [model.starts[0]]))
    if len(set(dimensions["start"])) != len(dimensions["start"]):
        raise InputError("start has the same value twice")
    dimensions["label"] = list(study.labelled)
    return dimensions


@lru_cache(maxsize=4096)
def _complete(
    model: Model, method: str, given: tuple[tuple[str, Any], ...], preset: str
) -> Settings:
    return Values(complete_settings(model, method, dict(given), preset))
