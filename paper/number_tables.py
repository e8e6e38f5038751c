"""Tables of stored results as numbers by name: which cells, and what they are called."""

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
import pandas as pd
import xarray as xr

import vehiclemor as vm
from vehiclemor.registry import names
from vehiclemor.report.comparison import stored_rows
from vehiclemor.report.frames import frame
from vehiclemor.report.published import load_published, rms_numbers
from vehiclemor.report.sizes import size_rows
from vehiclemor.report.unseen import protocol_rows

PEERS = Path(__file__).parents[1] / "benchmarks" / "peers" / "report.py"
# Name, value, and a unit where the name does not give it away.
Entry = tuple[Any, ...]
# A table of pandas, whose stubs do not follow columns that are chosen by name.
Frame = Any
SUSPENSION, VEHICLE = "double_wishbone", "independent_suspension_vehicle"
HIGH_FIDELITY = "high_fidelity_vehicle"
# Outputs that texts speak of.
OUTPUTS = {
    SUSPENSION: ["spindle_y", "second_euler_angle"],
    VEHICLE: ["pitch", "yaw", "lateral_position"],
    HIGH_FIDELITY: ["lateral_speed", "vertical_speed", "lateral_position"],
}
NOMINAL = {SUSPENSION: "figures-6-7", VEHICLE: "figures-2-4", HIGH_FIDELITY: "figures-9-10"}
# Factors of the input whose errors are named one by one.
PERTURBED = {f"{kind}_factor": [0.8, 0.9, 1.0, 1.1, 1.2] for kind in ("frequency", "amplitude")}
FIGURE_13 = {"frequency": [0.5, 0.8, 1.0, 1.2, 1.5, 2.0], "amplitude": [0.5, 0.8, 1.0, 1.2, 1.5]}
# Dimension of a grid -> its value in a name.
MARKS = {"frequency_factor": "f{:g}", "amplitude_factor": "a{:g}", "control_period": "period{:g}"}
MOST_RANK, DEFAULT_RANKS = 4, {VEHICLE: 3, HIGH_FIDELITY: 1}
COUNTS = ("rhs_calls", "iterations", "growth_rate")
# Columns of a protocol: of integrators, of methods beside contenders, and where they are tested.
JUDGED = ["misses", "score", "seconds", "loop_seconds"]
BESIDE = ["misses", "silent", "flagged", "score", "seconds", "offline_seconds"]
TESTED = [*BESIDE, "loop_seconds", "ratio_equal", "ratio_equal_loop", "runs", "rank"]
TESTED += ["misses_at_ten", "worst_m", "worst_deg"]
TESTED += [f"outside_{name}" for name in ("runs", "misses", "silent", "flagged")]
MOST_ERRORS, MEASURED = 12, ("worst_rms_", "worst_max_", "worst_relative_")
OPERATIONS = ("total", "trigonometric", "divide")
WORK = ("residual_evaluations", "iterations", "rhs_calls")
SPEEDS = {"speed_up": "same", "speed_up_strongest": "fastest"}
SIZES = ["gain_mesh", "seconds", "error_motion", "error_strain"]
CHOSEN_SIZES = ["order", "gain_motion", "gain_strain", "offline_seconds", "break_even"]


def slug(*parts: object) -> str:
    """A name of parts: `predictive.double_wishbone.path_map`."""
    words = (re.sub(r"[^a-z0-9.+-]+", "_", str(part).lower()).strip("_") for part in parts)
    return ".".join(word for word in words if word)


def cells(prefix: str, table: Frame) -> Iterator[Entry]:
    """Every cell of a table: its index and columns are parts of names."""
    for place, row in zip(table.index, table.to_dict("records"), strict=True):
        parts = place if isinstance(place, tuple) else (place,)
        yield from ((slug(prefix, *parts, name), value) for name, value in row.items())


def runs(dataset: xr.Dataset, *variables: str) -> Frame:
    """A row for each run of a study's grid, by method with its rank, and by what varies."""
    table: Frame = frame(dataset, ["status", *variables])
    first = dataset["status"]
    if "rank" in first.dims:
        # Full order and replay have no rank: those of the first one stand for all.
        ranked = table["label"].str.startswith(("pod", "fixed"))
        table = table[ranked | (table["rank"] == dataset["rank"].values[0])]
        names = table["label"] + "_r" + table["rank"].astype(str)
        table = table.assign(label=names.where(ranked, table["label"]))
    varied = [
        str(d) for d in first.dims if d not in ("label", "rank", "start") and first.sizes[d] > 1
    ]
    varied += ["start"] if first.sizes.get("start", 1) > 1 else []
    marked = {dim: table[dim].map(MARKS[dim].format) for dim in varied if dim in MARKS}
    return table.assign(**marked).set_index(["label", *varied])


