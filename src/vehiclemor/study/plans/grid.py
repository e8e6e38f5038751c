"""Grids: every combination of a study file's values, each an experiment with one test scenario."""

import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from vehiclemor.exceptions import FileError, GeometryError, InputError, PlugInError, VehiclemorError
from vehiclemor.failure import attempt
from vehiclemor.registry import component, unknown
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model
from vehiclemor.study.evaluate import check_method
from vehiclemor.study.experiment import (
    Experiment,
    complete_settings,
    default_settings,
    make_experiment,
)
from vehiclemor.study.plans.logs import windows
from vehiclemor.study.plans.study_file import GridFile, MethodEntry
from vehiclemor.study.plans.study_runs import FACTORS, PARAMETER, TEXTS, values
from vehiclemor.study.plans.training import training_set
from vehiclemor.study.scenario import Overrides, Scenario, check, overrides, with_parameters

# Histories of a study that are held at once.
MOST_BYTES = 4e9


@dataclass(frozen=True, eq=False)
class Grid:
    """Experiments of a study on its dimensions, the last of which is `label`.

    `keys` are those of the experiments at all points; `experiments` have each once, by its key.
    """

    name: str
    definition: GridFile
    model: Model
    dimensions: dict[str, list[Any]]
    keys: np.ndarray
    experiments: dict[str, Experiment]


def expand(name: str, study: GridFile, folder: Path = Path()) -> Grid:
    """All experiments of a study, whose logs are in a folder.

    `FileError` if it names something unknown or unfit.
    """
    try:
        model = build(study.model, overrides=study.parameters)
        dimensions = _dimensions(model, study)
        driven = _driven(model, study, folder)
        if study.logs:
            dimensions = {"maneuver": [*driven]} | dimensions
        if study.keep == "trajectories":
            _check_histories(model, driven, dimensions)
        keys = np.empty([len(entry) for entry in dimensions.values()], object)
        experiments: dict[str, Experiment] = {}
        axes = {name: points for name, points in dimensions.items() if name != "label"}
        for number, entry in enumerate(study.methods):
            of_method = list(_of_method(model, study, entry, axes, driven))
            # Settings that a method does not have give no further experiments of it.
            experiments |= {experiment.key: experiment for experiment in of_method}
            keys_of_method = np.array([experiment.key for experiment in of_method], object)
            keys[..., number] = keys_of_method.reshape(keys.shape[:-1])
    except PlugInError:
        raise
    except (InputError, GeometryError) as error:
        raise FileError(f"study {name}: {error}") from None
    return Grid(name, study, model, dimensions, keys, experiments)


def _dimensions(model: Model, study: GridFile) -> dict[str, list[Any]]:
    """Name -> values of every dimension, checked."""
    settings = {s for entry in study.methods for s in default_settings(model, entry.method)}
    known = settings | {*FACTORS, *TEXTS} | {f"{PARAMETER}{n}" for n in model.parameters.entries}
    for dimension in study.grid:
        if dimension not in known and not dimension.startswith(PARAMETER):
            raise unknown("grid dimension", dimension, known)
    dimensions: dict[str, list[Any]] = {name: [1.0] for name in FACTORS}
    dimensions |= {key: values(entry) for key, entry in study.grid.items()}
    dimensions.setdefault("start", list(study.start or [model.starts[0]]))
    if len(set(dimensions["start"])) != len(dimensions["start"]):
        raise InputError("start has the same value twice")
    return dimensions | {"label": list(study.labelled)}


def _driven(model: Model, study: GridFile, folder: Path) -> dict[str, Scenario]:
    """What drives the runs, by its name on the axis of maneuvers."""
    if not study.logs:
        axis = study.grid.get("maneuver", [study.maneuver or model.definition.maneuver])
        names = [str(name) for name in values(axis)]
        return {name: Scenario(component("maneuver", name), model.starts[0]) for name in names}
    every = [run for log in study.logs for run in windows(model, log, folder)]
    windows_of = Counter(run.maneuver.name for run in every)
    driven: dict[str, Scenario] = {}
    for run in every:
        name = run.maneuver.name
        # Windows that a log runs with several factors are told apart by these.
        driven[name if windows_of[name] == 1 else run.label] = run
    if len(driven) < len(every):
        raise InputError("two windows of logs have the same name: give one log a name")
    return driven


