"""Evaluating experiments: fit on the training, simulate the tests.  Failures are results."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vehiclemor.errors import ConvergenceError, InputError, PlugInError, blamed
from vehiclemor.metrics import rms
from vehiclemor.progress import first_use
from vehiclemor.reduction.interface import FitOther, Method, ReducedModel
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.validation import checked_run, checked_settings, fitted
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start, Trajectory
from vehiclemor.study.cell_file import Layout, decoded, encoded
from vehiclemor.study.experiment import Experiment
from vehiclemor.study.failure import Failure, attempt
from vehiclemor.study.input_range import input_range
from vehiclemor.study.linear_algebra import one_thread
from vehiclemor.study.method_settings import default_settings, for_method
from vehiclemor.study.result import (
    Outcome,
    errors_dataset,
    fit_cost,
    metrics_dataset,
)
from vehiclemor.study.scenario import (
    Overrides,
    Scenario,
    car_of,
    in_training,
    start_of,
    training_run,
    with_parameters,
)

if TYPE_CHECKING:
    import xarray as xr


# How a fitted model is integrated: experiments that differ in these alone are fitted once.
ONLINE = ("solver", "tolerance")


class Fit(NamedTuple):
    """All that determines a fit.

    Attributes
    ----------
    model
        The experiment's.
    car
        What differs from it in the model that is reduced.
    settings
        As text.
    code, function
        Hash of the source, and the method's own, which may be written anew under the same name.
    """

    model: Model
    car: Overrides
    method: str
    settings: str
    training: tuple[Scenario, ...]
    code: str
    function: Callable


@dataclass
class Fitted:
    """A fit, and whether it has been run before."""

    reduced: ReducedModel | Failure
    warm: bool = False


def evaluate(
    experiment: Experiment, model: Model | None = None, *, errors: bool = True
) -> xr.Dataset:
    """Labelled result of an experiment, whatever becomes of it.

    Parameters
    ----------
    model
        The model that the experiment was made with; what was lately fitted to it and solved with it
        is used again.  By default it is built from the registry, and that of all other experiments
        is.
    errors
        Whether to compare with the full-order solution; without it, it is not solved.

    Returns
    -------
    xarray.Dataset
        As the experiment keeps it, see `study/result.py`.  Where nothing could be computed the
        values are missing, and `status` and `message` tell why.
    """
    kept = model is None
    with first_use(f"{experiment.model} with {experiment.method}"), one_thread():
        model = model or model_of(experiment)
        found = attempt(partial(_evaluated, experiment, model, kept, errors))
        return _failed(experiment, model, found) if isinstance(found, Failure) else found


def _evaluated(experiment: Experiment, model: Model, kept: bool, errors: bool) -> xr.Dataset:
    refused = refusal(model, experiment)
    solve = kept_reference if kept else recent_reference
    fitted = Fitted(refused) if refused else _shared(_wanted(model, experiment))
    outcomes: list[Outcome | Failure] = []
    for scenario in experiment.test:
        outcome: Any = refused
        if errors and not refused:
            outcome = attempt(partial(solve, model, scenario), "the full-order reference: ")
        if not isinstance(outcome, Failure):
            outcome = _tested(model, fitted, scenario, outcome, experiment)
        outcomes.append(outcome)
    if experiment.keep == "errors":
        return errors_dataset(model, experiment, outcomes, fit_cost(fitted.reduced))
    car = car_of(model, experiment.test[0])
    seen = not isinstance(outcomes[0], Failure) and _seen(model, experiment)
    return metrics_dataset(car, experiment, outcomes[0], fitted.reduced, seen)


def _seen(model: Model, experiment: Experiment) -> bool:
    """Whether the method has learnt from the very run that it is tested on."""
    method: Method = component("method", experiment.method)
    learns = method.learns_from != "inputs"
    return learns and in_training(model, experiment.training, experiment.test[0])


def _failed(experiment: Experiment, model: Model, failure: Failure) -> xr.Dataset:
    """Result of an experiment that a bug has ended."""
    outcomes = [failure] * len(experiment.test)
    if experiment.keep == "errors":
        return errors_dataset(model, experiment, outcomes, fit_cost(failure))
    return metrics_dataset(model, experiment, failure, failure)


def layout_of(experiment: Experiment) -> Layout:
    """What the result of an experiment holds, whatever becomes of it."""
    test = experiment.test
    like = experiment.kernel, experiment.keep, len(test), test[0].maneuver.samples
    if like not in _LAYOUTS:
        failed = _failed(experiment, model_of(experiment), Failure("error", ""))
        _LAYOUTS[like] = decoded(encoded(failed, ""), "").layout
    return _LAYOUTS[like]


_LAYOUTS: dict[tuple[str, str, int, int], Layout] = {}


def model_of(experiment: Experiment) -> Model:
    """The model of an experiment; kept, since all experiments of a study share it."""
    return _built(experiment.model, _text(experiment.parameters))


@lru_cache(maxsize=16)
def _built(name: str, parameters: str) -> Model:
    return build(name, overrides=json.loads(parameters))


def refusal(model: Model, experiment: Experiment) -> Failure | None:
    """Why the method can't reduce the model with these settings, if it can't."""

    def check() -> None:
        method: Method = component("method", experiment.method)
        accepted, reason = method.accepts(model)
        if not accepted:
            raise InputError(reason)
        settings = for_method(model, experiment.method, experiment.settings)
        checked_settings(method, model, settings)

    return attempt(check)


def reference_run(model: Model, scenario: Scenario) -> Trajectory:
    """Full-order solution at the model's default tolerance."""
    trajectory = car_of(model, scenario).simulate(scenario.maneuver, start_of(model, scenario))
    if trajectory.status != "ok":
        raise ConvergenceError(trajectory.message)
    return trajectory


