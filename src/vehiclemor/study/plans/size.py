"""Size studies: what a full and a reduced run cost, and how accurate they are, over the mesh.

Whole calls are timed in interleaved rounds, all outputs delivered.  The full order of large meshes
is timed on the beginning of the run, and counted as many times as that is shorter.  Errors are
against the finest mesh: those of a reduced model contain those of its mesh.
"""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Sequence
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
from vehiclemor.study.plans.study_file import StudyFile
from vehiclemor.study.result import variables
from vehiclemor.study.store import combined_path, stored
from vehiclemor.study.timing import called

FULL = "full order"
# Groups of outputs, of which the worst error counts: strains are what coarse meshes are worst at.
GROUPS = ("motion", "strain")
ROUNDS = 5


def run_size(name: str, study: StudyFile, folder: Path) -> xr.Dataset:
    """Times and errors on the dimensions `mesh`, `label` and `group`; stored, as are its runs."""
    assert study.size is not None
    if component("model", study.model).kind != "structural":
        raise InputError(f"size: {study.model} is no structure")
    kernel = build(study.model, overrides=study.size.meshes[0]).kernel_hash
    codes = [code_digest(study.model, e.method, dict(e.settings)) for e in study.methods]
    content = [study.model_dump_json(), *codes, kernel, machine(), ROUNDS]
    text = json.dumps([*content, compiler_identity()])
    key = hashlib.sha256(text.encode()).hexdigest()[:16]
    make = partial(_measured, name, study, folder)
    return stored(combined_path(folder, name), "size", key, make, content=content_hash(study))


def _measured(name: str, study: StudyFile, folder: Path) -> xr.Dataset:
    size = study.size
    assert size is not None
    # What can't be had is told before anything is computed.
    beside = [(strongest_full(model), rom(model)) for model in size.beside]
    meshes: list[Any] = [build(study.model, overrides=mesh) for mesh in size.meshes]
    chosen = component("maneuver", study.maneuver).perturbed(size.frequency, size.amplitude)
    with one_thread():
        references = [_reference(model, chosen, size.step, folder) for model in meshes]
        fits = [_fits(study, model) for model in meshes]
        labels = [FULL, *(entry.label or entry.method for entry in study.methods)]
        texts = [[f"{name} {value:g}" for name, value in mesh.items()] for mesh in size.meshes]
        rows = [*map(", ".join, texts), *size.beside]
        n = [model.size for model in meshes] + [len(full.model.coordinates) for full, _ in beside]
        timed = _timed(name, size, list(zip(meshes, fits, strict=True)), beside, chosen, n)
    shape = len(rows), len(labels)
    errors = np.full((*shape, len(GROUPS)), np.nan)
    order, offline = np.full(shape, np.nan), np.full(shape, np.nan)
    truth = references[-1]
    strains = np.array([name.startswith("strain") for name in truth["output"].values])
    scale = signal_range(truth["outputs"].values)
    scale[scale == 0.0] = 1.0
    for row, (reference, own) in enumerate(zip(references, fits, strict=True)):
        found = [reference["outputs"].values]
        found += [model and model.simulate(chosen).outputs for model in own]
        for column, outputs in enumerate(found):
            if outputs is not None:
                relative = rms(outputs - truth["outputs"].values) / scale
                for group, chosen_outputs in enumerate((~strains, strains)):
                    errors[row, column, group] = relative[chosen_outputs].max(initial=0.0)
        for column, model in enumerate(own, start=1):
            if model is not None:
                order[row, column] = model.reduced.order
                offline[row, column] = model.reduced.offline.seconds
    order[:, 0] = n
    for row, (_, reduced) in enumerate(beside, start=len(meshes)):
        order[row, 1], offline[row, 1] = reduced.reduced.order, reduced.reduced.offline.seconds
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


def _fits(study: StudyFile, model: Any) -> list[ReducedOrderModel | None]:
    """Every method of a study fitted to a mesh; none where the mesh is larger than it is made."""
    assert study.size is not None
    found: list[ReducedOrderModel | None] = []
    learned = component("maneuver", str(study.training))
    runs = (TrainingRun(model, learned, model.starts[0]),)
    for entry in study.methods:
        method = component("method", entry.method)
        label, (accepted, _) = entry.label or entry.method, method.accepts(model)
        if not accepted or model.size > study.size.up_to.get(label, model.size):
            found.append(None)
            continue
        tell(f"{label} of {model.name}, n = {model.size}", 0, 1)
        own = {"step_size": study.size.step, **entry.settings}
        settings = validated(method, model.kind, own, entry.preset)
        reduced = fitted(method, model, runs, settings)
        found.append(ReducedOrderModel(model, entry.method, settings.model_dump(), (), reduced))
    return found


def _timed(
    name: str,
    size: Any,
    models: Sequence[tuple[Any, list[ReducedOrderModel | None]]],
    beside: Sequence[tuple[ReducedOrderModel, ReducedOrderModel]],
    maneuver: Maneuver,
    n: Sequence[int],
) -> np.ndarray:
    """Seconds of whole runs (rounds, meshes, labels); NaN where there is none."""
    samples = round(size.window / maneuver.duration * (maneuver.samples - 1)) + 1
    begun = replace(maneuver, duration=size.window, samples=samples)
    calls: dict[tuple[int, int], tuple[Any, float]] = {}
    for row, (model, fits) in enumerate(models):
        short = n[row] > size.whole
        run, factor = (begun, maneuver.duration / size.window) if short else (maneuver, 1.0)
        calls[row, 0] = partial(model.run, run, step=size.step), factor
        for column, reduced in enumerate(fits, start=1):
            if reduced is not None:
                calls[row, column] = partial(reduced.simulate, maneuver), 1.0
    for row, pair in enumerate(beside, start=len(models)):
        for column, reduced in enumerate(pair):
            calls[row, column] = partial(reduced.simulate), 1.0
    columns = 1 + max(column for _, column in calls)
    seconds = np.full((ROUNDS, len(n), columns), np.nan)
    for turn in range(ROUNDS):
        for done, ((row, column), (call, factor)) in enumerate(calls.items()):
            tell(f"{name}: round {turn + 1} of {ROUNDS}", done, len(calls))
            found = called(call, 2)
            seconds[turn, row, column] = np.nan if isinstance(found, Failure) else factor * found[0]
    return seconds