def errors(model: str, table: Frame, old: str = "rms_error", new: str = "") -> Frame:
    """Columns of the model's outputs, under the names that texts use."""
    return pd.DataFrame({f"{o}.{new or old}": table[f"{old}.{o}"] for o in OUTPUTS[model]})


def whole(model: str, dataset: xr.Dataset) -> Frame:
    """Errors of every run, those of the best approximation, and counts."""
    counts = [name for name in COUNTS if name in dataset]
    table = runs(dataset, "rms_error", "floor_rms_error", *counts)
    floors = errors(model, table, "floor_rms_error", "floor").replace(0.0, np.nan)
    return errors(model, table).join(floors).join(table[counts])


def pods(model: str, dataset: xr.Dataset) -> Frame:
    """Runs of control-period POD alone."""
    return whole(model, dataset.sel(label=["pod"]))


def trained(model: str, dataset: xr.Dataset) -> Frame:
    """Runs that methods are trained on: with the largest error over its published one."""
    table, numbers = whole(model, dataset), rms_numbers(model).items()
    ratios = [table[f"{output}.rms_error"] / number.value for output, number in numbers]
    return table.assign(over_published=np.maximum(*ratios))


def drawn(dataset: xr.Dataset) -> Frame:
    """Runs of the suspension's figures: with the largest error over the signal's range."""
    share = dataset["max_error"] / dataset["signal_range"]
    shares = runs(dataset.assign(largest_share=share), "largest_share")
    return whole(SUSPENSION, dataset).join(errors(SUSPENSION, shares, "largest_share"))


def last_place(dataset: xr.Dataset) -> Frame:
    """Where the vehicle is at the end of every run."""
    place = dataset["outputs"].sel(output="lateral_position", drop=True).isel(time=-1, drop=True)
    return runs(dataset.assign(lateral_position=place), "lateral_position")[["lateral_position"]]


def furthest_aside(dataset: xr.Dataset) -> Frame:
    """Largest errors of the lateral position."""
    return runs(dataset, "max_error")[["max_error.lateral_position"]]


def of_truck(dataset: xr.Dataset) -> Frame:
    """Worst errors over the outputs' ranges, and costs; on a smooth road what is felt."""
    smooth = dataset["amplitude_factor"] == 0.0
    worst = (dataset["rms_error"] / dataset["signal_range"]).max("output").where(~smooth)
    felt = dataset["largest_output"].sel(output="driver_acceleration", drop=True).where(smooth)
    found = {"worst_relative_error": worst, "driver_acceleration": felt}
    if "rank" not in dataset.dims:
        found |= {"offline_seconds": dataset["offline_seconds"], "order": dataset["effective_rank"]}
    table = runs(dataset.assign(found), *found)[[*found]]
    return table.rename(columns={"order": "rank"})


def grid(prefix: str, columns: Callable[[xr.Dataset], Frame], data: xr.Dataset) -> Any:
    """Columns of every run of a study."""
    return cells(prefix, columns(data))


def lines(prefix: str, model: str, places: dict[str, list[float]], data: xr.Dataset) -> Any:
    """Errors at some places of a grid, one dimension after the other; then their spread."""
    data = data.sel(label=data["label"] != "full_order")
    for dim, values in places.items():
        nominal = {other: [1.0] for other in places if other != dim}
        part = data.sel({dim: values} | nominal)
        yield from cells(prefix, errors(model, runs(part, "rms_error")))
    yield from spread(prefix, model, data)


def spread(prefix: str, model: str, dataset: xr.Dataset) -> Iterator[Entry]:
    """Smallest and largest errors over everything but method and rank; beside those of replay."""
    table: Frame = frame(dataset.sel(start=["equilibrium"]), ["status", "rms_error"])
    apart = ["label", "rank"] if dataset.sizes.get("rank", 1) > 1 else ["label"]
    table["rank"] = "r" + table["rank"].astype(str)
    groups = table.groupby(apart)
    found = {"runs": groups.size(), "completed": groups["status"].agg(lambda s: (s == "ok").sum())}
    for column, output in ((f"rms_error.{o}", o) for o in OUTPUTS[model]):
        found |= {
            f"{output}.smallest": groups[column].min(),
            f"{output}.largest": groups[column].max(),
        }
        if "replay" in dataset["label"]:
            labels = {label: part[column].to_numpy() for label, part in table.groupby("label")}
            moved = labels["replay"] > 0.0
            ratio = labels["pod"][moved] / labels["replay"][moved]
            for name, values in (("over_replay", ratio), ("replay_over", 1.0 / ratio)):
                found[f"{output}.{name}_smallest"] = pd.Series({"pod": values.min()})
                found[f"{output}.{name}_largest"] = pd.Series({"pod": values.max()})
    yield from cells(prefix, pd.DataFrame(found))