# As many as a session goes back and forth between; they are large.
RECENT = 16
recent_reference = lru_cache(maxsize=RECENT)(reference_run)
# More than the scenarios of any protocol, each of which is simulated with every candidate.
kept_reference = lru_cache(maxsize=1024)(reference_run)


def _wanted(model: Model, experiment: Experiment) -> Fit:
    settings = _text(experiment.settings)
    car, method = experiment.test[0].parameters, experiment.method
    function = component("method", method).fit
    return Fit(model, car, method, settings, experiment.training, experiment.code, function)


def fresh_fit(model: Model, experiment: Experiment) -> ReducedModel | Failure:
    """Fit the method on the training scenarios, and on nothing else."""
    return _fit(_wanted(model, experiment))


def kept_fit(model: Model, experiment: Experiment) -> ReducedModel | Failure:
    """As `fresh_fit`, but what was fitted before is used again."""
    return _shared(_wanted(model, experiment)).reduced


def _shared(fit: Fit) -> Fitted:
    """A fit that may be shared; a bug is not kept, since it may be mended before the next try."""
    try:
        return _kept(fit)
    except _BrokenFitError as bug:
        return Fitted(bug.args[0])


class _BrokenFitError(Exception):
    """Carries the failure of a fit."""


# More than the fits of a study of protocols, some of which take a minute.
@lru_cache(maxsize=128)
def _kept(fit: Fit) -> Fitted:
    """A fit; one that differs from another in its integration alone shares what that has fitted."""
    settings = json.loads(fit.settings)
    defaults = default_settings(fit.model, fit.method)
    online = {name: value for name, value in settings.items() if name in ONLINE}
    common = _text(settings | {name: defaults[name] for name in online})
    if common != fit.settings:
        found: Any = _shared(fit._replace(settings=common)).reduced
        if isinstance(found, Failure):
            return _unbroken(found)
        if all(hasattr(found, name) for name in online):
            return Fitted(replace(found, **online))

    def other(name: str, given: Any) -> ReducedModel:
        content, function = _text(given.model_dump()), component("method", name).fit
        shared = _shared(fit._replace(method=name, settings=content, function=function)).reduced
        if isinstance(shared, Failure):
            # Fitted again it fails as it does alone.
            return fitted(component("method", name), *_given(fit), given)
        return shared

    return _unbroken(_fit(fit, other))


