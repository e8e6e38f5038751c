"""Size studies: what a full and a reduced run cost, and how accurate they are, over the mesh.

Whole calls are timed in interleaved rounds, all outputs delivered.  The full order of large meshes
is timed on the beginning of the run, and counted as many times as that is shorter.  Errors are
against the finest mesh: those of a reduced model contain those of its mesh.
"""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from vehiclemor.codegen.cache import compiler_identity
from vehiclemor.exceptions import InputError
from vehiclemor.failure import Failure
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.metrics import rms, signal_range
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
ROUNDS = 5
# What runs a maneuver, the maneuver or its beginning, and how many times as long the whole is.
Call = tuple[Callable[[Maneuver], Any], Maneuver, float]


def run_size(name: str, study: SizeFile, folder: Path) -> xr.Dataset:
    """Times and errors on the dimensions `mesh`, `label` and `group`; stored, as are its runs."""
    if component("model", study.model).kind != "structural":
        raise InputError(f"size: {study.model} is no structure")
    kernel = build(study.model, overrides=study.size.meshes[0]).kernel_hash
    codes = [code_digest(study.model, e.method, dict(e.settings)) for e in study.methods]
    content = [study.model_dump_json(), *codes, kernel, machine(), ROUNDS]
    text = json.dumps([*content, compiler_identity()])
    key = hashlib.sha256(text.encode()).hexdigest()[:16]
    make = partial(_measured, name, study, study.size, folder)
    return stored(combined_path(folder, name), "size", key, make, content=content_hash(study))


def _measured(name: str, study: SizeFile, size: Size, folder: Path) -> xr.Dataset:
    # What can't be had is told before anything is computed.
    beside = [(strongest_full(model), rom(model)) for model in size.beside]
    meshes: list[Any] = [build(study.model, overrides=mesh) for mesh in size.meshes]
    chosen = component("maneuver", study.maneuver).perturbed(size.frequency, size.amplitude)
    labels, vehicles = [FULL, *study.labelled], range(len(meshes), len(meshes) + len(beside))
    texts = [[f"{name} {value:g}" for name, value in mesh.items()] for mesh in size.meshes]
    rows = [*map(", ".join, texts), *size.beside]
    n = [model.size for model in meshes] + [len(full.model.coordinates) for full, _ in beside]
    with one_thread():
        references = [_reference(model, chosen, size.step, folder) for model in meshes]
        # Reduced models by mesh and label.
        models = {
            (row, column): reduced
            for row, model in enumerate(meshes)
            for column, entry in enumerate(study.methods, start=1)
            if (reduced := _fit(study, size, entry, model))
        }
        calls = {place: (model.simulate, chosen, 1.0) for place, model in models.items()}
        calls |= {(row, 0): _full(model, chosen, size) for row, model in enumerate(meshes)}
        for row, (full, reduced) in zip(vehicles, beside, strict=True):
            models[row, 1] = reduced
            steering = component("maneuver", full.model.definition.maneuver)
            calls[row, 0] = full.simulate, steering, 1.0
            calls[row, 1] = reduced.simulate, steering, 1.0
        timed = _timed(name, calls, (len(rows), len(labels)))
    outputs = {(row, 0): reference["outputs"].values for row, reference in enumerate(references)}
    order, offline = np.full((2, len(rows), len(labels)), np.nan)
    order[:, 0] = n
    for place, model in models.items():
        order[place], offline[place] = model.reduced.order, model.reduced.offline.seconds
        if place[0] not in vehicles:
            outputs[place] = model.simulate(chosen).outputs
    truth = references[-1]["outputs"]
    strains = np.array([output.startswith("strain") for output in truth["output"].values])
    scale = signal_range(truth.values)
    scale[scale == 0.0] = 1.0
    errors = np.full((*order.shape, len(GROUPS)), np.nan)
    for place, found in outputs.items():
        relative = rms(found - truth.values) / scale
        errors[place] = [relative[group].max(initial=0.0) for group in (~strains, strains)]
    with warnings.catch_warnings():
        # What is not made of a mesh was never timed.
        warnings.filterwarnings("ignore", "All-NaN slice")
        seconds, lower, upper = np.nanquantile(timed, (0.5, 0.25, 0.75), axis=0)
    found = variables({"coordinates_of_mesh": np.array(n)}, "mesh")
    found |= variables(
        {"seconds_median": seconds, "seconds_lower": lower, "seconds_upper": upper}
        | {"effective_rank": order, "offline_seconds": offline},
        *("mesh", "label"),
    )
    found |= variables({"relative_error": errors}, "mesh", "label", "group")
    # What is refined first: meshes of one kind make one line.
    kinds = [next(iter(mesh)) for mesh in size.meshes] + ["vehicle"] * len(beside)
    coordinates = {"mesh": rows, "label": labels, "group": list(GROUPS), "kind": ("mesh", kinds)}
    title = attributes(study.title, meshes[0].kernel_hash, study=name, model=study.model)
    own = {"configuration": study.model_dump_json(exclude_defaults=True)}
    return xr.Dataset(found, coordinates, title | own)


