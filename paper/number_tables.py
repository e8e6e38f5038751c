"""Tables of stored results as numbers by name: each value with the parts of its name."""

from __future__ import annotations

import re
import runpy
from collections.abc import Callable, Iterator
from functools import partial
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import xarray as xr
from claims import claim_rows, stored_results
from mesh_sizes import size_rows

import vehiclemor as vm
from vehiclemor.registry import names
from vehiclemor.report.published import load_published, number_rows, rms_numbers
from vehiclemor.report.results import frame
from vehiclemor.report.unseen import count_rows, protocol_rows

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
PEERS, STEPS = BENCHMARKS / "peers" / "report.py", BENCHMARKS / "steps.py"
# Name, value, and a unit where the name does not give it away.
Entry = tuple[Any, ...]
# A table of pandas, whose stubs do not follow columns that are chosen by name.
Frame = Any
Variables = dict[str, xr.DataArray]
SUSPENSION, VEHICLE = "double_wishbone", "independent_suspension_vehicle"
HIGH_FIDELITY = "high_fidelity_vehicle"
NOMINAL = {SUSPENSION: "figures-6-7", VEHICLE: "figures-2-4", HIGH_FIDELITY: "figures-9-10"}
VEHICLES = {VEHICLE: "vehicle", HIGH_FIDELITY: "high-fidelity"}
# Dimension of a grid -> its value in a name.
MARKS = {"frequency_factor": "f{:g}", "amplitude_factor": "a{:g}", "control_period": "period{:g}"}
ASIDE = "lateral_position"
SPEEDS = {"speed_up": "same", "speed_up_strongest": "fastest"}


def slug(*parts: object) -> str:
    """A name of parts: `predictive.double_wishbone.path_map`."""
    words = (re.sub(r"[^a-z0-9.+-]+", "_", str(part).lower()).strip("_") for part in parts)
    return ".".join(word for word in words if word)


def cells(prefix: str, table: Frame) -> Iterator[Entry]:
    """Every cell of a table: its index and columns are parts of names."""
    for index, row in zip(table.index, table.to_dict("records"), strict=True):
        parts = index if isinstance(index, tuple) else (index,)
        for column, value in row.items():
            yield slug(prefix, *parts, column), value


def by_output(table: Frame) -> Frame:
    """Columns `rms_error.yaw` as `yaw.rms_error`."""
    return table.rename(columns=lambda name: ".".join(reversed(str(name).split("."))))


def runs(dataset: xr.Dataset, variables: Variables) -> Frame:
    """A row for each run of a study's grid, by method with its rank, and by what varies."""
    table: Frame = frame(xr.Dataset({"status": dataset["status"], **variables}))
    sizes = dataset["status"].sizes
    if "rank" in sizes:
        # Full order and replay have no rank: their runs at the first one stand for all.
        has_rank = table["label"].str.startswith(("pod", "fixed"))
        table = table[has_rank | (table["rank"] == dataset["rank"].values[0])]
        ranked = table["label"] + "_r" + table["rank"].astype(str)
        table = table.assign(label=ranked.where(has_rank, table["label"]))
    varied = [str(dim) for dim in sizes if sizes[dim] > 1 and dim not in ("label", "rank")]
    varied.sort(key=lambda dim: dim == "start")
    marked = {dim: table[dim].map(MARKS[dim].format) for dim in varied if dim in MARKS}
    columns = [c for c in table if str(c).split(".")[0] in variables or c in variables]
    return table.assign(**marked).set_index(["label", *varied])[columns]


def grid(prefix: str, variables: Callable[[xr.Dataset], Variables], data: xr.Dataset) -> Any:
    """Variables of every run of a study."""
    return cells(prefix, by_output(runs(data, variables(data))))


# Measure -> its values in a study.
MEASURES: dict[str, Callable[[xr.Dataset], xr.DataArray]] = {
    "largest_share": lambda data: data["max_error"] / data["signal_range"],
    "worst_relative_error": lambda data: (data["rms_error"] / data["signal_range"]).max("output"),
    # Where the vehicle is at the end.
    ASIDE: lambda data: data["outputs"].sel(output=ASIDE, drop=True).isel(time=-1, drop=True),
    f"{ASIDE}.max_error": lambda data: data["max_error"].sel(output=ASIDE, drop=True),
}


def measure(prefix: str, name: str, data: xr.Dataset) -> Any:
    """A measure of every run of a study."""
    return grid(prefix, lambda study: {name: MEASURES[name](study)}, data)


def errors(dataset: xr.Dataset) -> Variables:
    """Errors of every run, and what its loop counts."""
    wanted = ("rms_error", "iterations", "growth_rate")
    return {name: dataset[name] for name in wanted if name in dataset}


def integrated(dataset: xr.Dataset) -> Variables:
    """Time of the loop in us, and largest distance from the reference in mm."""
    off = [
        dataset["max_error"].sel(output=f"{axis}_position") for axis in ("longitudinal", "lateral")
    ]
    return {
        "us": 1e6 * dataset["seconds"],
        "mm": 1e3 * (off[0] ** 2 + off[1] ** 2) ** 0.5,
    }