def orders(dataset: xr.Dataset) -> Iterator[Entry]:
    """Errors over orders and signs of the equations; those of the natural order."""
    yield from spread("equation-order", SUSPENSION, dataset)
    table: Frame = frame(dataset, ["status", "rms_error"])
    for output, number in rms_numbers(SUSPENSION).items():
        error = table[f"rms_error.{output}"]
        found = table[["label"]].assign(above_published=error > number.value)
        found = found.assign(natural=error.where(table["equation_seed"] == 0, 0.0))
        found = found.assign(diverged=table["status"] == "diverged").groupby("label").sum()
        yield from cells("equation-order", found.add_prefix(f"{output}."))


def settings(model: str, dataset: xr.Dataset) -> Iterator[Entry]:
    """Formulations and inner products, from both starts, at the default number of snapshots."""
    head, pair = f"settings.{model}", ["formulation", "inner_product"]
    table: Frame = frame(
        dataset.sel(label=["pod"]), ["status", "growth_rate", "rms_error", "rhs_calls"]
    )
    table = table.assign(
        failed=table["status"] != "ok", growth_largest=table["growth_rate"], runs=1
    )
    how = {"runs": "sum", "failed": "sum", "growth_largest": "max"}
    yield from cells(head, table.groupby(pair).agg(how))
    table = table[table["snapshots"] == 10] if "snapshots" in table else table
    table["name"], ranks = "r" + table["rank"].astype(str), table["rank"]
    yield from cells(head, table.groupby([*pair, "name"])[["growth_largest"]].max())
    # Other ranks where the product is that of energy.
    energy = (table["formulation"] == "state") & (table["inner_product"] == "energy")
    chosen = (ranks == DEFAULT_RANKS[model]) | (energy & (ranks <= MOST_RANK))
    table = table[chosen & ~table["failed"]].set_index([*pair, "name", "start"])
    yield from cells(head, errors(model, table).join(table[["rhs_calls"]]))


def protocol(dataset: xr.Dataset) -> Iterator[Entry]:
    """Methods and integrators on unseen inputs; the chosen method is `chosen` too."""
    kind, model = str(dataset.attrs["study"]).split("-", 1)
    rows: Frame = pd.DataFrame(protocol_rows(dataset))
    methods, head = rows[rows["kind"] == "method"], f"{kind}.{model}"
    methods = pd.concat([methods, methods[methods["winner"].eq(True)].assign(label="chosen")])
    full = methods["role"] == "full order"
    worst = [name for name in methods if name.startswith(MEASURED)]
    worst = worst if len(worst) <= MOST_ERRORS else []
    yield from cells(head, methods[full].set_index("label")[JUDGED])
    columns = TESTED + worst if kind == "predictive" else BESIDE + worst[:2]
    yield from cells(head, methods[~full].set_index("label")[columns])
    if kind == "predictive":
        targets = rows[rows["kind"] == "target"].set_index("id")["measured"]
        yield from ((slug(head, "target", name), value) for name, value in targets.items())
        bounds = rows[(rows["kind"] == "bound") & bool(worst)].set_index("item")["bound"]
        yield from ((slug(head, "bound", name), value) for name, value in bounds.items())


def times(model: str, dataset: xr.Dataset) -> Iterator[Entry]:
    """Times of every case on the nominal run."""
    table: Frame = frame(dataset).set_index(
        ["case", "start"] if dataset.sizes["start"] > 1 else ["case"]
    )
    offline = table["offline_seconds"].where(table["offline_seconds"] > 0.0)
    found = errors(model, table).join(table[[name for name in WORK if name in table]])
    found = found.assign(us=1e6 * table["seconds"], offline_us=1e6 * offline)
    if "iterations" in table:
        found["ns_per_sample"] = 1e9 * table["seconds_per_sample"]
    for name, against in SPEEDS.items():
        saved = table["seconds"] * (table[name] - 1.0)
        found[f"ratio_{against}"] = 1.0 / table[name]
        pays = (table["status"] == "ok") & (saved > 0.0)
        found[f"break_even_{against}"] = (offline / saved).where(pays)
    yield from cells(f"time.{model}", found)


def sizes(dataset: xr.Dataset) -> Iterator[Entry]:
    """What a reduction gains on each mesh; of a vehicle its chosen model."""
    for row in size_rows(dataset):
        vehicle = row["mesh_kind"] == "vehicle"
        mesh = row["mesh"] if vehicle else f"n{row['coordinates']}"
        label = "chosen" if vehicle else row["label"]
        for name in SIZES + (CHOSEN_SIZES if label in ("chosen", "Craig-Bampton") else []):
            yield slug("size", mesh, label, name), row[name]
        yield slug("size", mesh, "coordinates"), row["coordinates"]
        yield slug("size", mesh, "full_order", "seconds"), row["full_seconds"]
        yield slug("size", row["mesh_kind"], "full_order", "growth"), row["growth_full"]
        yield slug("size", row["mesh_kind"], label, "growth"), row["growth"]