def _unbroken(reduced: ReducedModel | Failure) -> Fitted:
    if isinstance(reduced, Failure) and reduced.status == "error":
        raise _BrokenFitError(reduced)
    return Fitted(reduced)


def _fit(fit: Fit, others: FitOther | None = None) -> ReducedModel | Failure:
    method: Method = component("method", fit.method)

    def made() -> ReducedModel:
        complete = for_method(fit.model, fit.method, json.loads(fit.settings))
        return fitted(method, *_given(fit), complete, others)

    with one_thread():
        return attempt(made)


def _given(fit: Fit) -> tuple[Model, list[TrainingRun]]:
    """The model that a method is fitted to, and what it learns from."""
    return with_parameters(fit.model, fit.car), [training_run(fit.model, s) for s in fit.training]


def _text(content: Mapping[str, object]) -> str:
    return json.dumps(content, sort_keys=True)


def _tested(
    model: Model,
    fitted: Fitted,
    scenario: Scenario,
    reference: Trajectory | None,
    experiment: Experiment,
) -> Outcome | Failure:
    """One test scenario, simulated with the reduced model of its car."""
    if isinstance(fitted.reduced, Failure):
        return fitted.reduced
    reduced: ReducedModel = fitted.reduced

    def run() -> Outcome:
        car, start = car_of(model, scenario), start_of(model, scenario)
        if experiment.keep == "errors":
            trajectory = _sound(car, reduced, scenario, start)
            trajectory = warned(model, experiment, scenario, trajectory)
            return Outcome(trajectory, reference)
        # The first run loads machine code and warms caches, another is timed where it is compared.
        if not fitted.warm and reference is not None:
            checked_run(car, scenario.maneuver, start, reduced)
            fitted.warm = True
        trajectory = _sound(car, reduced, scenario, start)
        trajectory = _remarked(model, experiment, scenario, trajectory)
        if reference is None:
            return Outcome(trajectory, None)
        with blamed(f"method {experiment.method!r}: best_approximation", reduced):
            nearest = reduced.best_approximation(reference.states)
        if nearest is None:
            return Outcome(trajectory, reference)
        if np.shape(nearest) != reference.states.shape:
            raise PlugInError(
                f"best_approximation gives shape {np.shape(nearest)}, not its argument's"
            )
        floor = rms(car.outputs_at(nearest, reference.inputs) - reference.outputs)
        return Outcome(trajectory, reference, floor)

    return attempt(run)


def warned(model: Model, experiment: Experiment, test: Scenario, run: Trajectory) -> Trajectory:
    """A run; it is not trusted beyond the training's inputs if its model is silent."""
    # What has learned from nothing is the full order of a protocol's second runs.
    if not experiment.training:
        return run
    method: Method = component("method", experiment.method)
    if run.trust or method.own_limits:
        return run
    known = input_range(model, experiment.training, method.follows_time)
    return run.judged(known.trust(model, test))


def _remarked(model: Model, experiment: Experiment, test: Scenario, run: Trajectory) -> Trajectory:
    """A run with a remark where a protocol would not trust it; its status is the method's own."""
    judged = warned(model, experiment, test, run)
    if judged.status == run.status:
        return run
    told = f"not to be trusted {judged.message}"
    return replace(run, remark="; ".join(part for part in (run.remark, told) if part))


def _sound(model: Model, reduced: ReducedModel, scenario: Scenario, start: Start) -> Trajectory:
    """A run; what ends without complaint, but in values that are no numbers, diverged."""
    trajectory = checked_run(model, scenario.maneuver, start, reduced)
    if not trajectory.finished or np.isfinite(trajectory.outputs).all():
        return trajectory
    return replace(trajectory, status="diverged", message="an output is not finite")