def over_published(model: str, dataset: xr.Dataset) -> Variables:
    """Errors, and the largest one over the published number of its output."""
    numbers = rms_numbers(model)
    errors_of_outputs = dataset["rms_error"].sel(output=[*numbers])
    bounds = xr.DataArray([number.value for number in numbers.values()], dims="output")
    largest = (errors_of_outputs / bounds).max("output", skipna=False)
    return errors(dataset) | {"over_published": largest}


def perturbed(prefix: str, dataset: xr.Dataset) -> Iterator[Entry]:
    """Errors of every run; least and largest ratio of POD's to those of replay."""
    yield from grid(prefix, errors, dataset)
    rms = dataset["rms_error"].sel(start="equilibrium")
    pod, replay = rms.sel(label="pod"), rms.sel(label="replay")
    over_replay = (pod / replay).where(replay > 0.0)
    for name, ratio in (("over_replay", over_replay), ("replay_over", 1.0 / over_replay)):
        for output, values in ratio.groupby("output"):
            yield slug(prefix, "pod", output, f"{name}_smallest"), values.min()
            yield slug(prefix, "pod", output, f"{name}_largest"), values.max()


def spread(prefix: str, dataset: xr.Dataset) -> Iterator[Entry]:
    """Number of runs, smallest and largest errors, by method and rank."""
    table: Frame = frame(dataset[["status", "rms_error"]])
    table["rank"] = "r" + table["rank"].astype(str)
    several_ranks = dataset.sizes.get("rank", 1) > 1
    groups = table.groupby(["label", "rank"] if several_ranks else ["label"])
    yield from cells(prefix, groups.size().to_frame("runs"))
    for column in (name for name in table if name.startswith("rms_error.")):
        ends = groups[column].agg(smallest="min", largest="max")
        yield from cells(prefix, ends.add_prefix(column.removeprefix("rms_error.") + "."))


def orders(dataset: xr.Dataset) -> Iterator[Entry]:
    """Errors over orders and signs of the equations; those of the natural order."""
    yield from spread("equation-order", dataset)
    diverged = (dataset["status"] == "diverged").sum("equation_seed")
    natural = dataset["rms_error"].sel(equation_seed=0, drop=True)
    for label, output in product(dataset["label"].values, dataset["output"].values):
        head, at = ("equation-order", label, output), {"label": label}
        yield slug(*head, "diverged"), diverged.sel(at).item()
        yield slug(*head, "natural"), natural.sel(at | {"output": output}).item()


def settings(model: str, dataset: xr.Dataset) -> Iterator[Entry]:
    """Formulations and inner products, from both starts, at the default number of snapshots."""
    head, pair = f"settings.{model}", ["formulation", "inner_product"]
    wanted = ["status", "growth_rate", "rms_error", "rhs_calls"]
    table: Frame = frame(dataset.sel(label=["pod"])[wanted])
    table["failed"], table["runs"] = table["status"] != "ok", 1
    yield from cells(head, table.groupby(pair)[["runs", "failed"]].sum())
    growth = {"growth_rate": "growth_largest"}
    yield from cells(head, table.groupby(pair)[["growth_rate"]].max().rename(columns=growth))
    table = table[table["snapshots"] == 10] if "snapshots" in table else table
    table = table.assign(rank="r" + table["rank"].astype(str))
    ranked = table.groupby([*pair, "rank"])[["growth_rate"]].max()
    yield from cells(head, ranked.rename(columns=growth))
    finished = table[~table["failed"]].set_index([*pair, "rank", "start"])
    yield from cells(head, by_output(finished))


def protocol(dataset: xr.Dataset) -> Iterator[Entry]:
    """Methods and integrators on unseen inputs; the chosen method is `chosen` too; by maneuver."""
    head = dataset.attrs["study"].split("-", 1)
    for row in protocol_rows(dataset):
        if row["kind"] == "method":
            for label in [row["label"]] + ["chosen"] * row["winner"]:
                yield from ((slug(*head, label, name), value) for name, value in row.items())
    for row in count_rows(dataset):
        item, label = row.pop("item"), row.pop("label")
        yield from ((slug(*head, item, label, name), value) for name, value in row.items())


def times(model: str, dataset: xr.Dataset) -> Iterator[Entry]:
    """Times of every case on the nominal run."""
    table: Frame = frame(dataset)
    for column, against in SPEEDS.items():
        table[f"ratio_{against}"] = 1.0 / table[column]
    table["us"], table["offline_us"] = 1e6 * table["seconds"], 1e6 * table["offline_seconds"]
    index = ["case", "start"] if dataset.sizes["start"] > 1 else ["case"]
    yield from cells(f"time.{model}", by_output(table.set_index(index)))


def sizes(dataset: xr.Dataset) -> Iterator[Entry]:
    """What a reduction gains on each mesh."""
    for row in size_rows(dataset):
        head = "size", f"n{row['coordinates']}"
        yield from ((slug(*head, row["label"], name), value) for name, value in row.items())
        yield slug(*head, "coordinates"), row["coordinates"]
        yield slug(*head, "full_order", "seconds"), row["full_seconds"]
        yield slug("size", row["mesh_kind"], "full_order", "growth"), row["growth_full"]


