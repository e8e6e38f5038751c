"""Runs of a protocol as files, for methods that are written outside of this package."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from vehiclemor.arguments import file_path
from vehiclemor.exceptions import FileError
from vehiclemor.failure import Failure, attempt
from vehiclemor.files import write_whole
from vehiclemor.multibody.definition import Quantity
from vehiclemor.netcdf_file import write_dataset
from vehiclemor.progress import tell
from vehiclemor.provenance import attributes
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.run_timer import one_thread
from vehiclemor.simulation.structures.model import StructuralModel
from vehiclemor.study import scenario as of_run
from vehiclemor.study.evaluate import cached_reference, evaluate, model_of
from vehiclemor.study.plans.choice import reasons
from vehiclemor.study.plans.protocol import Protocol, load_protocol, protocol_names, sampled_sets
from vehiclemor.study.plans.protocol_run import second_runs
from vehiclemor.study.plans.results import described
from vehiclemor.study.plans.study_file import SETS
from vehiclemor.study.plans.study_runs import PARAMETER
from vehiclemor.study.result import variables
from vehiclemor.study.scenario import Scenario

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
