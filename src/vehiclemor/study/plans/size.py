"""Size studies: what a full and a reduced run cost, and how accurate they are, over the mesh.

Whole calls are timed in interleaved rounds, all outputs delivered.  The full order of large meshes
is timed on the beginning of the run, and counted as many times as that is shorter.  Errors are
against the finest mesh: those of a reduced model contain those of its mesh.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from vehiclemor.codegen.cache import compiler_identity
from vehiclemor.error_measures import rms, signal_range
from vehiclemor.exceptions import InputError
from vehiclemor.failure import Failure
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.progress import tell
from vehiclemor.provenance import attributes, code_digest, machine
from vehiclemor.reduction.reduced_model import ReducedOrderModel, rom
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.validation import fitted, validated
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.simulation.run_timer import one_thread
from vehiclemor.study.plans.loading import content_hash
from vehiclemor.study.plans.study_file import MethodEntry, SizeFile
from vehiclemor.study.plans.study_runs import Size
from vehiclemor.study.result import variables
from vehiclemor.study.store import combined_path, stored
from vehiclemor.study.timing import called

FULL = "full order"
# Groups of outputs, of which the worst error counts: strains are what coarse meshes are worst at.
GROUPS = ("motion", "strain")
# Of each model.
COLUMNS = (
    *("effective_rank", "offline_seconds"),
    *("seconds_median", "seconds_lower", "seconds_upper"),
)
ROUNDS = 5


@dataclass(frozen=True)
class SizedModel:
    """A full or reduced model of a mesh: what runs it, and on what.

    `mesh` and `label` are indices in the result.  The study's maneuver is `factor` times as long as
    the one that is timed.
    """

    mesh: int
    label: int
    simulate: Callable[[Excitation], Any]
    maneuver: Excitation
    order: int
    offline_seconds: float = np.nan
    factor: float = 1.0


def run_size(name: str, study: SizeFile, folder: Path) -> xr.Dataset:
    """Times and errors on the dimensions `mesh`, `label` and `group`; stored, as are its runs."""
    if component("model", study.model).kind != "structural":
        raise InputError(f"size: {study.model} is no structure")
    kernel = build(study.model, overrides=study.size.meshes[0]).kernel_hash
    codes = [code_digest(study.model, e.method) for e in study.methods]
    content = [study.model_dump_json(), *codes, kernel, machine(), ROUNDS]
    text = json.dumps([*content, compiler_identity()])
    key = hashlib.sha256(text.encode()).hexdigest()[:16]
    make = partial(_measured, name, study, folder)
    return stored(combined_path(folder, name), "size", key, make, content=content_hash(study))


def _measured(name: str, study: SizeFile, folder: Path) -> xr.Dataset:
    size, maneuver = study.size, component("maneuver", study.maneuver)
    maneuver = maneuver.perturbed(size.frequency, size.amplitude)
    # A model that does not ship is named before anything is computed.
    vehicles = [(strongest_full(vehicle), rom(vehicle)) for vehicle in size.beside]
    meshes: list[Any] = [build(study.model, overrides=mesh) for mesh in size.meshes]
    with one_thread():
        references = [_reference(mesh, maneuver, size.step, folder) for mesh in meshes]
        models: list[SizedModel] = []
        for index, mesh in enumerate(meshes):
            models.append(_full(index, mesh, maneuver, size))
            for label, entry in enumerate(study.methods, start=1):
                if reduced := _fit(study, entry, mesh):
                    models.append(_reduced(index, label, reduced, maneuver))
        for index, (full, reduced) in enumerate(vehicles, start=len(meshes)):
            steering = component("maneuver", full.model.definition.maneuver)
            coordinates = len(full.model.coordinates)
            models.append(SizedModel(index, 0, full.simulate, steering, coordinates))
            models.append(_reduced(index, 1, reduced, steering))
        seconds = _timed(name, models)
    kinds = [next(iter(mesh)) for mesh in size.meshes] + ["vehicle"] * len(vehicles)
    labels = {
        "mesh": [*map(_mesh_text, size.meshes), *size.beside],
        "label": [FULL, *study.labelled],
        "group": list(GROUPS),
        # What is refined first: meshes of one kind make one line.
        "kind": ("mesh", kinds),
    }
    shape = len(kinds), len(study.methods) + 1
    columns = _costs(models, seconds, shape)
    errors = np.full((*shape, len(GROUPS)), np.nan)
    truth = references[-1]["outputs"]
    for model in models:
        if model.mesh < len(meshes):
            run = model.simulate(maneuver) if model.label else references[model.mesh]
            errors[model.mesh, model.label] = _errors(run, truth)
    columns |= variables({"relative_error": errors}, "mesh", "label", "group")
    text = study.model_dump_json(exclude_defaults=True)
    about = {"study": name, "model": study.model, "configuration": text}
    return xr.Dataset(columns, labels, attributes(study.title, meshes[0].kernel_hash, **about))


def _costs(
    models: Sequence[SizedModel], seconds: np.ndarray, shape: tuple[int, int]
) -> dict[str, tuple]:
    """Orders and times on the dimensions `mesh` and `label`, of seconds (rounds, models)."""
    table = {name: np.full(shape, np.nan) for name in COLUMNS}
    quantiles = np.quantile(seconds, (0.5, 0.25, 0.75), axis=0)
    for model, quartiles in zip(models, quantiles.T, strict=True):
        row = model.order, model.offline_seconds, *quartiles
        for name, value in zip(COLUMNS, row, strict=True):
            table[name][model.mesh, model.label] = value
    coordinates = table["effective_rank"][:, 0].astype(int)
    columns = variables({"coordinates_of_mesh": coordinates}, "mesh")
    return columns | variables(table, "mesh", "label")


def _mesh_text(mesh: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in mesh.items())


def _errors(run: Any, truth: xr.DataArray) -> list[float]:
    """Largest RMS error of a run in each group of outputs, over the range on the finest mesh."""
    scale = signal_range(truth.values)
    scale[scale == 0.0] = 1.0
    relative = rms(np.asarray(run.outputs) - truth.values) / scale
    strains = np.array([output.startswith("strain") for output in truth["output"].values])
    return [relative[group].max(initial=0.0) for group in (~strains, strains)]


def strongest_full(name: str) -> ReducedOrderModel:
    """The fastest full order within the bounds of the studies, of one of the paper's models."""
    model, method = build(name), component("method", "full_order")
    settings = validated(method, model.kind, {}, "strongest")
    return ReducedOrderModel(model, method.name, {}, (), method.fit(model, (), settings))