def strongest_full(name: str) -> ReducedOrderModel:
    """The fastest full order within the bounds of the studies, of one of the paper's models."""
    model, method = build(name), component("method", "full_order")
    settings = validated(method, model.kind, {}, "strongest")
    return ReducedOrderModel(model, method.name, {}, (), method.fit(model, (), settings))


def _reference(model: Any, maneuver: Maneuver, step: float, folder: Path) -> xr.Dataset:
    """Stored full-order outputs of a run; they do not depend on the machine."""
    parameters = json.dumps({k: e.value for k, e in model.parameters.entries.items()})
    parts = model.kernel_hash, code_digest(model.name, "full_order", {}), parameters
    run = maneuver.name, maneuver.frequency_factor, maneuver.amplitude_factor, step
    key = hashlib.sha256(json.dumps([parts, run]).encode()).hexdigest()[:16]

    def make() -> xr.Dataset:
        tell(f"full order of {model.name}, n = {model.size}", 0, 1)
        found = model.run(maneuver, step=step)
        table = {"outputs": (("time", "output"), found.outputs), "steps": found.counts["steps"]}
        labels = {"time": found.times, "output": list(model.outputs)}
        about = attributes(f"full order of {model.name}", model.kernel_hash)
        return xr.Dataset(table, labels, about)

    return stored(folder / "references" / f"{key}.nc", "reference", key, make)


def _fit(study: SizeFile, size: Size, entry: MethodEntry, model: Any) -> ReducedOrderModel | None:
    """A method fitted to a mesh; none where the mesh is larger than it is made."""
    method, label = component("method", entry.method), entry.name
    if not method.accepts(model)[0] or model.size > size.up_to.get(label, model.size):
        return None
    tell(f"{label} of {model.name}, n = {model.size}", 0, 1)
    runs = (TrainingRun(model, component("maneuver", study.training), model.starts[0]),)
    own = {"step_size": size.step, **entry.settings}
    settings = validated(method, model.kind, own, entry.preset)
    reduced = fitted(method, model, runs, settings)
    return ReducedOrderModel(model, entry.method, settings.model_dump(), (), reduced)


def _full(model: Any, maneuver: Maneuver, size: Size) -> Call:
    """The full order of a mesh: of a large one its beginning."""
    if model.size <= size.whole:
        return partial(model.run, step=size.step), maneuver, 1.0
    samples = round(size.window / maneuver.duration * (maneuver.samples - 1)) + 1
    begun = replace(maneuver, duration=size.window, samples=samples)
    return partial(model.run, step=size.step), begun, maneuver.duration / size.window


def _timed(name: str, calls: Mapping[tuple[int, int], Call], shape: tuple[int, int]) -> np.ndarray:
    """Seconds of whole runs (rounds, meshes, labels); NaN where there is none."""
    seconds = np.full((ROUNDS, *shape), np.nan)
    for turn in range(ROUNDS):
        for done, place in enumerate(sorted(calls)):
            tell(f"{name}: round {turn + 1} of {ROUNDS}", done, len(calls))
            simulate, maneuver, factor = calls[place]
            measured = called(simulate, (maneuver,), 2, again=False)
            if not isinstance(measured, Failure):
                seconds[turn, *place] = factor * measured.whole
    return seconds
