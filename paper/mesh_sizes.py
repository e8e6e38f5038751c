"""What a full and a reduced run of the truck cost, and how accurate they are, over the mesh.

Usage: python paper/mesh_sizes.py [--results DIR]

Writes DIR/mesh_sizes.nc, which `paper/measured_numbers.py` reads, in tens of minutes, and prints
it.  Needs the extra `shells`.  Whole calls are timed in interleaved rounds, all outputs delivered.
The full order of large meshes is timed on the beginning of the run, and counted as many times as
that is shorter.  Errors are against the finest mesh: those of a reduced model contain those of its
mesh.  The paper's models stand beside.
"""

from __future__ import annotations

import argparse
import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import vehiclemor as vm
from vehiclemor.error_measures import rms, signal_range
from vehiclemor.failure import Failure
from vehiclemor.files import make_folder
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.netcdf_file import write_dataset
from vehiclemor.provenance import attributes, code_digest
from vehiclemor.reduction.reduced_model import ReducedOrderModel
from vehiclemor.report.labels import Column
from vehiclemor.report.printing import Table
from vehiclemor.simulation.run_timer import one_thread
from vehiclemor.study.result import variables
from vehiclemor.study.store import stored
from vehiclemor.study.timing import called

TRUCK, ROAD, TRAINING, FREQUENCY = "flexible_truck", "road:7", "road:1", 1.1
# Parameters of each mesh, the finest last: what is refined first.
MESHES: list[dict[str, float]] = [
    *({"elements_per_bay": number} for number in (1, 2, 4, 8, 16, 32)),
    *({"shell_size": size} for size in (0.35, 0.25, 0.125, 0.0625, 0.04)),
]
# Label -> method and settings.  Training of POD is a full run: coordinates of the largest mesh.
METHODS: dict[str, tuple[str, dict[str, Any]]] = {
    "Craig-Bampton": ("craig_bampton", {"highest": 100.0}),
    "modal truncation": ("modal_truncation", {"highest": 100.0}),
    "POD, r = 11": ("fixed_basis", {"rank": 11}),
    "POD, r = 21": ("fixed_basis", {"rank": 21}),
}
LARGEST_OF_POD = 2000
VEHICLES = ("double_wishbone", "independent_suspension_vehicle", "high_fidelity_vehicle")
# Step of all runs in s; coordinates up to which full order is timed over the run; s of it beyond.
STEP, WHOLE, WINDOW = 1e-3, 1000, 1.0
FULL = "full order"
# Groups of outputs, of which the worst error counts: strains are what coarse meshes are worst at.
GROUPS = ("motion", "strain")
# Of each model.
COLUMNS = (
    *("effective_rank", "offline_seconds"),
    *("seconds_median", "seconds_lower", "seconds_upper"),
)
ROUNDS = 5
# Kinds of meshes in words, with the unit of what is refined.
KINDS = {"elements_per_bay": ("beams", "a bay"), "shell_size": ("shells", "m")}
# Exponents are fitted over meshes of at least so many coordinates: smaller ones are all overhead.
GROWING = 300
Row = dict[str, Any]
COSTS = {
    "mesh": Column("mesh"),
    "coordinates": Column("n", ".0f"),
    "label": Column("reduced model"),
    "order": Column("r", ".0f"),
    "full_seconds": Column("full, s", ".3g"),
    "seconds": Column("reduced, s", ".3g"),
    "gain_mesh": Column("times faster", ".3g", "than the full model on the same mesh"),
    "offline_seconds": Column("offline, s", ".2g", "CPU time of training and fit"),
    "break_even": Column("break-even, runs", ".2g", "after which the offline cost is saved"),
}
RIVALS = {"mesh": Column("mesh"), "label": Column("reduced model")}
for _group in GROUPS:
    RIVALS[f"error_{_group}"] = Column(f"{_group}, error", ".1e")
    RIVALS[f"rival_{_group}"] = Column("cheapest full")
    RIVALS[f"gain_{_group}"] = Column("times faster", ".3g")
EXPLAINED = (
    "Errors: worst RMS error of the group against the finest mesh, over the output's range. "
    "Cheapest full: the full model, on any mesh, that is at least as accurate."
)


@dataclass(frozen=True)
class SizedModel:
    """A full or reduced model of a mesh: what runs it, and on what.

    `mesh` and `label` are indices in the result.  The maneuver is `factor` times as long as the one
    that is timed.
    """

    mesh: int
    label: int
    simulate: Callable[[Excitation], Any]
    maneuver: Excitation
    order: int
    offline_seconds: float = np.nan
    factor: float = 1.0