def _check_histories(
    model: Model, driven: Mapping[str, Scenario], dimensions: Mapping[str, list[Any]]
) -> None:
    """Raise `InputError` if the histories of all runs can't be held, or not side by side."""
    first, *others = [run.maneuver for run in driven.values()]
    number = math.prod(map(len, dimensions.values()))
    columns = len(model.definition.states) + 2 * len(model.outputs)
    size = 8.0 * first.samples * columns * number
    if size > MOST_BYTES:
        raise InputError(
            f"histories of {number} runs take {size / 1e9:.0f} GB, more than {MOST_BYTES / 1e9:g}: "
            'give keep = "metrics", or make several studies of it'
        )
    if any(not np.array_equal(first.times, other.times) for other in others):
        raise InputError('maneuvers of other output times need keep = "metrics"')


def _of_method(
    model: Model,
    study: GridFile,
    entry: MethodEntry,
    axes: Mapping[str, list[Any]],
    driven: Mapping[str, Scenario],
) -> Iterator[Experiment]:
    """Experiments of a method at all points; `InputError` if its settings fit at none of them.

    Corners of a grid may not fit, such as a rank above the number of snapshots.
    """
    names = set(default_settings(model, entry.method))
    first_refusal, fits = "", False
    only = next(iter(driven))
    factors = tuple((one, other) for one, other in study.training_set)
    for coordinates in itertools.product(*axes.values()):
        point = dict(zip(axes, coordinates, strict=True))
        given = entry.settings | {d: point[d] for d in study.grid if d in names}
        settings = _complete(model, entry.method, tuple(given.items()), entry.preset)
        parameters = {
            n.removeprefix(PARAMETER): v for n, v in point.items() if n.startswith(PARAMETER)
        }
        run = driven[str(point.get("maneuver", only))]
        of_run = tuple(point[f] for f in FACTORS)
        test = _checked(model, run, of_run, point["start"], overrides(parameters))
        training = entry.training or point.get("training", study.training)
        training = tuple(training) if isinstance(training, list) else (training,)
        learner = entry.method if "protocol" in training else ""
        # A method may learn from something else than the study's set.
        of_entry = () if entry.training and "set" not in training else factors
        learned = _training(model, learner, training, test, of_entry)
        experiment = make_experiment(model, entry.method, settings, learned, (test,), study.keep)
        if not fits:
            failure = attempt(partial(check_method, model, experiment))
            # Of a method that refuses the model nothing is set; a bug is a result.
            fits = failure is None or failure.status != "rejected" or not settings
            if failure and not first_refusal:
                first_refusal = failure.message
        yield experiment
    if not fits:
        raise InputError(first_refusal)


@lru_cache(maxsize=4096)
def _complete(
    model: Model, method: str, given: tuple[tuple[str, Any], ...], preset: str
) -> dict[str, Any]:
    return complete_settings(model, method, dict(given), preset)


@lru_cache(maxsize=4096)
def _checked(
    model: Model, run: Scenario, factors: tuple[float, float], start: str, parameters: Overrides
) -> Scenario:
    """A test scenario; `InputError` if the model can't be built or run so."""
    try:
        with_parameters(model, parameters)
    except VehiclemorError as error:
        given = ", ".join(f"{name} = {value}" for name, value in parameters)
        raise InputError(f"{given}: {error}") from None
    driven = run.maneuver.perturbed(*factors)
    scenario = replace(run, maneuver=driven, start=start, parameters=parameters)
    check(model, scenario)
    return scenario


_training = lru_cache(maxsize=4096)(training_set)
