"""Computing trials: fit once, simulate every scenario, measure errors.  Failures are results."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.errors import ConvergenceError, InputError, UnreachableError, VehiclemorError
from vehiclemor.metrics import largest, rms
from vehiclemor.reduction.interface import Method, Offline, ReducedModel
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model
from vehiclemor.study.protocol import Settings
from vehiclemor.study.provenance import machine, versions
from vehiclemor.study.scenarios import Scenario, maneuver_of, start_of, training_run
from vehiclemor.study.trials import Trial

if TYPE_CHECKING:
    import xarray as xr

# Length (s) from the start within which the largest value of every output is stored.
FIRST_SECONDS = 10.0


@dataclass(frozen=True)
class Fit:
    """A reduced model, or why there is none."""

    reduced: ReducedModel | None
    status: str = "ok"
    message: str = ""

    @property
    def offline(self) -> Offline:
        """Cost of making it."""
        return self.reduced.offline if self.reduced else Offline(np.nan, 0)


# How a fitted model is integrated: candidates that differ in these alone are fitted once.
ONLINE = ("solver", "tolerance")


def fit(model: Model, trial: Trial) -> Fit:
    """Fit a candidate on its training scenarios, and on nothing else; kept for its next trial."""
    method: Method = component("method", trial.method)
    online = {name: value for name, value in trial.settings.items() if name in ONLINE}
    declared = method.settings(model.kind)
    common = trial.settings | {name: declared[name].default for name in online}
    fitted = _kept(trial.model, trial.method, json.dumps(common, sort_keys=True), trial.training)
    if fitted.reduced is None:
        return fitted
    if not all(hasattr(fitted.reduced, name) for name in online):
        return fresh_fit(model, trial.method, trial.settings, trial.training)
    changed: Any = fitted.reduced
    return Fit(replace(changed, **online) if online else changed)


@lru_cache(maxsize=64)
def _kept(model: str, method: str, settings: str, training: tuple[Scenario, ...]) -> Fit:
    return fresh_fit(model_of(model), method, json.loads(settings), training)


def fresh_fit(
    model: Model, method_name: str, settings: Settings, training: Sequence[Scenario]
) -> Fit:
    """Fit a method; a failure is recorded."""
    method: Method = component("method", method_name)
    accepted, reason = method.accepts(model)
    if not accepted:
        return Fit(None, "rejected", reason)
    try:
        method.check(model, settings)
        runs = [training_run(model, scenario) for scenario in training]
        return Fit(method.fit(model, runs, settings))
    except Exception as error:  # noqa: BLE001 - a failure is a result, not the end of the study
        return Fit(None, *_failure(error))


def _failure(error: Exception) -> tuple[str, str]:
    """Status and message of a run that could not be finished."""
    text = " ".join(str(error).split())
    if isinstance(error, UnreachableError):
        return "unreachable", text
    if isinstance(error, ConvergenceError):
        return "diverged", text
    if isinstance(error, InputError):
        return "rejected", text
    if isinstance(error, VehiclemorError):
        raise error
    return "error", f"{type(error).__name__}: {text}"


@dataclass(frozen=True)
class Outcome:
    """Result of one scenario; errors (outputs,) are missing where the run has failed."""

    status: str
    message: str
    rms_error: np.ndarray
    max_error: np.ndarray
    largest_output: np.ndarray
    counts: dict[str, int]
    seconds: float


@lru_cache(maxsize=8)
def model_of(name: str) -> Model:
    """The model with its own parameters; kept, since all trials of a protocol share it."""
    return build(name)


@lru_cache(maxsize=512)
def reference_outputs(model_name: str, scenario: Scenario) -> np.ndarray:
    """Full-order outputs (samples, outputs) at the model's default tolerance."""
    model = model_of(model_name)
    trajectory = model.simulate(maneuver_of(scenario), start_of(model, scenario))
    if trajectory.status != "ok":
        raise ConvergenceError(trajectory.message)
    return trajectory.outputs


