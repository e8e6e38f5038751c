"""Runs of a protocol as files, for methods that are written outside of this package.

Runs stand one behind the other along `sample`; `row_size` says how many samples each has
(contiguous ragged arrays of the CF conventions).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from functools import partial
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from vehiclemor.arguments import file_path
from vehiclemor.exceptions import FileError, InputError
from vehiclemor.failure import Failure, attempt
from vehiclemor.files import probe_folder, write_folder
from vehiclemor.multibody.definition import Quantity
from vehiclemor.netcdf_file import write_dataset
from vehiclemor.parameters import parameter_and_axis
from vehiclemor.progress import tell
from vehiclemor.provenance import attributes
from vehiclemor.registry import choice
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.run_timer import one_thread
from vehiclemor.simulation.structures.model import StructuralModel
from vehiclemor.study.evaluate import evaluate, kept_reference, model_of
from vehiclemor.study.plans.choice import reasons
from vehiclemor.study.plans.protocol import Protocol, load_protocol, protocol_names, sampled_sets
from vehiclemor.study.plans.protocol_run import second_runs
from vehiclemor.study.plans.results import described
from vehiclemor.study.plans.study_file import PARAMETER
from vehiclemor.study.scenario import (
    Scenario,
    model_of_run,
    parameters_of,
    speed_of,
    start_of,
    with_parameters,
)

if TYPE_CHECKING:
    import xarray as xr

Format = Literal["netcdf", "zarr"]
ENDINGS = {"netcdf": "nc", "zarr": "zarr"}
NOTE = "Judged runs with their truth. Never train on this file, and never choose settings by it."


def dataset(model: str | Path, out: str | Path | None = None, to: Format = "netcdf") -> Path:
    """Write the training, validation and test runs of a protocol, for methods of others.

    Runs are full-order solutions, those that the protocol judges against.

    Parameters
    ----------
    model
        Registered name, whose protocol is meant; or name or TOML file of a study with bounds.
    out
        New folder; `MODEL-dataset` here by default.
    to
        `netcdf` or `zarr`.

    Returns
    -------
    Path
        The folder, with `training`, `validation` and `test`.  Along `sample`: `time` in s, inputs,
        states, their rates and outputs, by name, with units; bounds are attributes of outputs.
        Along `run`: `row_size`, `label`, `initial_state`, `initial_speed` in m/s, parameters that
        differ, and in `test` whether a run is `judged`.  Kinematic models have no rates, structural
        models neither states nor rates, but the folder `matrices` in the Matrix Market format.

    Raises
    ------
    VehiclemorError
        If there is no such study, it has no bounds, a package is missing, or the folder exists.
    """
    choice("format", to, get_args(Format))
    if to == "zarr" and not find_spec("zarr"):
        raise InputError("zarr needs the package zarr: pip install 'vehiclemor[zarr]'")
    name = str(file_path("model", model))
    path = Path(f"{Path(name).stem}-dataset") if out is None else file_path("out", out)
    if path.exists():
        raise FileError(f"{path}: exists already; move it away")
    if not path.parent.is_dir():
        raise FileError(f"{path}: there is no such folder")
    probe_folder(path.parent)
    protocol = load_protocol(protocol_names().get(name, name))
    with one_thread():
        return write_folder(path, partial(_write, protocol, to))


def _write(protocol: Protocol, to: Format, folder: Path) -> None:
    folder.mkdir()
    sampled = sampled_sets(protocol)
    sets = {name: protocol.sets[name] for name in ("training", "validation")}
    sets["test"] = sampled.get("drawn", protocol.sets["test"])
    second = second_runs(protocol, sets["test"])
    # With it, references of the test are simulated once.
    model = model_of(second)
    own = _attributes(protocol, model, sets["test"], "drawn" in sampled)
    for name, scenarios in sets.items():
        found = _runs(model, scenarios, f"{name} of {protocol.study}")
        for output, bound in protocol.definition.bounds.items():
            found[output].attrs |= {"bound": bound.bound, "bound_measure": bound.measure}
        title = f"{name} runs of {protocol.study}"
        found.attrs |= attributes(title, model.kernel_hash, **own)
        if name == "test":
            found.attrs["comment"] = NOTE
            apart = (
                reasons(protocol, evaluate(second)) if "drawn" in sampled else [""] * len(scenarios)
            )
            found["judged"] = (
                "run",
                np.array([not why for why in apart], np.int8),
                {"long_name": "1: judged; 0: reported apart, the full order itself is sensitive"},
            )
            texts = np.array(apart, object)
            found["apart"] = "run", texts, {"long_name": "why a run is not judged"}
        path = folder / f"{name}.{ENDINGS[to]}"
        if to == "zarr":
            found.to_zarr(path, mode="w", consolidated=False)
        else:
            write_dataset(found, path)
    if isinstance(model, StructuralModel):
        _write_matrices(model, folder / "matrices")


def _attributes(
    protocol: Protocol, model: Model, test: Sequence[Scenario], sampled: bool
) -> dict[str, Any]:
    definition = protocol.definition
    bounds = {name: bound.model_dump() for name, bound in definition.bounds.items()}
    content = [model.name, parameters_of(model), bounds, [run.label for run in test]]
    digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]
    return {
        "model": model.name,
        "study": protocol.study,
        "test_set": protocol.test_set if sampled else "listed",
        "test_set_version": definition.version,
        "test_set_seed": protocol.seed,
        "test_set_digest": digest,
        "configuration": definition.model_dump_json(exclude_defaults=True),
    }


def _runs(model: Model, scenarios: Sequence[Scenario], work: str) -> xr.Dataset:
    """Full-order runs with all that determines them."""
    import xarray as xr

    definition = model.definition
    states = (*definition.coordinates, *definition.speeds)
    rates = [_rate(state) for state in states] if isinstance(model, DynamicModel) else []
    groups = {"inputs": definition.inputs, "states": states, "rates": rates}
    groups["outputs"] = definition.outputs
    columns = [Quantity("time", "s", "time"), *chain(*groups.values())]
    blocks: list[np.ndarray] = []
    for number, scenario in enumerate(scenarios, start=1):
        blocks.append(_samples(model, scenario, len(columns)))
        tell(work, number, len(scenarios))
    histories = np.ascontiguousarray(np.concatenate(blocks).T)
    found: dict[str, tuple] = {
        quantity.name: ("sample", history, _meaning(quantity.long_name, quantity.unit))
        for quantity, history in zip(columns, histories, strict=True)
    }
    sizes = {"long_name": "samples of the run", "sample_dimension": "sample"}
    found["row_size"] = "run", np.array([len(block) for block in blocks]), sizes
    labels = np.array([run.label for run in scenarios], object)
    found["label"] = "run", labels, {"long_name": "input, factors, initial condition, parameters"}
    if states:
        names = np.array([state.name for state in states], object)
        found["state"] = "state", names, {"long_name": "name of the state"}
        starts = [model_of_run(model, run).start(start_of(model, run)) for run in scenarios]
        meaning = {"long_name": "state at the start, in the units of the states"}
        found["initial_state"] = ("run", "state"), np.array(starts), meaning
    speeds = [speed_of(model, run) for run in scenarios]
    if any(speeds):
        found["initial_speed"] = "run", np.array(speeds), _meaning("speed at the start", "m/s")
    for given in sorted({name for run in scenarios for name, _ in run.parameters}):
        name, axis = parameter_and_axis(model.name, definition.parameters, given)
        sets = (model_of_run(model, run).parameters.entries[name].value for run in scenarios)
        values = np.array([v if axis is None else v[axis] for v in sets], float)
        dimensions = ("run", "axis")[: values.ndim]
        found[f"parameter_{given}"] = dimensions, values, described(model, f"{PARAMETER}{given}")
    result = xr.Dataset(found, attrs={k: " ".join(q.name for q in v) for k, v in groups.items()})
    for variable in result.variables.values():
        if variable.dims == ("sample",):
            variable.encoding = {"zlib": True, "complevel": 4}
    return result


def _meaning(long_name: str, units: str) -> dict[str, str]:
    return {"long_name": long_name, "units": units}


def _rate(state: Quantity) -> Quantity:
    """Time derivative of a state."""
    unit = state.unit.removesuffix("/s") + ("/s^2" if state.unit.endswith("/s") else "/s")
    return Quantity(f"rate_of_{state.name}", unit, f"time derivative of {state.long_name}")


def _samples(model: Model, scenario: Scenario, width: int) -> np.ndarray:
    """Histories (samples, width); not a number where the full order has no solution."""
    run = attempt(partial(kept_reference, model, scenario))
    if isinstance(run, Failure):
        times = scenario.maneuver.times
        given = np.column_stack((times, scenario.maneuver.for_inputs(model.inputs).at(times)))
        return np.pad(given, ((0, 0), (0, width - given.shape[1])), constant_values=np.nan)
    own, rates = model_of_run(model, scenario), run.states[:, :0]
    if isinstance(own, DynamicModel):
        rates = own.rhs_at(run.states, run.inputs)
    return np.column_stack((run.times, run.inputs, run.states, rates, run.outputs))


def _write_matrices(model: StructuralModel, folder: Path) -> None:
    """Matrices of the structure, see `Structure`; by online parameters the change of the mass."""
    from scipy.io import mmwrite

    structure = model.system.structure
    damped = f"damping is W W' + d K with d = {structure.damping_time!r} s"
    found = {
        "mass": (structure.mass, "M (n, n)"),
        "stiffness": (structure.stiffness, f"K (n, n); {damped}"),
        "dampers": (structure.dampers, f"W (n, k); {damped}"),
        "ports": (structure.ports, "B (n, p); deflections of the ports are B' q"),
        "load": (structure.load[:, None], "weight (n, 1)"),
    }
    of = ("position", "speed", "acceleration", "force")
    for name, matrix in zip(of, structure.outputs, strict=True):
        found[f"outputs_{name}"] = matrix, f"outputs by {name}, about the static state"
    for name in model.definition.online:
        value = model.parameters.entries[name].value
        other = with_parameters(model, ((name, 2.0 * value),))
        change = (other.system.structure.mass - structure.mass) / value
        found[f"mass_by_{name}"] = change, f"change of M with {name}, which is {value:g} in M"
    folder.mkdir()
    for name, (matrix, meaning) in found.items():
        mmwrite(folder / f"{name}.mtx", matrix, comment=meaning)
