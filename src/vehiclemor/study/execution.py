"""Computing one cell: reference, fit, reduced simulation, errors.  Failures are results too."""

from __future__ import annotations

import json
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from vehiclemor.errors import ConvergenceError, InputError, UnreachableError, VehiclemorError
from vehiclemor.maneuvers import Maneuver
from vehiclemor.metrics import largest, rms, signal_range
from vehiclemor.reduction.interface import Method, Offline
from vehiclemor.reduction.training import training_runs
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Trajectory, trajectory_dataset
from vehiclemor.study.cells import Cell
from vehiclemor.study.provenance import machine, versions

if TYPE_CHECKING:
    import xarray as xr


def compute_cell(
    cell: Cell, model: Model | None = None, maneuver: Maneuver | None = None
) -> xr.Dataset:
    """Labelled result of a cell, whatever becomes of it.

    Parameters
    ----------
    cell
        What to compute.
    model, maneuver
        The model and the perturbed maneuver that the cell was made of; from the registry by
        default.

    Returns
    -------
    xarray.Dataset
        Errors by output, coordinate and speed, floors, counts, seconds and status; histories too if
        the cell keeps trajectories.  Where nothing could be computed the values are missing and
        `status` and `message` tell why.
    """
    model = model or _model(cell.model, json.dumps(cell.parameters, sort_keys=True))
    if maneuver is None:
        base: Maneuver = component("maneuver", cell.maneuver)
        maneuver = base.perturbed(cell.frequency_factor, cell.amplitude_factor)
    method: Method = component("method", cell.method)
    accepted, reason = method.accepts(model)
    if not accepted:
        return _failed(model, maneuver, cell, "rejected", reason)
    try:
        method.check(model, cell.settings)
    except InputError as error:
        return _failed(model, maneuver, cell, "rejected", str(error))
    whose = "the full-order reference: "
    try:
        reference = model.simulate(maneuver, cell.start)
        whose = ""
        runs = training_runs(model, maneuver, cell.start, cell.training, cell.training_set)
        reduced = method.fit(model, runs, cell.settings)
        # The first run loads machine code and warms caches, the second is timed.
        reduced.simulate(maneuver, cell.start)
        trajectory = reduced.simulate(maneuver, cell.start)
        approximation = reduced.best_approximation(reference.states)
    except UnreachableError as error:
        return _failed(model, maneuver, cell, "unreachable", str(error))
    except ConvergenceError as error:
        return _failed(model, maneuver, cell, "diverged", f"{whose}{error}")
    except VehiclemorError:
        raise
    except Exception as error:  # noqa: BLE001 - a plug-in's bug spoils its own cell, not the study
        return _failed(model, maneuver, cell, "error", f"{type(error).__name__}: {error}")
    return _result(
        model,
        cell,
        trajectory,
        reference,
        approximation,
        reduced.offline,
        reduced.effective_rank,
        float(getattr(reduced, "growth_rate", np.nan)),
    )


@lru_cache(maxsize=16)
def _model(name: str, parameters: str) -> Model:
    """Model with the parameters of a cell; kept, since all cells of a study share it."""
    return build(name, overrides=json.loads(parameters))


def _failed(model: Model, maneuver: Maneuver, cell: Cell, status: str, message: str) -> xr.Dataset:
    times = maneuver.times
    missing = Trajectory(
        times,
        maneuver.at(times),
        np.full((len(times), len(model.coordinates)), np.nan),
        np.full((len(times), len(model.speeds)), np.nan),
        np.full((len(times), len(model.outputs)), np.nan),
        {},
        np.nan,
        status,
        message,
    )
    return _result(model, cell, missing, missing, None, Offline(np.nan, 0), 0)


def _result(
    model: Model,
    cell: Cell,
    trajectory: Trajectory,
    reference: Trajectory,
    approximation: np.ndarray | None,
    offline: Offline,
    effective_rank: int,
    growth_rate: float = np.nan,
) -> xr.Dataset:
    error = trajectory.outputs - reference.outputs
    floor = np.full(len(model.outputs), np.nan)
    if approximation is not None:
        floor = rms(model.outputs_at(approximation, reference.inputs) - reference.outputs)
    by_output = {
        "rms_error": (rms(error), "RMS error of the output against the full-order solution"),
        "max_error": (largest(error), "largest absolute error of the output"),
        "floor_rms_error": (floor, "RMS error of the best approximation in the same subspaces"),
        "signal_range": (signal_range(reference.outputs), "range of the full-order output"),
    }
    further: dict[str, tuple] = {
        name: ("output", numbers, {"units": "see output_unit", "long_name": text})
        for name, (numbers, text) in by_output.items()
    }
    further["rms_coordinate_error"] = (
        "coordinate",
        rms(trajectory.coordinates - reference.coordinates),
        {"units": "see coordinate_unit", "long_name": "RMS error of the coordinate"},
    )
    if model.speeds:
        further["rms_speed_error"] = (
            "speed",
            rms(trajectory.speeds - reference.speeds),
            {"units": "see speed_unit", "long_name": "RMS error of the speed"},
        )
    scalars: dict[str, tuple[float, str, str]] = {}
    if model.speeds:
        meaning = "largest real part of an eigenvalue of the reduced Jacobian in any window"
        scalars["growth_rate"] = (growth_rate, "1/s", meaning)
    residual_at = getattr(model, "residual_at", None)
    if residual_at is not None:
        residual = float(np.abs(residual_at(trajectory.coordinates, trajectory.inputs)).max())
        scalars["largest_residual"] = (residual, "m", "largest residual of an equation")
    scalars |= {
        "effective_rank": (
            effective_rank,
            "1",
            "largest number of reduced coordinates in a window",
        ),
        "offline_seconds": (offline.seconds, "s", "training simulations and fit"),
        "offline_evaluations": (
            offline.evaluations,
            "1",
            "evaluations of the full model's equations in training",
        ),
    }
    for name, (value, units, text) in scalars.items():
        further[name] = ((), value, {"units": units, "long_name": text})
    further["reference_outputs"] = (
        ("time", "output"),
        reference.outputs,
        {"units": "see output_unit", "long_name": "full-order outputs for the same input"},
    )
    dataset = trajectory_dataset(model, trajectory, further)
    if cell.keep == "metrics":
        dataset = dataset.drop_dims(["time", "input"])
    dataset.attrs = {
        "Conventions": "CF-1.11",
        "title": f"{cell.method} on {cell.model}",
        "source": "vehiclemor",
        "references": "doi:10.1115/1.4029390",
        "cell": cell.key,
        "configuration": cell.configuration,
        "kernel_hash": cell.kernel,
        "versions": versions(),
        "machine": machine(),
    }
    return dataset