def comparison(results: Path) -> Iterator[Entry]:
    """Every number and claim of the paper as reproduced, from equilibrium."""
    stored = stored_results(results)
    for row in number_rows(stored):
        for name in ("reproduced", "signal_rms"):
            yield slug("comparison", row["id"], row["variant"], name), row[name], row["unit"]
    for row in claim_rows(stored):
        yield slug("comparison", row["id"], row["variant"], "reproduced"), row["reproduced"], "1"


def published() -> Iterator[Entry]:
    """What the paper prints."""
    for key, number in load_published().items():
        yield slug("published", key), number.value, number.unit


def operations() -> Iterator[Entry]:
    """Exact operation counts of the generated kernels."""
    for model in names("model"):
        for kernel, counts in vm.model(model).operation_counts.items():
            yield slug("operations", model, kernel, "total"), counts["total"]


def named_values(prefix: str, dataset: xr.Dataset) -> Iterator[Entry]:
    """Values that have names."""
    for name, at in dataset.groupby("name"):
        yield slug(prefix, *str(name).split()), at["value"].item(), at["output_unit"].item()


def peers(cases: dict[str, Any]) -> Iterator[Entry]:
    """Times of other tools at each error over that of the fastest here, which is in seconds."""
    report = SimpleNamespace(**runpy.run_path(str(PEERS)))
    for name, case in cases.items():
        for delivered, error in product(report.kinds(case), case["targets"]):
            head = "peers", name, delivered, f"{error:.0e}".replace("e-0", "e-")
            seconds = report.seconds_at(case, delivered, error)
            here = {label for label in seconds if label.startswith(report.OURS)}
            fastest = min((seconds[label] for label in here), default=np.nan)
            yield slug(*head, "ours", "seconds"), fastest
            others = {label: s for label, s in seconds.items() if label not in here}
            packages = [s for label, s in others.items() if not label.startswith("CVODE in C")]
            nearest, package = (min(s, default=np.nan) for s in (others.values(), packages))
            yield slug(*head, "nearest", "over_ours"), nearest / fastest
            yield slug(*head, "nearest_package", "over_ours"), package / fastest


def steps(vehicles: dict[str, Any]) -> Iterator[Entry]:
    """Instructions of a step of exported C, time of the fastest one within bounds; 0: none."""
    study = SimpleNamespace(**runpy.run_path(str(STEPS)))
    for vehicle, part in vehicles.items():
        for row in part.get("arm", {}).get("rows", ()):
            head = "steps", vehicle, row["model"], row["integrator"], row["processor"]
            yield slug(*head, "instructions"), row["instructions"], "1"
            yield from ((slug(*head, name), row[name], "B") for name in ("code", "stack"))
        for speed, level in product(study.SPEEDS, study.LEVELS):
            head, times = ("steps", vehicle, f"v{speed:g}", f"within{level:g}"), {}
            for model in dict.fromkeys(row["model"] for row in part["costs"]):
                times[model] = study.fastest(part, model, speed, level).get("time", 0.0)
                yield slug(*head, model), times[model], "us"
            gained = times["reduced"] and times["full"] / times["reduced"]
            yield slug(*head, "gain"), gained, "1"


def studies() -> Iterator[tuple[str, Callable[[xr.Dataset], Iterator[Entry]]]]:
    """Stored study -> what makes its numbers."""
    for model, name in NOMINAL.items():
        yield name, partial(grid, f"nominal.{model}", partial(over_published, model))
        yield f"timing-{model}", partial(times, model)
    yield "figure-11", partial(measure, "figure-11", "largest_share")
    yield "figure-11-control-period", partial(grid, f"control_period.{SUSPENSION}", errors)
    yield "vehicle-control-period", partial(grid, f"control_period.{VEHICLE}", errors)
    for name in ("figure-13-frequency", "figure-13-amplitude"):
        yield name, partial(perturbed, name)
    for model, short in VEHICLES.items():
        yield f"{short}-perturbations", partial(perturbed, f"perturbed.{model}")
        yield f"{short}-settings", partial(settings, model)
        yield f"{short}-zero-steer", partial(measure, f"zero_steer.{model}", ASIDE)
    for name in ("unseen-inputs", "unseen-inputs-ranks"):
        yield name, partial(measure, "unseen", f"{ASIDE}.max_error")
    for name in ("driving-straight", "driving-locked", "driving-turns"):
        yield name, partial(grid, name, integrated)
    yield "equation-order", orders
    yield "figure-14-spread", partial(spread, "figure-14-spread")
    yield "truck-ranks", partial(measure, "truck.ranks", "worst_relative_error")
    for kind, model in product(("predictive", "contenders"), names("model")):
        yield f"{kind}-{model}", protocol
    for model in VEHICLES:
        yield f"predictive-{model}-2", protocol
        yield f"logs-{model}", protocol
