"""Labelled results of experiments: each run is measured by one function, with units and meanings.

What variables are stands in `data/results/variables.toml`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from vehiclemor.error_measures import max_abs, rms, signal_range
from vehiclemor.failure import Failure
from vehiclemor.files import data_folder
from vehiclemor.inputs.checks import completed
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.multibody.definition import STATE_KINDS
from vehiclemor.provenance import attributes
from vehiclemor.reduction.interface import FittedModel
from vehiclemor.registry import component
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Trajectory, trajectory_dataset, with_units
from vehiclemor.study.experiment import Experiment
from vehiclemor.study.scenario import Scenario
from vehiclemor.toml_files import FileSchema, read_toml

if TYPE_CHECKING:
    import xarray as xr

# Length (s) from the start within which the largest value of every output is stored.
FIRST_SECONDS = 10.0
# Time (s) after which the smallest value of every output is stored: a dropped vehicle has landed.
LANDED = 1.0


class VariablesFile(FileSchema):
    """Schema of `data/results/variables.toml`."""

    variables: dict[str, list[str]]
    dimensions: dict[str, str]


@cache
def _declared() -> VariablesFile:
    return read_toml(data_folder() / "results" / "variables.toml", VariablesFile)


def variables(values_by_name: Mapping[str, object], *dimensions: str) -> dict[str, tuple]:
    """Values with unit and meaning, on dimensions and on the quantity that their unit goes with."""
    result: dict[str, tuple] = {}
    for name, values in values_by_name.items():
        unit, meaning, *clock = _declared().variables[name]
        quantity = unit.removeprefix("see ").removesuffix("_unit")
        of_quantity = () if quantity == unit else (quantity,)
        attributes = ({"units": unit} if unit else {}) | {"long_name": meaning}
        attributes |= {"clock": clock[0]} if clock else {}
        result[name] = ((*dimensions, *of_quantity), values, attributes)
    return result


def meaning_of(dimension: str) -> str:
    """What a dimension of a grid is."""
    return _declared().dimensions.get(dimension, dimension.replace("_", " "))


@dataclass(frozen=True)
class Outcome:
    """A reduced run and, where it is compared, the full-order run of the same scenario.

    `projection` are the RMS errors (outputs,) of the best approximation in the same subspaces.
    """

    trajectory: Trajectory
    reference: Trajectory | None
    projection: np.ndarray | None = None


def result_dataset(
    model: Model,
    experiment: Experiment,
    outcomes: Sequence[Outcome | Failure],
    reduced: FittedModel | Failure,
    in_training: bool = False,
) -> xr.Dataset:
    """Result of an experiment: errors, counts, seconds, trust and status of every run.

    They are on the dimension `scenario` if the experiment keeps `errors`; with rank and cost of the
    fit, and histories if it keeps them.  `model` has the parameters of the tested scenarios;
    `in_training` says whether the method has learnt from the very run that is tested.
    """
    import xarray as xr

    many = experiment.keep == "errors"
    runs = [_compared(model, e, s, many) for e, s in zip(outcomes, experiment.test, strict=True)]
    tables = [_measured(model, run) for run in runs]
    measured = tables[0]
    if many:
        for name in measured:
            measured[name] = np.array([table[name] for table in tables])
    else:
        measured |= _of_one_run(model, runs[0]) | {"in_training": in_training}
        if model.speeds:
            measured["growth_rate"] = float(getattr(reduced, "spectral_abscissa", np.nan))
    scenarios = ("scenario",) * many
    counts = {name: measured.pop(name) for name in model.counts}
    described = variables(measured, *scenarios) | variables(fit_cost(reduced))
    for name, text in model.counts.items():
        described[name] = scenarios, counts[name], {"units": "1", "long_name": text}
    if experiment.keep == "trajectories":
        if (full := runs[0].reference) is not None:
            # Further results may need the reference.
            described |= variables({"reference_outputs": full.outputs.copy()}, "time")
        dataset = trajectory_dataset(model, runs[0].trajectory, described)
    else:
        dataset = with_units(xr.Dataset(described, _labels(model)))
    if many:
        dataset = dataset.assign_coords(scenario=[scenario.label for scenario in experiment.test])
    title = f"{experiment.method} on {experiment.model}"
    dataset.attrs |= attributes(
        title, experiment.kernel, cell=experiment.key, configuration=experiment.configuration
    )
    return dataset


def _compared(
    model: Model, outcome: Outcome | Failure, scenario: Scenario, finished: bool
) -> Outcome:
    """What is measured: histories without numbers of a run that there is not.

    If only a `finished` run counts, neither is there one that has not come to its end.
    """
    if not isinstance(outcome, Failure):
        run = outcome.trajectory
        if run.finished or not finished:
            return outcome
        outcome = Failure(run.status, run.message)
    missing = _missing(model, scenario.maneuver, outcome)
    return Outcome(missing, missing)


def _missing(model: Model, maneuver: Excitation, failure: Failure) -> Trajectory:
    times = maneuver.times
    histories = {
        kind: np.full((len(times), len(getattr(model, kind))), np.nan)
        for kind in (*STATE_KINDS, "outputs")
    }
    maneuver = completed(maneuver, model.definition)
    ended = {"counts": {}, "seconds": np.nan, "status": failure.status, "message": failure.message}
    return Trajectory.of(times=times, inputs=maneuver.at(times), **histories, **ended)


def _measured(model: Model, outcome: Outcome) -> dict[str, object]:
    """What is known of any run, by names of variables; no errors without a reference."""
    run, full, trust = outcome.trajectory, outcome.reference, outcome.trajectory.trust
    # Errors are those until the first of both has stopped.
    end = min(run.samples_to_stop, len(run.times) if full is None else full.samples_to_stop)
    outputs, times = run.outputs[:end], run.times[:end]
    early = np.searchsorted(times, FIRST_SECONDS, side="right")
    landed = np.searchsorted(times, min(LANDED, times[-1]))
    measured: dict[str, object] = {
        "largest_output": max_abs(outputs[:early]),
        "smallest_output": outputs[landed:].min(axis=0),
        "seconds": run.seconds,
        "status": run.status,
        "message": run.message,
        "remark": run.remark,
        "trust_indicator": trust.indicator if trust else np.nan,
        "trusted_until": trust.until if trust else np.inf,
        "warned": run.status == "untrusted" or bool(run.finished and trust and trust.reason),
    }
    for name in model.counts:
        measured[name] = run.counts.get(name, 0)
    if full is not None:
        error = outputs - full.outputs[:end]
        measured |= {
            "rms_error": rms(error),
            "max_error": max_abs(error),
            "signal_range": signal_range(full.outputs[:end]),
        }
        if model.coordinates:
            measured["rms_coordinate_error"] = rms((run.coordinates - full.coordinates)[:end])
        if model.speeds:
            measured["rms_speed_error"] = rms((run.speeds - full.speeds)[:end])
    return measured


def _of_one_run(model: Model, outcome: Outcome) -> dict[str, object]:
    """What takes time to find, and is not known of the many runs of a protocol."""
    run, measured = outcome.trajectory, dict[str, object]()
    if outcome.reference is not None:
        none = np.full(len(model.outputs), np.nan)
        measured["floor_rms_error"] = none if outcome.projection is None else outcome.projection
    if model.kind == "ae":
        residuals = model.values_at("residual", run.coordinates, run.inputs)
        measured["largest_residual"] = float(np.abs(residuals).max())
    return measured


def fit_cost(reduced: FittedModel | Failure) -> dict[str, object]:
    """Rank of a fit, and what it has cost; zero and missing of one that has failed."""
    failed = isinstance(reduced, Failure)
    return {
        "effective_rank": 0 if failed else reduced.order,
        "offline_seconds": np.nan if failed else reduced.offline.seconds,
        "offline_evaluations": 0 if failed else reduced.offline.evaluations,
    }


@lru_cache(maxsize=16)
def _labels(model: Model) -> xr.Coordinates:
    """Names and units of all quantities of a model."""
    nothing = _missing(model, component("maneuver", model.definition.maneuver), Failure("", ""))
    return trajectory_dataset(model, nothing).drop_dims(["time", "input"]).coords
