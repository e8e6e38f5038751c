"""Methods that are written outside of this package: runs of a protocol as files, and judgement."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from vehiclemor.arguments import file_path, quoted
from vehiclemor.error_measures import max_abs, rms, signal_range
from vehiclemor.exceptions import FileError, InputError, printable
from vehiclemor.failure import Failure, attempt
from vehiclemor.files import write_whole
from vehiclemor.multibody.definition import Quantity
from vehiclemor.netcdf_file import opened, read_dataset, write_dataset
from vehiclemor.progress import tell
from vehiclemor.provenance import attributes
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.run_timer import one_thread
from vehiclemor.simulation.structures.model import StructuralModel
from vehiclemor.study import scenario as of_run
from vehiclemor.study.evaluate import cached_reference, evaluate, model_of
from vehiclemor.study.plans.choice import outcomes, reasons
from vehiclemor.study.plans.protocol import Protocol, load_protocol, protocol_names, sampled_sets
from vehiclemor.study.plans.protocol_run import second_runs
from vehiclemor.study.plans.results import described, judged_part
from vehiclemor.study.plans.study_file import SETS, Bound, ProtocolFile
from vehiclemor.study.plans.study_runs import PARAMETER
from vehiclemor.study.result import variables
from vehiclemor.study.scenario import Scenario
from vehiclemor.study.store import combined_path

Bounds = Mapping[str, Bound]
# What makes a model's equations, whatever its kind; the rest follows from it.
EQUATIONS = ("constants", "residual", "derivative", "port_forces", "outputs")
NOTE = "Train on training, choose settings by validation; never train or tune on test."


def dataset(model: str | Path, out: str | Path | None = None) -> Path:
    """Write the training, validation and test runs of a protocol, for methods of others.

    Parameters
    ----------
    model
        Registered name, whose protocol is meant; or name or TOML file of a study with bounds.
    out
        New folder; `MODEL-dataset` here by default.

    Returns
    -------
    Path
        Folder with `training.nc`, `validation.nc` and `test.nc`: full-order runs, one behind the
        other along `sample`, with units and bounds as attributes, and along `run` what differs.
        Kinematic models have no rates; structural ones have matrices, but no states.

    Raises
    ------
    VehiclemorError
        If there is no such study, it has no bounds, or the folder exists.
    """
    name = str(file_path("model", model))
    path = Path(f"{Path(name).stem}-dataset") if out is None else file_path("out", out)
    if os.path.lexists(path):
        raise FileError(f"{path}: exists already; move it away")
    protocol = load_protocol(protocol_names().get(name, name))
    with one_thread():
        return write_whole(path, partial(_write, protocol))


def digest_of(protocol: Protocol) -> str:
    """Identity of a test set: equations, values of all parameters, bounds and runs.

    It is a hash of texts that all machines have alike.  Matrices of a structure, which they round
    differently, count by six digits of weighted sums.
    """
    runs = sampled_sets(protocol).get("drawn") or protocol.sets["test"]
    model = of_run.driven_by_all(protocol.model, runs)
    texts = [protocol.definition.model_dump_json(include={"model", "bounds"})]
    texts.append(of_run.parameters_of(model).text)
    texts += [repr(model.kernels.sources[name]) for name in EQUATIONS if name in model.kernels]
    if isinstance(model, StructuralModel):
        structure = model.system.structure
        matrices = structure.mass, structure.stiffness, structure.dampers, structure.ports
        texts += [_weighted_sum(matrix) for matrix in (*matrices, *structure.outputs)]
    texts += [run.label for run in runs]
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:16]


def _weighted_sum(matrix: Any) -> str:
    """Sum of the magnitudes of all entries, each times its row and column number."""
    rows, columns = (np.arange(1.0, size + 1.0) for size in matrix.shape)
    return f"{rows @ (abs(matrix) @ columns):.5e}"


def _write(protocol: Protocol, folder: Path) -> None:
    folder.mkdir()
    definition, drawn = protocol.definition, sampled_sets(protocol).get("drawn", ())
    sets = {name: protocol.sets[name] for name in SETS} | ({"test": drawn} if drawn else {})
    second = second_runs(protocol, sets["test"])
    # Its references stay in memory: those of the test are simulated once.
    model = of_run.driven_by_all(model_of(second), [*chain(*sets.values())])
    labels = [run.label for run in sets["test"]]
    digest = digest_of(protocol)
    for name in ("training", "validation", "test"):
        runs = _runs(model, sets[name], f"{name} of {protocol.study}")
        for output, bound in definition.bounds.items():
            runs[output].attrs |= {"bound": bound.bound, "bound_measure": bound.measure}
        if name == "test":
            screened = drawn or "test" in protocol.screened
            apart = reasons(protocol, evaluate(second)) if screened else [""] * len(labels)
            runs = runs.assign(variables({"apart": np.array(apart, object)}, "run"))
        runs.attrs |= attributes(
            f"{name} runs of {protocol.study}",
            model.kernel_hash,
            model=model.name,
            study=protocol.study,
            test_set=protocol.test_set if drawn else "listed",
            test_set_digest=digest,
            configuration=definition.model_dump_json(exclude_defaults=True),
            comment=NOTE,
        )
        write_dataset(runs, folder / f"{name}.nc")
    if isinstance(model, StructuralModel):
        _write_matrices(model, folder / "matrices")


def _runs(model: Model, scenarios: Sequence[Scenario], work: str) -> xr.Dataset:
    """Full-order runs, one behind the other (contiguous ragged arrays of the CF conventions)."""
    definition = model.definition
    states = definition.state_quantities
    rates = [
        Quantity(f"rate_of_{state.name}", f"{state.unit}/s", f"rate of: {state.long_name}")
        for state in (states if definition.speeds else ())
    ]
    groups = {"inputs": definition.inputs, "states": states, "rates": rates}
    groups |= {"outputs": definition.outputs}
    quantities = [Quantity("time", "s", "time"), *chain(*groups.values())]
    blocks: list[np.ndarray] = []
    for scenario in scenarios:
        blocks.append(_samples(model, scenario, len(quantities)))
        tell(work, len(blocks), len(scenarios))
    columns: dict[str, tuple] = {}
    for quantity, history in zip(quantities, np.concatenate(blocks).T.copy(), strict=True):
        meaning = {"long_name": quantity.long_name, "units": quantity.unit}
        columns[quantity.name] = "sample", history, meaning, {"zlib": True}
    labels = [run.label for run in scenarios]
    known: dict[str, object] = {
        "row_size": [len(block) for block in blocks],
        "label": np.array(labels, object),
    }
    if states:
        known["initial_state"] = [
            of_run.model_of_run(model, run).start(of_run.start_of(model, run)) for run in scenarios
        ]
        columns["state"] = "state", np.array([state.name for state in states], object)
        columns["state_unit"] = "state", np.array([state.unit for state in states], object)
    if any(speeds := [of_run.speed_of(model, run) for run in scenarios]):
        known["initial_speed"] = speeds
    columns |= variables(known, "run")
    columns["row_size"][2]["sample_dimension"] = "sample"
    varied = {name for run in scenarios for name, _ in run.parameters}
    for name in sorted(varied):
        usual: Any = dict(model.parameters.values()).get(name, np.nan)
        values = [dict(run.parameters).get(name, usual) for run in scenarios]
        columns[f"parameter_{name}"] = "run", values, described(model, f"{PARAMETER}{name}")
    names: dict[str, str] = {}
    for group, members in groups.items():
        names[group] = " ".join(quantity.name for quantity in members)
    return xr.Dataset(columns, attrs=names)


def _samples(model: Model, scenario: Scenario, width: int) -> np.ndarray:
    """Histories (samples, width); not a number where the full order has no solution."""
    run = attempt(partial(cached_reference, model, scenario))
    if isinstance(run, Failure):
        times = scenario.maneuver.times
        return np.column_stack((times, np.full((len(times), width - 1), np.nan)))
    changed, rates = of_run.model_of_run(model, scenario), run.states[:, :0]
    if changed.speeds:
        rates = changed.values_at("derivative", run.states, run.inputs, finite=True)
    return np.column_stack((run.times, run.inputs, run.states, rates, run.outputs))


def _write_matrices(model: StructuralModel, folder: Path) -> None:
    """Matrices of the structure; by online parameters the change of its mass."""
    from scipy.io import mmwrite

    structure = model.system.structure
    names = ("mass", "stiffness", "dampers", "ports")
    matrices = {name: getattr(structure, name) for name in names}
    outputs_of = ("position", "speed", "acceleration", "force")
    for name, matrix in zip(outputs_of, structure.outputs, strict=True):
        matrices[f"outputs_{name}"] = matrix
    values = dict(model.parameters.values())
    for name in model.definition.online:
        other = model.definition.structure(values | {name: values[name] + 1.0})
        matrices[f"mass_by_{name}"] = other.mass - structure.mass
    equation = "M q'' + (W W' + d K) q' + K q = load + B f(B' q, B' q', u)"
    folder.mkdir()
    for name, matrix in matrices.items():
        comment = f"{equation}, d = {structure.damping_time!r} s"
        mmwrite(folder / f"{name}.mtx", matrix, comment=comment)


# Predictions of such methods.


def judge(file: str | Path, dataset: str | Path, results: str | Path = "results") -> pd.DataFrame:
    """Judge predictions of the test runs that `dataset` has written.

    Parameters
    ----------
    file
        netCDF file: attributes `model` and `test_set_digest` of the test set, and
        each bounded output (samples,) by its name and in its unit, in the order of the test set.
        It may have `trusted` (runs,), 0 where the method warns, `seconds` (runs,) and `method`.
    dataset
        Folder that `dataset` has written.
    results
        Results folder: `replay` and the chosen method stand below, if the study was run there.

    Returns
    -------
    pandas.DataFrame
        By `kind`: `method`, then `output`.  Of the `runs`, `misses` violate a bound, `silent` ones
        without a warning; `score` and `median_score` of the errors are multiples of the bound, and
        infinite of a run that is not finite.

    Raises
    ------
    VehiclemorError
        If a file can't be read, is of another test set, or lacks values.
    """
    path, folder = file_path("file", file), file_path("dataset", dataset)
    known = folder / "test.nc"
    if not known.exists():
        raise FileError(f"{folder}: has no test.nc; vehiclemor dataset MODEL writes such a folder")
    truth, predictions = _read(known, "test set"), _read(path, "file of predictions")
    if "configuration" not in truth.attrs or "apart" not in truth:
        raise FileError(f"{known}: not the test set of a dataset of this package")
    bounds = ProtocolFile.model_validate_json(truth.attrs["configuration"]).bounds
    _check(path, predictions, truth, bounds)
    counts = truth["apart"].values == ""
    if not counts.any():
        raise InputError(f"{known}: no run can be judged")
    label = printable(str(predictions.attrs.get("method", path.stem)))
    part = _measured(predictions, truth, bounds).isel(scenario=counts)
    rows = [_row(label, part, bounds)]
    stored = combined_path(file_path("results", results), truth.attrs["study"])
    if stored.exists():
        other = judged_part(read_dataset(stored, stored=True))
        if np.array_equal(other["scenario"].values, truth["label"].values[counts]):
            shown = other["winner"].values | (other["method"].values == "replay")
            names = other["label"].values[shown].tolist()
            rows += [_row(name, other.sel(label=name), bounds) for name in names]
    for output, bound in bounds.items():
        row = _row(label, part, {output: bound})
        row |= {"kind": "output", "measure": bound.measure, "bound": bound.bound}
        rows.append(row | {"unit": truth[output].units})
    return pd.DataFrame(rows)


def _read(path: Path, kind: str) -> xr.Dataset:
    from xarray.backends import NetCDF4DataStore

    with opened(path, kind) as file:
        return xr.open_dataset(NetCDF4DataStore(file), decode_times=False).load()


def _check(path: Path, predictions: xr.Dataset, truth: xr.Dataset, bounds: Bounds) -> None:
    """Raise `InputError` if a file is not of predictions of this test set."""
    for name in ("model", "test_set_digest"):
        value, wanted = str(predictions.attrs.get(name, "missing")), truth.attrs[name]
        if value != wanted:
            raise InputError(f"{path}: {name} is {quoted(value)}; the test set has {wanted!r}")
    if missing := [output for output in bounds if output not in predictions]:
        raise InputError(f"{path}: has no {missing[0]}; needed are {', '.join(bounds)}")
    sizes = dict.fromkeys(bounds, truth.sizes["sample"])
    sizes |= {name: truth.sizes["run"] for name in ("trusted", "seconds") if name in predictions}
    for name, size in sizes.items():
        values = predictions[name]
        if values.shape != (size,) or values.dtype.kind not in "biuf":
            has = f"shape {values.shape} and type {values.dtype}"
            raise InputError(f"{path}: {name} has {has}; needed are {size} numbers")


def _measured(predictions: xr.Dataset, truth: xr.Dataset, bounds: Bounds) -> xr.Dataset:
    """Errors and ends of all runs, as a protocol has them of a method."""
    names, ends = truth.attrs["outputs"].split(), np.cumsum(truth["row_size"].values)[:-1]
    full = np.transpose([truth[name].values for name in names])
    bounded = [names.index(name) for name in bounds]
    predicted = np.transpose([predictions[name].values for name in bounds])
    error = np.full(full.shape, np.nan)
    error[:, bounded] = predicted - full[:, bounded]

    def by_run(measure: Callable[[np.ndarray], np.ndarray], histories: np.ndarray) -> tuple:
        # What is finite may be too large to be squared.
        with np.errstate(over="ignore", invalid="ignore"):
            parts = np.array([measure(part) for part in np.split(histories, ends)])
        return ("scenario", "output"), parts

    finite = np.isfinite(by_run(max_abs, error)[1][:, bounded]).all(axis=1)
    missing = np.full(len(finite), np.nan)
    trusted = predictions["trusted"].values > 0 if "trusted" in predictions else True
    seconds = predictions["seconds"].values if "seconds" in predictions else missing
    status = np.where(finite, np.where(trusted, "ok", "untrusted"), "diverged")
    return xr.Dataset(
        {
            "rms_error": by_run(rms, error),
            "max_error": by_run(max_abs, error),
            "signal_range": by_run(signal_range, full),
            "status": ("scenario", status),
            "trusted_until": ("scenario", missing),
            "seconds": ("scenario", seconds),
        },
        {"output": names, "output_unit": ("output", [truth[name].units for name in names])},
    )


def _row(label: str, part: xr.Dataset, bounds: Bounds) -> dict[str, Any]:
    """How the runs of a method keep some bounds."""
    ends = outcomes(part, bounds)
    worst = {name: outcomes(part, {name: bounds[name]}).scores.max() for name in bounds}
    return {
        "kind": "method",
        "label": label,
        **ends.counts,
        "score": float(ends.scores.max()),
        "median_score": float(np.median(ends.scores)),
        "output": max(worst, key=lambda name: worst[name]),
        "seconds": float(part["seconds"].mean()),
    }