def outcome(model: Model, fitted: Fit, scenario: Scenario) -> Outcome:
    """Simulate one scenario and measure the errors against the full-order solution."""
    missing = np.full(len(model.outputs), np.nan)
    status, message = fitted.status, fitted.message
    if fitted.reduced is not None:
        whose = "the full-order reference: "
        try:
            reference = reference_outputs(model.name, scenario)
            whose = ""
            maneuver = maneuver_of(scenario)
            run = fitted.reduced.simulate(maneuver, start_of(model, scenario))
        except Exception as error:  # noqa: BLE001 - a failure is a result
            status, message = _failure(error)
            message = whose + message
        else:
            if run.status == "ok" and np.isfinite(run.outputs).all():
                first = maneuver.times <= FIRST_SECONDS
                return Outcome(
                    "ok",
                    run.message,
                    rms(run.outputs - reference),
                    largest(run.outputs - reference),
                    largest(run.outputs[first]),
                    run.counts,
                    run.seconds,
                )
            status = run.status if run.status != "ok" else "diverged"
            message = run.message or "an output is not finite"
    return Outcome(status, message, missing, missing, missing, {}, np.nan)


def compute(trials: Sequence[Trial]) -> list[xr.Dataset]:
    """Results of trials of one candidate, which is fitted once."""
    model = model_of(trials[0].model)
    fitted = fit(model, trials[0])
    return [_dataset(model, trial, fitted) for trial in trials]


def _dataset(model: Model, trial: Trial, fitted: Fit) -> xr.Dataset:
    import xarray as xr

    found = [outcome(model, fitted, scenario) for scenario in trial.scenarios]
    variables: dict[str, tuple] = {}
    for name, text in (
        ("rms_error", "RMS error of the output against the full-order solution"),
        ("max_error", "largest absolute error of the output"),
        ("largest_output", f"largest absolute value in the first {FIRST_SECONDS:g} s"),
    ):
        values = np.array([getattr(one, name) for one in found])
        attributes = {"units": "see output_unit", "long_name": text}
        variables[name] = (("scenario", "output"), values, attributes)
    for name, text in model.counts.items():
        values = np.array([one.counts.get(name, 0) for one in found])
        variables[name] = ("scenario", values, {"units": "1", "long_name": text})
    variables["seconds"] = (
        "scenario",
        np.array([one.seconds for one in found]),
        {"units": "s", "long_name": "time in the compiled loop, not repeated"},
    )
    for name, text in (("status", "ok, or why there is no result"), ("message", "what failed")):
        values = np.array([getattr(one, name) for one in found], dtype=object)
        variables[name] = ("scenario", values, {"long_name": text})
    rank = fitted.reduced.effective_rank if fitted.reduced else 0
    offline = fitted.offline
    variables["effective_rank"] = ((), rank, {"units": "1", "long_name": "reduced coordinates"})
    text = "training simulations and fit"
    variables["offline_seconds"] = ((), offline.seconds, {"units": "s", "long_name": text})
    text = "evaluations of the full model's equations in training"
    variables["offline_evaluations"] = ((), offline.evaluations, {"units": "1", "long_name": text})
    names = [quantity.name for quantity in model.equations.outputs]
    units = [quantity.unit for quantity in model.equations.outputs]
    coordinates = {
        "scenario": [scenario.label for scenario in trial.scenarios],
        "output": names,
        "output_unit": ("output", units),
    }
    dataset = xr.Dataset(variables, coordinates)
    dataset.attrs = {
        "Conventions": "CF-1.11",
        "title": f"{trial.method} on {trial.model}, {trial.purpose}",
        "source": "vehiclemor",
        "trial": trial.key,
        "configuration": trial.configuration,
        "kernel_hash": trial.kernel,
        "versions": versions(),
        "machine": machine(),
    }
    return dataset
