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
from vehiclemor.simulation.trajectory import Trajectory, trajectory_dataset
from vehiclemor.study.experiment import Experiment
from vehiclemor.study.failure import Failure
from vehiclemor.study.provenance import machine, versions

if TYPE_CHECKING:
    import xarray as xr

# Length (s) from the start within which the largest value of every output is stored.
FIRST_SECONDS = 10.0
RMS = "RMS error of the output against the full-order solution"
LARGEST = "largest absolute error of the output"


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
    fitted = None if isinstance(reduced, Failure) else reduced
    if isinstance(outcome, Failure):
        missing = _missing(model, experiment.test[0].maneuver, outcome)
        outcome, fitted = Outcome(missing, missing), None
    reference = outcome.reference
    variables = _error_variables(model, outcome) | _scalars(model, outcome.trajectory, fitted)
    variables["reference_outputs"] = (
        ("time", "output"),
        reference.outputs,
        {"units": "see output_unit", "long_name": "full-order outputs for the same input"},
    )
    dataset = trajectory_dataset(model, outcome.trajectory, variables)
    if experiment.keep == "metrics":
        dataset = dataset.drop_dims(["time", "input"])
    return dataset.assign_attrs(_attributes(experiment))


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


def _error_variables(model: Model, outcome: Outcome) -> dict[str, tuple]:
    """Errors by output, coordinate and speed: name -> (dimension, values, attributes)."""
    trajectory, reference = outcome.trajectory, outcome.reference
    error = trajectory.outputs - reference.outputs
    floor = np.full(len(model.outputs), np.nan) if outcome.floor is None else outcome.floor
    found = [
        ("rms_error", "output", rms(error), RMS),
        ("max_error", "output", max_abs(error), LARGEST),
        (
            "floor_rms_error",
            "output",
            floor,
            "RMS error of the best approximation in the same subspaces",
        ),
        (
            "signal_range",
            "output",
            signal_range(reference.outputs),
            "range of the full-order output",
        ),
        (
            "rms_coordinate_error",
            "coordinate",
            rms(trajectory.coordinates - reference.coordinates),
            "RMS error of the coordinate",
        ),
    ]
    if model.speeds:
        difference = rms(trajectory.speeds - reference.speeds)
        found.append(("rms_speed_error", "speed", difference, "RMS error of the speed"))
    return {
        name: (dimension, values, {"units": f"see {dimension}_unit", "long_name": text})
        for name, dimension, values, text in found
    }


def _scalars(
    model: Model, trajectory: Trajectory, reduced: ReducedModel | None
) -> dict[str, tuple]:
    """Growth rate or residual, rank, and what it has cost to fit: name -> variable."""
    found: dict[str, tuple[float, str, str]] = {}
    if model.speeds:
        growth = float(getattr(reduced, "growth_rate", np.nan))
        text = "largest real part of an eigenvalue of the reduced Jacobian in any window"
        found["growth_rate"] = (growth, "1/s", text)
    residual_at = getattr(model, "residual_at", None)
    if residual_at is not None:
        residual = float(np.abs(residual_at(trajectory.coordinates, trajectory.inputs)).max())
        found["largest_residual"] = (residual, "m", "largest residual of an equation")
    text = "largest number of reduced coordinates in a window"
    return _variables(found) | _fit_variables(reduced, text)


def _fit_variables(reduced: ReducedModel | Failure | None, rank_text: str) -> dict[str, tuple]:
    fitted = None if isinstance(reduced, Failure) else reduced
    offline = fitted.offline if fitted else Offline(np.nan, 0)
    text = "evaluations of the full model's equations in training"
    return _variables(
        {
            "effective_rank": (fitted.effective_rank if fitted else 0, "1", rank_text),
            "offline_seconds": (offline.seconds, "s", "training simulations and fit"),
            "offline_evaluations": (offline.evaluations, "1", text),
        }
    )


def _variables(found: dict[str, tuple[float, str, str]]) -> dict[str, tuple]:
    return {
        name: ((), value, {"units": unit, "long_name": text})
        for name, (value, unit, text) in found.items()
    }


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

    ended = [
        o if isinstance(o, Outcome) and o.trajectory.status == "ok" else None for o in outcomes
    ]
    missing = (np.full(len(model.outputs), np.nan),) * 3
    errors = zip(*[_errors(o) if o else missing for o in ended], strict=True)
    texts = {
        "rms_error": RMS,
        "max_error": LARGEST,
        "largest_output": f"largest absolute value in the first {FIRST_SECONDS:g} s",
    }
    variables: dict[str, tuple] = {}
    for (name, text), values in zip(texts.items(), errors, strict=True):
        attributes = {"units": "see output_unit", "long_name": text}
        variables[name] = (("scenario", "output"), np.array(values), attributes)
    for name, text in model.counts.items():
        values = np.array([o.trajectory.counts.get(name, 0) if o else 0 for o in ended])
        variables[name] = ("scenario", values, {"units": "1", "long_name": text})
    variables["seconds"] = (
        "scenario",
        np.array([o.trajectory.seconds if o else np.nan for o in ended]),
        {"units": "s", "long_name": "time in the compiled loop, not repeated"},
    )
    ends = [o.trajectory if isinstance(o, Outcome) else o for o in outcomes]
    for name, text in (("status", "ok, or why there is no result"), ("message", "what failed")):
        values = np.array([getattr(end, name) for end in ends], dtype=object)
        variables[name] = ("scenario", values, {"long_name": text})
    variables |= _fit_variables(reduced, "reduced coordinates")
    outputs = model.equations.outputs
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


def _attributes(experiment: Experiment) -> dict[str, str]:
    return {
        "Conventions": "CF-1.11",
        "title": f"{experiment.method} on {experiment.model}",
        "source": "vehiclemor",
        "references": "doi:10.1115/1.4029390",
        "cell": experiment.key,
        "configuration": experiment.configuration,
        "kernel_hash": experiment.kernel,
        "versions": versions(),
        "machine": machine(),
    }