def comparison(results: Path) -> Iterator[Entry]:
    """Every number and claim of the paper beside what is reproduced, from equilibrium."""
    verdicts: dict[str, int] = {}
    for row in stored_rows(results):
        kind, variant = "claims" if np.isnan(row["published"]) else "numbers", row["variant"]
        key = slug("comparison", kind, variant or "not_judged", row["verdict"])
        verdicts[key] = verdicts.get(key, 0) + 1
        for name in ("reproduced", "bound", "replay", "floor", "signal_rms"):
            yield slug("comparison", row["id"], variant, name), row[name], row["unit"]
    yield from verdicts.items()


def published() -> Iterator[Entry]:
    """What the paper prints."""
    for key, number in load_published().numbers.items():
        yield slug("published", key), number.value, number.unit


def operations() -> Iterator[Entry]:
    """Exact operation counts of the generated kernels."""
    for model in names("model"):
        for kernel, counts in vm.model(model).operation_counts.items():
            for kind in OPERATIONS:
                yield slug("operations", model, kernel, kind), counts.get(kind, 0)


def named_values(prefix: str, dataset: xr.Dataset) -> Iterator[Entry]:
    """Values that have names."""
    for name, at in dataset.groupby("name"):
        yield slug(prefix, *str(name).split()), at["value"].item(), at["output_unit"].item()


def benchmark(rows: dict[str, Any]) -> Iterator[Entry]:
    """Medians of benchmarks."""
    for row in rows["benchmarks"]:
        case = re.split(r"/test_|\.py::test_|[\[\]]", row["fullname"])[1:]
        yield slug("benchmark", *case, "median"), row["stats"]["median"]


def peers(cases: dict[str, Any]) -> Iterator[Entry]:
    """Times of each tool at each error, per run or step, and over those of the fastest here."""
    report = SimpleNamespace(**runpy.run_path(str(PEERS)))
    for name, case in cases.items():
        for kind, target in product(report.kinds(case), case["targets"]):
            curves = {k: c["points"] for k, c in case["curves"].items() if c["delivers"] == kind}
            chosen = {k: report.choose(scan, target) for k, scan in curves.items()}
            found = {k: p["seconds"] / case["per"][0] for k, p in chosen.items() if p}
            ours = [s for k, s in found.items() if k.startswith(report.OURS)]
            others = {k: s for k, s in found.items() if not k.startswith(report.OURS)}
            packages = [s for k, s in others.items() if not k.startswith("CVODE in C")]
            others["nearest"] = min(others.values(), default=np.nan)
            others["nearest_package"] = min(packages, default=np.nan)
            head, own = (
                ("peers", name, kind, f"{target:.0e}".replace("e-0", "e-")),
                min(ours, default=np.nan),
            )
            yield slug(*head, "ours", "seconds"), own
            yield from ((slug(*head, who, "over_ours"), s / own) for who, s in others.items())


def studies() -> Iterator[tuple[str, Callable[[xr.Dataset], Iterator[Entry]]]]:
    """Stored study -> what makes its numbers."""
    for model, name in NOMINAL.items():
        yield name, partial(grid, f"nominal.{model}", partial(trained, model))
        yield f"timing-{model}", partial(times, model)
    for figure in ("figure-11", "figure-12", "figure-14"):
        yield figure, partial(grid, figure, drawn)
    for model, name in (SUSPENSION, "figure-11"), (VEHICLE, "vehicle"):
        make = partial(grid, f"control_period.{model}", partial(pods, model))
        yield f"{name}-control-period", make
    for dim, values in FIGURE_13.items():
        name, places = f"figure-13-{dim}", {f"{dim}_factor": values}
        yield name, partial(lines, name, SUSPENSION, places)
    for model, short in (VEHICLE, "vehicle"), (HIGH_FIDELITY, "high-fidelity"):
        yield f"{short}-perturbations", partial(lines, f"perturbed.{model}", model, PERTURBED)
        yield f"{short}-settings", partial(settings, model)
        yield f"{short}-zero-steer", partial(grid, f"zero_steer.{model}", last_place)
    for name in ("unseen-inputs", "unseen-inputs-ranks"):
        yield name, partial(grid, "unseen", furthest_aside)
    yield "equation-order", orders
    yield "figure-14-spread", partial(spread, "figure-14-spread", SUSPENSION)
    yield "truck-contenders", partial(grid, "truck.bases", of_truck)
    yield "truck-ranks", partial(grid, "truck.ranks", of_truck)
    yield "size", sizes
    for kind, model in product(("predictive", "contenders"), names("model")):
        yield f"{kind}-{model}", protocol
