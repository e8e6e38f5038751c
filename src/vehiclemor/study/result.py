"""Labelled results of experiments: metrics of one run, or errors in every test scenario."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.metrics import max_abs, rms, signal_range
from vehiclemor.reduction.interface import ReducedModel
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Trajectory
from vehiclemor.simulation.trajectory_dataset import trajectory_dataset, with_units
from vehiclemor.study.experiment import Experiment
from vehiclemor.study.failure import Failure
from vehiclemor.study.provenance import attributes
from vehiclemor.study.variables import variables

if TYPE_CHECKING:
    import xarray as xr

# Length (s) from the start within which the largest value of every output is stored.
FIRST_SECONDS = 10.0
# Time (s) after which the smallest value of every output is stored: a dropped car has landed.
LANDED = 1.0


@dataclass(frozen=True)
class Outcome:
    """A reduced and a full-order run of the same scenario.

    Attributes
    ----------
    reference
        None where nothing is compared.
    floor
        RMS errors (outputs,) of the best approximation in the same subspaces, if there is one.
    """

    trajectory: Trajectory
    reference: Trajectory | None
    floor: np.ndarray | None = None


def metrics_dataset(
    model: Model,
    experiment: Experiment,
    outcome: Outcome | Failure,
    reduced: ReducedModel | Failure,
    in_training: bool = False,
) -> xr.Dataset:
    """Result of the one test scenario.

    Parameters
    ----------
    in_training
        Whether the method has learnt from that very run.

    Returns
    -------
    xarray.Dataset
        Errors by output, coordinate and speed, floors, counts, seconds and status; histories too if
        the experiment keeps trajectories.
    """
    if isinstance(outcome, Failure):
        reduced, missing = outcome, _missing(model, experiment.test[0].maneuver, outcome)
        outcome = Outcome(missing, missing)
    run = outcome.trajectory
    found, histories = _compared(model, outcome)
    if model.speeds:
        found["growth_rate"] = float(getattr(reduced, "spectral_abscissa", np.nan))
    if model.kind == "ae":
        residuals = model.along("residual", run.coordinates, run.inputs)
        found["largest_residual"] = float(np.abs(residuals).max())
    found |= {**fit_cost(reduced)._asdict(), "in_training": in_training}
    dataset = trajectory_dataset(model, run, variables(found) | histories)
    if experiment.keep == "metrics":
        dataset = dataset.drop_dims(["time", "input"])
    dataset.attrs |= _attributes(experiment)
    return dataset


def _compared(model: Model, outcome: Outcome) -> tuple[dict[str, object], dict[str, tuple]]:
    """Errors and floors, and the reference's histories; nothing where there is none."""
    run, full, floor = outcome.trajectory, outcome.reference, outcome.floor
    if full is None:
        return {}, {}
    error = run.outputs - full.outputs
    found: dict[str, object] = {
        "rms_error": rms(error),
        "max_error": max_abs(error),
        "floor_rms_error": np.full(len(model.outputs), np.nan) if floor is None else floor,
        "signal_range": signal_range(full.outputs),
        "rms_coordinate_error": rms(run.coordinates - full.coordinates),
    }
    if model.speeds:
        found["rms_speed_error"] = rms(run.speeds - full.speeds)
    # A reference may be kept for further results.
    return found, variables({"reference_outputs": full.outputs.copy()}, "time")


class FitCost(NamedTuple):
    """Rank of a fit, and what it has cost; zero and missing of one that has failed."""

    effective_rank: int
    offline_seconds: float
    offline_evaluations: int


def fit_cost(reduced: ReducedModel | Failure) -> FitCost:
    """Rank and cost of one fit."""
    if isinstance(reduced, Failure):
        return FitCost(0, np.nan, 0)
    offline = reduced.offline
    return FitCost(reduced.effective_rank, offline.seconds, offline.evaluations)


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
    cost: FitCost,
) -> xr.Dataset:
    """Errors of the outputs, counts and status on the dimension `scenario`.

    A run that has failed has no errors and counts nothing.
    """
    import xarray as xr

    ends = [o if isinstance(o, Failure) else o.trajectory for o in outcomes]
    compared = [None if isinstance(o, Failure) else o for o in outcomes]
    finished = [o if o and o.trajectory.finished else None for o in compared]
    missing = (np.full(len(model.outputs), np.nan),) * 4
    errors = zip(*[_errors(o) if o else missing for o in finished], strict=True)
    names = ("rms_error", "max_error", "largest_output", "smallest_output")
    found: dict[str, object] = dict(zip(names, map(np.array, errors), strict=True))
    found["seconds"] = np.array([o.trajectory.seconds if o else np.nan for o in finished])
    for name in ("status", "message"):
        found[name] = np.array([getattr(end, name) for end in ends], dtype=object)
    remarks = [o.trajectory.remark if o else "" for o in finished]
    found["remark"] = np.array(remarks, dtype=object)
    trusted = [o.trajectory.trust if o else None for o in finished]
    found["trust_indicator"] = np.array([t.indicator if t else np.nan for t in trusted])
    found["trusted_until"] = np.array([t.until if t else np.inf for t in trusted])
    described = variables(found, "scenario") | variables(cost._asdict())
    for name, text in model.counts.items():
        values = np.array([o.trajectory.counts.get(name, 0) if o else 0 for o in finished])
        described[name] = ("scenario", values, {"units": "1", "long_name": text})
    outputs = model.definition.outputs
    coordinates = {
        "scenario": [scenario.label for scenario in experiment.test],
        "output": [quantity.name for quantity in outputs],
        "output_unit": ("output", [quantity.unit for quantity in outputs]),
    }
    return with_units(xr.Dataset(described, coordinates, _attributes(experiment)))


def _errors(outcome: Outcome) -> tuple[np.ndarray, ...]:
    """RMS and largest errors (outputs,), largest magnitudes of the first seconds, least values."""
    assert outcome.reference is not None
    outputs = outcome.trajectory.outputs
    error = outputs - outcome.reference.outputs
    times = outcome.trajectory.time
    least = outputs[times >= min(LANDED, times[-1])].min(axis=0)
    return rms(error), max_abs(error), max_abs(outputs[times <= FIRST_SECONDS]), least


def _attributes(experiment: Experiment) -> dict[str, object]:
    title = f"{experiment.method} on {experiment.model}"
    own = {"cell": experiment.key, "configuration": experiment.configuration}
    return attributes(title, experiment.kernel, **own)