def measured(folder: Path) -> xr.Dataset:
    """Times and errors on the dimensions `mesh`, `label` and `group`."""
    road = vm.maneuver(ROAD, frequency=FREQUENCY)
    # A model that does not ship is named before anything is computed.
    vehicles = [
        (vm.reduce(name, "full_order", preset="strongest"), vm.rom(name)) for name in VEHICLES
    ]
    meshes: list[Any] = [vm.model(TRUCK, mesh) for mesh in MESHES]
    with one_thread():
        references = [_reference(mesh, road, folder) for mesh in meshes]
        models: list[SizedModel] = []
        for index, mesh in enumerate(meshes):
            models.append(_full(index, mesh, road))
            for label, (method, settings) in enumerate(METHODS.values(), start=1):
                if method != "fixed_basis" or mesh.size <= LARGEST_OF_POD:
                    print(f"{method} of {mesh.name}, n = {mesh.size}")
                    chosen = {"step_size": STEP, **settings}
                    reduced = vm.reduce(mesh, method, training=TRAINING, **chosen)
                    models.append(_reduced(index, label, reduced, road))
        for index, (full, reduced) in enumerate(vehicles, start=len(meshes)):
            steering = vm.maneuver(full.model.definition.maneuver)
            coordinates = len(full.model.coordinates)
            models.append(SizedModel(index, 0, full.simulate, steering, coordinates))
            models.append(_reduced(index, 1, reduced, steering))
        seconds = _timed(models)
    kinds = [next(iter(mesh)) for mesh in MESHES] + ["vehicle"] * len(vehicles)
    labels = {
        "mesh": [*map(_mesh_name, MESHES), *VEHICLES],
        "label": [FULL, *METHODS],
        "group": list(GROUPS),
        # What is refined first: meshes of one kind make one line.
        "kind": ("mesh", kinds),
    }
    shape = len(kinds), len(METHODS) + 1
    columns = _costs(models, seconds, shape)
    errors = np.full((*shape, len(GROUPS)), np.nan)
    truth = references[-1]["outputs"]
    for model in models:
        if model.mesh < len(meshes):
            run = model.simulate(road) if model.label else references[model.mesh]
            errors[model.mesh, model.label] = _errors(run, truth)
    columns |= variables({"relative_error": errors}, "mesh", "label", "group")
    title = "Full and reduced truck over the mesh of its frame"
    return xr.Dataset(columns, labels, attributes(title, meshes[0].kernel_hash))


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


def _mesh_name(mesh: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in mesh.items())


def _errors(run: Any, truth: xr.DataArray) -> list[float]:
    """Largest RMS error of a run in each group of outputs, over the range on the finest mesh."""
    scale = signal_range(truth.values)
    scale[scale == 0.0] = 1.0
    relative = rms(np.asarray(run.outputs) - truth.values) / scale
    strains = np.array([output.startswith("strain") for output in truth["output"].values])
    return [relative[group].max(initial=0.0) for group in (~strains, strains)]


def _reference(model: Any, maneuver: Excitation, folder: Path) -> xr.Dataset:
    """Stored full-order outputs of a run; they do not depend on the machine."""
    parameters = json.dumps({k: e.value for k, e in model.parameters.entries.items()})
    parts = model.kernel_hash, code_digest(model.name, "full_order"), parameters
    run = maneuver.name, maneuver.frequency_factor, maneuver.amplitude_factor, STEP
    key = hashlib.sha256(json.dumps([parts, run]).encode()).hexdigest()[:16]

    def make() -> xr.Dataset:
        print(f"full order of {model.name}, n = {model.size}")
        run = model.run(maneuver, step=STEP)
        table = {"outputs": (("time", "output"), run.outputs), "steps": run.counts["steps"]}
        labels = {"time": run.times, "output": list(model.outputs)}
        about = attributes(f"full order of {model.name}", model.kernel_hash)
        return xr.Dataset(table, labels, about)

    return stored(folder / "references" / f"{key}.nc", "reference", key, make)


def _reduced(mesh: int, label: int, model: ReducedOrderModel, maneuver: Excitation) -> SizedModel:
    fit = model.reduced
    return SizedModel(mesh, label, model.simulate, maneuver, fit.order, fit.offline.seconds)


def _full(mesh: int, model: Any, maneuver: Maneuver) -> SizedModel:
    """The full order of a mesh; that of a large mesh is timed on the beginning of the run."""
    simulate = partial(model.run, step=STEP)
    if model.size <= WHOLE:
        return SizedModel(mesh, 0, simulate, maneuver, model.size)
    samples = round(WINDOW / maneuver.duration * (maneuver.samples - 1)) + 1
    beginning = replace(maneuver, duration=WINDOW, samples=samples)
    factor = maneuver.duration / WINDOW
    return SizedModel(mesh, 0, simulate, beginning, model.size, factor=factor)


