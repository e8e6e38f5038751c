"""Grids: every combination of a study file's values, each an experiment with one test scenario."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from vehiclemor.errors import FileError, InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.registry import component, unknown
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model
from vehiclemor.study.evaluate import refusal
from vehiclemor.study.experiment import Experiment, make_experiment
from vehiclemor.study.failure import Failure
from vehiclemor.study.method_settings import Settings, complete_settings, default_settings
from vehiclemor.study.plans.study_file import FACTORS, StudyFile, values
from vehiclemor.study.scenario import (
    Overrides,
    Scenario,
    check,
    overrides,
    training_scenarios,
)


@dataclass(frozen=True)
class Grid:
    """Experiments of a study on its dimensions.

    Attributes
    ----------
    dimensions
        Name -> values of every grid dimension, the labels of `method` last.
    cells
        Place in the grid (one index per dimension) -> experiment.  A dimension that does not
        concern a method has the same experiment at all of its places.
    """

    name: str
    definition: StudyFile
    dimensions: dict[str, list[Any]]
    cells: dict[tuple[int, ...], Experiment]

    @cached_property
    def unique(self) -> dict[str, Experiment]:
        """Key -> experiment, each once, in grid order."""
        return {cell.key: cell for cell in self.cells.values()}


def expand(name: str, study: StudyFile) -> Grid:
    """All experiments of a study.

    Raises
    ------
    FileError
        If the study names something unknown or a setting does not fit.
    """
    try:
        model = build(study.model)
        declared = _declared_settings(model, study)
        dimensions = _dimensions(model, study, set().union(*declared.values()))
        return Grid(name, study, dimensions, _cells(model, study, dimensions, declared))
    except InputError as error:
        raise FileError(f"study {name}: {error}") from None


def _declared_settings(model: Model, study: StudyFile) -> dict[str, set[str]]:
    """Label of a method -> names of its settings."""
    methods = study.labelled.items()
    return {label: set(default_settings(model, entry.method)) for label, entry in methods}


def _dimensions(model: Model, study: StudyFile, settings: set[str]) -> dict[str, list[Any]]:
    """Name -> values of every dimension, checked."""
    for dimension in study.grid:
        if dimension not in settings and dimension not in FACTORS:
            raise unknown("grid dimension", dimension, settings | set(FACTORS))
    dimensions: dict[str, list[Any]] = {factor: [1.0] for factor in FACTORS}
    dimensions |= {key: values(entry) for key, entry in study.grid.items()}
    dimensions["start"] = list(study.start or [model.starts[0]])
    if len(set(dimensions["start"])) != len(dimensions["start"]):
        raise InputError("start has the same value twice")
    dimensions["method"] = list(study.labelled)
    return dimensions


def _cells(
    model: Model,
    study: StudyFile,
    dimensions: Mapping[str, list[Any]],
    declared: Mapping[str, set[str]],
) -> dict[tuple[int, ...], Experiment]:
    """Place -> experiment; each is made once."""
    name = study.maneuver or component("model", study.model).maneuver
    maneuver: Maneuver = component("maneuver", name)
    tests = _tests(model, study, maneuver, dimensions)
    cells: dict[tuple[int, ...], Experiment] = {}
    made: dict[tuple[Any, ...], Experiment] = {}
    complete: dict[tuple[Any, ...], Settings] = {}
    for place in itertools.product(*(range(len(v)) for v in dimensions.values())):
        point = {d: dimensions[d][i] for d, i in zip(dimensions, place, strict=True)}
        label = point["method"]
        entry = study.labelled[label]
        given = dict(entry.settings)
        given |= {d: point[d] for d in study.grid if d in declared[label]}
        run = tuple(point[d] for d in (*FACTORS, "start"))
        chosen = (label, *given.values())
        identity = (run, *chosen)
        if chosen not in complete:
            complete[chosen] = complete_settings(model, entry.method, given, entry.preset)
        if identity not in made:
            training, test = tests[run]
            made[identity] = make_experiment(
                model, entry.method, complete[chosen], training, (test,), study.keep
            )
        cells[place] = made[identity]
    for label in study.labelled:
        _some_fits(model, [cell for key, cell in made.items() if key[1] == label])
    return cells


def _tests(
    model: Model, study: StudyFile, maneuver: Maneuver, dimensions: Mapping[str, list[Any]]
) -> dict[tuple[Any, ...], tuple[tuple[Scenario, ...], Scenario]]:
    """Factors and start -> training and test scenarios."""
    pairs = [(pair[0], pair[1]) for pair in study.training_set]
    found: dict[tuple[Any, ...], tuple[tuple[Scenario, ...], Scenario]] = {}
    for run in itertools.product(*(dimensions[d] for d in (*FACTORS, "start"))):
        test = Scenario(maneuver.perturbed(*run[:-1]), run[-1])
        check(model, test)
        found[run] = training_scenarios(test, study.training, pairs, _trained(study)), test
    return found


def _trained(study: StudyFile) -> list[Overrides] | None:
    """Cars that are trained on; None for the tested one."""
    if isinstance(study.cars, str):
        return None if study.cars == "own" else [()]
    return [overrides(table) for table in study.cars]


def _some_fits(model: Model, cells: list[Experiment]) -> None:
    """Raise the first error if no cell of a method has settings that fit the model.

    Corners of a grid may not fit, such as a rank above the number of snapshots; if nothing does,
    the study is wrong.
    """
    first: Failure | None = None
    for cell in cells:
        found = refusal(model, cell)
        # Of a method that refuses the model nothing is set; a bug is a result.
        if found is None or found.status != "rejected" or not cell.settings:
            return
        first = first or found
    if first is not None:
        raise InputError(first.message)
