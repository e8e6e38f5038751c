"""Cells: every combination of a study's grid, complete in itself and keyed by its content."""

import hashlib
import itertools
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from vehiclemor.errors import FileError, InputError
from vehiclemor.maneuvers import Maneuver
from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.settings import Setting, Value, validated
from vehiclemor.reduction.training import POLICIES
from vehiclemor.registry import component, unknown
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model
from vehiclemor.study.definition import FACTORS, StudyFile, values
from vehiclemor.study.provenance import code_digest


@dataclass(frozen=True)
class Cell:
    """One simulation with one method, and all that determines its result.

    Attributes
    ----------
    kernel, code
        Hash of the compiled kernels, and of the source of everything that computes results.
    inputs
        Hash of the output times and the inputs at these times.
    parameters
        Name -> value of the model's parameters, SI units.
    training_set
        (frequency, amplitude) factors of the policy `set`.
    keep
        `trajectories` or `metrics`.
    """

    model: str
    kernel: str
    code: str
    parameters: dict[str, Any]
    maneuver: str
    inputs: str
    frequency_factor: float
    amplitude_factor: float
    start: str
    training: str
    training_set: tuple[tuple[float, float], ...]
    method: str
    settings: dict[str, Value] = field(default_factory=dict)
    keep: str = "trajectories"

    @cached_property
    def configuration(self) -> str:
        """Canonical JSON text of the cell."""
        return json.dumps(asdict(self), sort_keys=True)

    @cached_property
    def key(self) -> str:
        """Hash of the configuration: the name of the cell's file."""
        return hashlib.sha256(self.configuration.encode()).hexdigest()[:20]


@dataclass(frozen=True)
class Grid:
    """Cells of a study on its dimensions.

    Attributes
    ----------
    dimensions
        Name -> values of every grid dimension, the labels of `method` last.
    cells
        Place in the grid (one index per dimension) -> cell.  A dimension that does not concern a
        method has the same cell at all of its places.
    """

    name: str
    definition: StudyFile
    dimensions: dict[str, list[Any]]
    cells: dict[tuple[int, ...], Cell]

    @property
    def unique(self) -> dict[str, Cell]:
        """Key -> cell, each once, in grid order."""
        return {cell.key: cell for cell in self.cells.values()}


def make_cell(
    model: Model,
    maneuver: Maneuver,
    start: str,
    method_name: str,
    settings: dict[str, object],
    preset: str = "recommended",
    training: str = "matched",
    training_set: tuple[tuple[float, float], ...] = (),
    keep: str = "trajectories",
    must_fit: bool = True,
) -> Cell:
    """A validated cell.

    Parameters
    ----------
    must_fit
        Whether settings that are valid, but don't fit the model or each other, are an error here;
        else computing the cell gives the result `rejected`.

    Raises
    ------
    InputError
        If a name, setting or factor is wrong, or does not fit the model.
    """
    method: Method = component("method", method_name)
    complete: dict[str, Value] = {}
    accepted, _ = method.accepts(model)
    # A refusal is a result: what was set for a model of another kind can't be judged here.
    if accepted:
        presets = method.presets(model)
        if preset not in presets:
            raise unknown(f"preset of {method_name}", preset, presets)
        complete = validated(method_name, method.settings(model.kind), settings, presets[preset])
    model.start(start)
    if training not in POLICIES:
        raise unknown("training policy", training, POLICIES)
    if accepted and must_fit:
        method.check(model, complete)
    for pair in training_set:
        maneuver.perturbed(*pair)
    if (training == "set") != bool(training_set):
        raise InputError(
            "the training policy 'set', and no other, needs training_set: factor pairs"
        )
    return Cell(
        model.name,
        model.kernel_hash,
        code_digest(model.name, method_name),
        {name: entry.value for name, entry in model.parameters.entries.items()},
        maneuver.name,
        _input_hash(maneuver),
        maneuver.frequency_factor,
        maneuver.amplitude_factor,
        start,
        training,
        training_set,
        method_name,
        complete,
        keep,
    )


def _input_hash(maneuver: Maneuver) -> str:
    times = maneuver.times
    content = times.tobytes() + np.ascontiguousarray(maneuver.at(times)).tobytes()
    return hashlib.sha256(content).hexdigest()[:16]


def expand(name: str, study: StudyFile) -> Grid:
    """All cells of a study.

    Raises
    ------
    InputError, FileError
        If the study names something unknown or a setting does not fit.
    """
    try:
        return _expand(name, study)
    except InputError as error:
        raise FileError(f"study {name}: {error}") from None


def _expand(name: str, study: StudyFile) -> Grid:
    model = build(study.model)
    definition = component("model", study.model)
    maneuver: Maneuver = component("maneuver", study.maneuver or definition.maneuver)
    methods = {entry.label or entry.method: entry for entry in study.methods}
    dimensions: dict[str, list[Any]] = {factor: [1.0] for factor in FACTORS}
    dimensions |= {key: values(entry) for key, entry in study.grid.items()}
    for factor in FACTORS:
        for value in dimensions[factor]:
            frequency = value if factor == "frequency_factor" else 1.0
            amplitude = value if factor == "amplitude_factor" else 1.0
            maneuver.perturbed(frequency, amplitude)
    dimensions["start"] = list(study.start or [model.starts[0]])
    if len(set(dimensions["start"])) != len(dimensions["start"]):
        raise InputError("start has the same value twice")
    declared: dict[str, Mapping[str, Setting]] = {
        label: component("method", entry.method).settings(model.kind)
        for label, entry in methods.items()
    }
    known_settings = set().union(*declared.values())
    for dimension in study.grid:
        if dimension not in known_settings and dimension not in FACTORS:
            raise unknown("grid dimension", dimension, known_settings | set(FACTORS))
    dimensions["method"] = list(methods)
    cells: dict[tuple[int, ...], Cell] = {}
    made: dict[tuple[Any, ...], Cell] = {}
    for place in itertools.product(*(range(len(v)) for v in dimensions.values())):
        point = {d: dimensions[d][i] for d, i in zip(dimensions, place, strict=True)}
        entry = methods[point["method"]]
        settings: dict[str, object] = dict(entry.settings)
        settings |= {d: point[d] for d in study.grid if d in declared[point["method"]]}
        identity = (
            point["method"],
            point["start"],
            *(point[f] for f in FACTORS),
            *settings.values(),
        )
        if identity not in made:
            made[identity] = make_cell(
                model,
                maneuver.perturbed(*(point[f] for f in FACTORS)),
                point["start"],
                entry.method,
                settings,
                entry.preset,
                study.training,
                tuple((pair[0], pair[1]) for pair in study.training_set),
                study.keep,
                must_fit=False,
            )
        cells[place] = made[identity]
    for label in methods:
        _some_fits(model, [cell for key, cell in made.items() if key[0] == label])
    return Grid(name, study, dimensions, cells)


def _some_fits(model: Model, cells: list[Cell]) -> None:
    """Raise the first error if no cell of a method has settings that fit the model.

    Corners of a grid may not fit, such as a rank above the number of snapshots; if nothing does,
    the study is wrong.
    """
    first: InputError | None = None
    for cell in cells:
        method: Method = component("method", cell.method)
        if not method.accepts(model)[0]:
            return
        try:
            method.check(model, cell.settings)
        except InputError as error:
            first = first or error
        else:
            return
    if first is not None:
        raise first