def _reference(model: Any, maneuver: Excitation, step: float, folder: Path) -> xr.Dataset:
    """Stored full-order outputs of a run; they do not depend on the machine."""
    parameters = json.dumps({k: e.value for k, e in model.parameters.entries.items()})
    parts = model.kernel_hash, code_digest(model.name, "full_order"), parameters
    run = maneuver.name, maneuver.frequency_factor, maneuver.amplitude_factor, step
    key = hashlib.sha256(json.dumps([parts, run]).encode()).hexdigest()[:16]

    def make() -> xr.Dataset:
        tell(f"full order of {model.name}, n = {model.size}", 0, 1)
        run = model.run(maneuver, step=step)
        table = {"outputs": (("time", "output"), run.outputs), "steps": run.counts["steps"]}
        labels = {"time": run.times, "output": list(model.outputs)}
        about = attributes(f"full order of {model.name}", model.kernel_hash)
        return xr.Dataset(table, labels, about)

    return stored(folder / "references" / f"{key}.nc", "reference", key, make)


def _fit(study: SizeFile, entry: MethodEntry, mesh: Any) -> ReducedOrderModel | None:
    """A method fitted to a mesh; none where the mesh is larger than the method is fitted to."""
    method, size = component("method", entry.method), study.size
    if not method.accepts(mesh)[0] or mesh.size > size.up_to.get(entry.name, mesh.size):
        return None
    tell(f"{entry.name} of {mesh.name}, n = {mesh.size}", 0, 1)
    runs = (TrainingRun(mesh, component("maneuver", study.training), mesh.starts[0]),)
    chosen = {"step_size": size.step, **entry.settings}
    settings = validated(method, mesh.kind, chosen, entry.preset)
    reduced = fitted(method, mesh, runs, settings)
    return ReducedOrderModel(mesh, entry.method, settings.model_dump(), (), reduced)


def _reduced(mesh: int, label: int, model: ReducedOrderModel, maneuver: Maneuver) -> SizedModel:
    fit = model.reduced
    return SizedModel(mesh, label, model.simulate, maneuver, fit.order, fit.offline.seconds)


def _full(mesh: int, model: Any, maneuver: Maneuver, size: Size) -> SizedModel:
    """The full order of a mesh; that of a large mesh is timed on the beginning of the run."""
    simulate = partial(model.run, step=size.step)
    if model.size <= size.whole:
        return SizedModel(mesh, 0, simulate, maneuver, model.size)
    samples = round(size.window / maneuver.duration * (maneuver.samples - 1)) + 1
    beginning = replace(maneuver, duration=size.window, samples=samples)
    factor = maneuver.duration / size.window
    return SizedModel(mesh, 0, simulate, beginning, model.size, factor=factor)


def _timed(name: str, models: Sequence[SizedModel]) -> np.ndarray:
    """Seconds of runs (rounds, models); NaN of those that fail."""
    seconds = np.full((ROUNDS, len(models)), np.nan)
    for turn in range(ROUNDS):
        for number, model in enumerate(models):
            tell(f"{name}: round {turn + 1} of {ROUNDS}", number, len(models))
            measured = called(model.simulate, (model.maneuver,), 2, again=False)
            if not isinstance(measured, Failure):
                seconds[turn, number] = model.factor * measured.call
    return seconds
