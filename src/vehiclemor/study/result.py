"""Labelled results of experiments: metrics of one run, or errors in every test scenario."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vehiclemor.maneuvers import Maneuver
from vehiclemor.metrics import max_abs, rms, signal_range
from vehiclemor.reduction.interface import Offline, ReducedModel
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Trajectory
from vehiclemor.simulation.trajectory_dataset import trajectory_dataset
from vehiclemor.study.experiment import Experiment
from vehiclemor.study.failure import Failure
from vehiclemor.study.provenance import attributes

if TYPE_CHECKING:
    import xarray as xr

# Length (s) from the start within which the largest value of every output is stored.
FIRST_SECONDS = 10.0
RMS = "RMS error of the output against the full-order solution"
LARGEST = "largest absolute error of the output"
FLOOR = "RMS error of the best approximation in the same subspaces"
GROWTH = "largest real part of an eigenvalue of the reduced Jacobian in any window"
EVALUATIONS = "evaluations of the full model's equations in training"
Variable = tuple[str | tuple[str, ...], object, dict[str, str]]


@dataclass(frozen=True)
class Outcome:
    """A reduced and a full-order run of the same scenario.

    Attributes
    ----------
    floor
        RMS errors (outputs,) of the best approximation in the same subspaces, if there is one.
    """

    trajectory: Trajectory
    reference: Trajectory
    floor: np.ndarray | None = None


def metrics_dataset(
    model: Model,
    experiment: Experiment,
    outcome: Outcome | Failure,
    reduced: ReducedModel | Failure,
) -> xr.Dataset:
    """Result of the one test scenario.

    Returns
    -------
    xarray.Dataset
        Errors by output, coordinate and speed, floors, counts, seconds and status; histories too if
        the experiment keeps trajectories.
    """
    if isinstance(outcome, Failure):
        reduced, missing = outcome, _missing(model, experiment.test[0].maneuver, outcome)
        outcome = Outcome(missing, missing)
    run, full, floor = outcome.trajectory, outcome.reference, outcome.floor
    floor = np.full(len(model.outputs), np.nan) if floor is None else floor
    error = run.outputs - full.outputs
    variables = {
        "rms_error": _by("output", rms(error), RMS),
        "max_error": _by("output", max_abs(error), LARGEST),
        "floor_rms_error": _by("output", floor, FLOOR),
        "signal_range": _by("output", signal_range(full.outputs), "range of the full-order output"),
        "rms_coordinate_error": _by(
            "coordinate", rms(run.coordinates - full.coordinates), "RMS error of the coordinate"
        ),
    }
    if model.speeds:
        speed_error = rms(run.speeds - full.speeds)
        variables["rms_speed_error"] = _by("speed", speed_error, "RMS error of the speed")
        growth = float(getattr(reduced, "spectral_abscissa", np.nan))
        variables["growth_rate"] = _scalar(growth, "1/s", GROWTH)
    residual_at = getattr(model, "residual_at", None)
    if residual_at is not None:
        residual = float(np.abs(residual_at(run.coordinates, run.inputs)).max())
        text = "largest residual of an equation"
        variables["largest_residual"] = _scalar(residual, "m", text)
    variables |= _of_fit(reduced, "largest number of reduced coordinates in a window")
    text = "full-order outputs for the same input"
    variables["reference_outputs"] = _by("output", full.outputs, text, ("time", "output"))
    dataset = trajectory_dataset(model, run, variables)
    if experiment.keep == "metrics":
        dataset = dataset.drop_dims(["time", "input"])
    return dataset.assign_attrs(_attributes(experiment))


def _by(
    quantity: str, values: object, text: str, dimensions: tuple[str, ...] | None = None
) -> Variable:
    """Variable in the units of a group of quantities."""
    return dimensions or quantity, values, {"units": f"see {quantity}_unit", "long_name": text}


def _scalar(value: float, unit: str, text: str) -> Variable:
    return (), value, {"units": unit, "long_name": text}


def _of_fit(reduced: ReducedModel | Failure, rank_text: str) -> dict[str, Variable]:
    """Rank, and what the fit has cost."""
    failed = isinstance(reduced, Failure)
    offline = Offline(np.nan, 0) if failed else reduced.offline
    return {
        "effective_rank": _scalar(0 if failed else reduced.effective_rank, "1", rank_text),
        "offline_seconds": _scalar(offline.seconds, "s", "training simulations and fit"),
        "offline_evaluations": _scalar(offline.evaluations, "1", EVALUATIONS),
    }


def _missing(model: Model, maneuver: Maneuver, failure: Failure) -> Trajectory:
    times = maneuver.times
    return Trajectory(
        times,
        maneuver.at(times),
        np.full((len(times), len(model.coordinates)), np.nan),
        np.full((len(times), len(model.speeds)), np.nan),
        np.full((len(times), len(model.outputs)), np.nan),
        {},
        np.nan,
        failure.status,
        failure.message,
    )


def errors_dataset(
    model: Model,
    experiment: Experiment,
    outcomes: Sequence[Outcome | Failure],
    reduced: ReducedModel | Failure,
) -> xr.Dataset:
    """Errors of the outputs, counts and status on the dimension `scenario`.

    A run that has failed has no errors and counts nothing.
    """
    import xarray as xr

    ends = [o if isinstance(o, Failure) else o.trajectory for o in outcomes]
    compared = [None if isinstance(o, Failure) else o for o in outcomes]
    finished = [o if o and o.trajectory.status == "ok" else None for o in compared]
    missing = (np.full(len(model.outputs), np.nan),) * 3
    largest = f"largest absolute value in the first {FIRST_SECONDS:g} s"
    errors = zip(*[_errors(o) if o else missing for o in finished], strict=True)
    names = {"rms_error": RMS, "max_error": LARGEST, "largest_output": largest}
    variables = {
        name: _by("output", np.array(values), text, ("scenario", "output"))
        for (name, text), values in zip(names.items(), errors, strict=True)
    }
    for name, text in model.counts.items():
        values = np.array([o.trajectory.counts.get(name, 0) if o else 0 for o in finished])
        variables[name] = ("scenario", values, {"units": "1", "long_name": text})
    seconds = np.array([o.trajectory.seconds if o else np.nan for o in finished])
    attributes = {"units": "s", "long_name": "time in the compiled loop, not repeated"}
    variables["seconds"] = ("scenario", seconds, attributes)
    for name, text in (("status", "ok, or why there is no result"), ("message", "what failed")):
        values = np.array([getattr(end, name) for end in ends], dtype=object)
        variables[name] = ("scenario", values, {"long_name": text})
    variables |= _of_fit(reduced, "reduced coordinates")
    outputs = model.definition.outputs
    coordinates = {
        "scenario": [scenario.label for scenario in experiment.test],
        "output": [quantity.name for quantity in outputs],
        "output_unit": ("output", [quantity.unit for quantity in outputs]),
    }
    return xr.Dataset(variables, coordinates, _attributes(experiment))


def _errors(outcome: Outcome) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """RMS and largest errors (outputs,), and the largest values in the first seconds."""
    outputs = outcome.trajectory.outputs
    error = outputs - outcome.reference.outputs
    first = outcome.trajectory.time <= FIRST_SECONDS
    return rms(error), max_abs(error), max_abs(outputs[first])


def _attributes(experiment: Experiment) -> dict[str, object]:
    title = f"{experiment.method} on {experiment.model}"
    own = {"cell": experiment.key, "configuration": experiment.configuration}
    return attributes(title, experiment.kernel, **own)