def _timed(models: Sequence[SizedModel]) -> np.ndarray:
    """Seconds of runs (rounds, models); NaN of those that fail."""
    seconds = np.full((ROUNDS, len(models)), np.nan)
    for turn in range(ROUNDS):
        print(f"round {turn + 1} of {ROUNDS}")
        for number, model in enumerate(models):
            calls = called(model.simulate, (model.maneuver,), 2, again=False)
            if not isinstance(calls, Failure):
                seconds[turn, number] = model.factor * calls.call
    return seconds


# As rows.


def size_rows(dataset: xr.Dataset) -> Iterator[Row]:
    """A row for each reduced model on each mesh: its gains, errors, rivals and offline cost.

    `rival_*` is the cheapest full model, on any mesh, whose error in that group of outputs is no
    larger; the reduced model is so many times faster (`gain_*`).
    """
    seconds, n = dataset["seconds_median"], dataset["coordinates_of_mesh"].values
    full = seconds.sel(label=FULL).values
    for mesh in range(dataset.sizes["mesh"]):
        kind = str(dataset["kind"].values[mesh])
        for label in dataset["label"].values.tolist()[1:]:
            reduced = dataset.isel(mesh=mesh).sel(label=label)
            time, offline = float(reduced["seconds_median"]), float(reduced["offline_seconds"])
            if not np.isfinite(time):
                continue
            saved = full[mesh] - time
            row: Row = {
                "mesh": mesh_text(dataset, mesh),
                "mesh_kind": kind,
                "coordinates": int(n[mesh]),
                "label": "chosen by its protocol" if kind == "vehicle" else label,
                "order": float(reduced["effective_rank"]),
                "full_seconds": float(full[mesh]),
                "seconds": time,
                "gain_mesh": float(full[mesh] / time),
                "offline_seconds": offline,
                "growth_full": growth(dataset, kind, FULL),
                "growth": growth(dataset, kind, label),
                "break_even": float(offline / saved) if saved > 0.0 else np.nan,
            }
            for group in GROUPS:
                error = float(reduced["relative_error"].sel(group=group))
                row |= _cheapest_rival(dataset, group, error, time)
            yield row


def _cheapest_rival(dataset: xr.Dataset, group: str, error: float, seconds: float) -> Row:
    """The cheapest full model whose error in a group of outputs is no larger."""
    full = dataset.sel(label=FULL)
    errors = full["relative_error"].sel(group=group).values
    times = np.where(errors <= error, full["seconds_median"].values, np.inf)
    rival, gain = "", np.nan
    if np.isfinite(times).any():
        fastest = int(times.argmin())
        rival, gain = mesh_text(dataset, fastest), float(times[fastest] / seconds)
    return {f"error_{group}": error, f"rival_{group}": rival, f"gain_{group}": gain}


def mesh_text(dataset: xr.Dataset, mesh: int) -> str:
    """A mesh in words: `shells, 0.25 m`; of a vehicle its name."""
    name, kind = str(dataset["mesh"].values[mesh]), str(dataset["kind"].values[mesh])
    if kind == "vehicle":
        return name.replace("_", " ")
    word, unit = KINDS.get(kind, (kind, ""))
    return f"{word}, {name.split()[1].rstrip(',')} {unit}".rstrip()


def growth(dataset: xr.Dataset, kind: str, label: str) -> float:
    """Exponent p of time ~ n^p over the meshes of a kind; NaN where fewer than two are timed."""
    n = dataset["coordinates_of_mesh"].values
    seconds = dataset["seconds_median"].sel(label=label).values
    chosen = (dataset["kind"].values == kind) & np.isfinite(seconds) & (n >= GROWING)
    if chosen.sum() < 2:
        return np.nan
    return float(np.polyfit(np.log(n[chosen]), np.log(seconds[chosen]), 1)[0])


def growth_text(rows: Sequence[Row]) -> str:
    """Growth of the times with the number of coordinates, by kind of mesh, in one sentence."""
    first_of_kind: dict[str, Row] = {}
    for row in rows:
        if not np.isnan(row["growth_full"]):
            first_of_kind.setdefault(row["mesh_kind"], row)
    parts: list[str] = []
    for kind, row in sorted(first_of_kind.items()):
        word, *_ = KINDS.get(kind, (kind,))
        reduced = f"{row['label']} n^{row['growth']:.2f}"
        parts.append(f"{word}: full n^{row['growth_full']:.2f}, {reduced}")
    return f"Times grow with the number n of coordinates ({'; '.join(parts)})." if parts else ""


def main() -> None:
    """Measure, store, print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--results", type=Path, default=Path("results"), help="results folder")
    results = parser.parse_args().results
    make_folder(results)
    dataset = measured(results)
    write_dataset(dataset, results / "mesh_sizes.nc")
    rows = list(size_rows(dataset))
    print(Table(rows, COSTS, below=growth_text(rows)))
    compared = [row for row in rows if not np.isnan(row["error_motion"])]
    print(Table(compared, RIVALS, below=EXPLAINED))


if __name__ == "__main__":
    main()
