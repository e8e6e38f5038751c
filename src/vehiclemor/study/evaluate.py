"""Evaluating experiments: fit on the training, simulate the tests.  Failures are results."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vehiclemor.error_measures import rms
from vehiclemor.exceptions import ConvergenceError, InputError, PlugInError, blamed
from vehiclemor.failure import Failure, attempt
from vehiclemor.progress import first_use
from vehiclemor.reduction.error_estimate import judged as judged_by_error
from vehiclemor.reduction.fallback import with_fallback
from vehiclemor.reduction.interface import FittedModel, Method, lower_rank
from vehiclemor.reduction.reduced_model import rom as shipped
from vehiclemor.reduction.settings import Settings
from vehiclemor.reduction.trust import InputRange, input_range
from vehiclemor.reduction.validation import checked_run, checked_settings, fitted
from vehiclemor.registry import component
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.run_timer import one_thread
from vehiclemor.simulation.trajectory import WITHOUT_COMPLAINT, Trajectory
from vehiclemor.study.experiment import Experiment, default_settings, for_method, make_experiment
from vehiclemor.study.result import Outcome, result_dataset
from vehiclemor.study.scenario import (
    Overrides,
    Scenario,
    driven_by_all,
    in_training,
    model_of_run,
    speed_of,
    start_of,
    training_run,
    with_parameters,
)

if TYPE_CHECKING:
    import xarray as xr


# Settings that are read after the fit, beside those of the integration.
FALLBACK = ("fallback", "fallback_tolerance")
# More than the fits of a study of protocols, some of which take a minute.
MOST_FITS = 128
# Runs that a learned model solves together: their paths stay in memory.
MOST_IN_STEP = 300


class Fit(NamedTuple):
    """All that determines a fit: the parameters differ from the model's, settings are JSON text.

    `function` is that of the method, which may be written anew under the same name.
    """

    model: Model
    parameters: Overrides
    method: str
    settings: str
    training: tuple[Scenario, ...]
    code: str
    function: Callable


@dataclass
class Fitted:
    """A fit, and whether it has been run before."""

    reduced: FittedModel | Failure
    warm: bool = False


def evaluate(
    experiment: Experiment, model: Model | None = None, *, errors: bool = True
) -> xr.Dataset:
    """Labelled result of an experiment, whatever becomes of it.

    Where nothing could be computed the values are missing, and `status` and `message` say why.
    What was lately solved with a `model` that is given is used again; by default it is built from
    the registry.  Without `errors` the full order is not solved.
    """
    solve = cached_reference if model is None else recent_reference
    with first_use(f"{experiment.model} with {experiment.method}"), one_thread():
        full = model or model_of(experiment)
        result = attempt(partial(_evaluated, experiment, full, solve if errors else None))
        if isinstance(result, Failure):
            # A bug has ended it.
            result = result_dataset(full, experiment, [result] * len(experiment.test), result)
    return result


def _evaluated(experiment: Experiment, model: Model, solve: Callable | None) -> xr.Dataset:
    test = experiment.test
    model = driven_by_all(model, (*experiment.training, *test))
    tested = model_of_run(model, test[0])
    if refused := refusal(model, experiment):
        return result_dataset(tested, experiment, [refused] * len(test), refused)
    fit, outcomes = _shared(_wanted(model, experiment)), []
    for at in range(0, len(test), MOST_IN_STEP):
        some = test[at : at + MOST_IN_STEP]
        solved = _in_step(fit, experiment, model, some)
        outcomes += [_outcome(experiment, model, solved, scenario, solve) for scenario in some]
    method: Method = component("method", experiment.method)
    # Whether it has learnt from the very run that it is tested on.
    seen = (
        experiment.keep != "errors"
        and method.learns_from == "runs"
        and not isinstance(outcomes[0], Failure)
        and in_training(model, experiment.training, test[0])
    )
    return result_dataset(tested, experiment, outcomes, fit.reduced, seen)


def evaluate_shipped(name: str, scenario: Scenario, *, errors: bool = True) -> xr.Dataset:
    """As `evaluate`, of the reduced model that ships for a model of this name."""
    rom = shipped(name)
    experiment = make_experiment(rom.model, rom.method, {**rom.settings}, (), (scenario,))

    def solved() -> Outcome:
        reference = recent_reference(rom.model, scenario) if errors else None
        # The first run loads machine code.
        rom.simulate(scenario.maneuver, scenario.start)
        return Outcome(rom.simulate(scenario.maneuver, scenario.start), reference)

    return result_dataset(rom.model, experiment, [attempt(solved)], rom.reduced)


def model_of(experiment: Experiment) -> Model:
    """The model of an experiment; cached, since all experiments of a study share it."""
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
    trajectory = model_of_run(model, scenario).simulate(
        scenario.maneuver, start_of(model, scenario)
    )
    if trajectory.status not in WITHOUT_COMPLAINT:
        raise ConvergenceError(trajectory.message)
    return trajectory


# As many as a session goes back and forth between; they are large.
RECENT = 16
recent_reference = lru_cache(maxsize=RECENT)(reference_run)
# More than the scenarios of any protocol, each of which is simulated with every candidate.
cached_reference = lru_cache(maxsize=1024)(reference_run)


def _wanted(model: Model, experiment: Experiment) -> Fit:
    # A fit needs all inputs of its training, whoever asks for it.
    model = driven_by_all(model, (*experiment.training, *experiment.test))
    settings, method = _text(experiment.settings), experiment.method
    online, function = model.definition.online, component("method", method).fit
    changed = tuple(pair for pair in experiment.test[0].parameters if pair[0] not in online)
    return Fit(model, changed, method, settings, experiment.training, experiment.code, function)


def fresh_fit(model: Model, experiment: Experiment) -> FittedModel | Failure:
    """Fit the method on the training scenarios, and on nothing else."""
    return _fit(_wanted(model, experiment))


def cached_fit(model: Model, experiment: Experiment) -> FittedModel | Failure:
    """As `fresh_fit`, but what was fitted before is used again."""
    return _shared(_wanted(model, experiment)).reduced


_FITS: dict[Fit, Fitted] = {}


def _shared(fit: Fit) -> Fitted:
    """A fit that may be shared; what was not used for the longest time is forgotten."""
    shared = _FITS.pop(fit, None) or Fitted(_new_fit(fit))
    # A bug may be mended before the next try.
    if not (isinstance(shared.reduced, Failure) and shared.reduced.status == "error"):
        _FITS[fit] = shared
        if len(_FITS) > MOST_FITS:
            del _FITS[next(iter(_FITS))]
    return shared


def _new_fit(fit: Fit) -> FittedModel | Failure:
    """A fit; those that differ only in settings that are read after it share one result."""
    settings = json.loads(fit.settings)
    method: Method = component("method", fit.method)
    if method.variant_of:
        method = component("method", method.variant_of)
    integration = method.settings.get(fit.model.kind, Settings).integration
    defaults = default_settings(fit.model, method.name)
    read_later = [name for name in (*integration, *FALLBACK) if name in settings]
    common = settings | {name: defaults[name] for name in read_later}
    first = fit._replace(method=method.name, settings=_text(common), function=method.fit)
    if first == fit:
        return _fit(fit)
    reduced: Any = _shared(first).reduced
    if isinstance(reduced, Failure):
        return reduced
    reduced = replace(reduced, **{name: settings[name] for name in integration})
    return with_fallback(reduced, fit.model, for_method(fit.model, fit.method, settings))


def _fit(fit: Fit) -> FittedModel | Failure:
    method: Method = component("method", fit.method)

    def fit_model() -> FittedModel:
        model = with_parameters(fit.model, fit.parameters).driven_as(fit.model)
        runs = [training_run(fit.model, scenario) for scenario in fit.training]
        settings = for_method(fit.model, fit.method, json.loads(fit.settings))
        return fitted(method, model, runs, settings)

    with one_thread():
        return attempt(fit_model)


def _in_step(
    fit: Fitted, experiment: Experiment, model: Model, test: tuple[Scenario, ...]
) -> Fitted:
    """A fit that has solved some tests together, where it can and no time is measured."""
    solve = getattr(fit.reduced, "in_step", None)
    if solve is None or experiment.keep != "errors":
        return fit

    def solved() -> FittedModel:
        runs = [
            (model_of_run(model, scenario), scenario.maneuver, start_of(model, scenario))
            for scenario in test
        ]
        return solve(runs)

    reduced = attempt(solved)
    # What fails does so again in its own run, which says so.
    return fit if isinstance(reduced, Failure) else Fitted(reduced, fit.warm)


def _text(content: Mapping[str, object]) -> str:
    return json.dumps(content, sort_keys=True)


def _outcome(
    experiment: Experiment, model: Model, fit: Fitted, scenario: Scenario, solve: Callable | None
) -> Outcome | Failure:
    """A test scenario, solved in full order if asked for, and with the reduced model."""
    reference: Any = None
    if solve:
        reference = attempt(partial(solve, model, scenario), "the full-order reference: ")
    for part in (reference, fit.reduced):
        if isinstance(part, Failure):
            return part
    return attempt(partial(_tested, experiment, model, fit, scenario, reference))


def _tested(
    experiment: Experiment,
    model: Model,
    fit: Fitted,
    scenario: Scenario,
    reference: Trajectory | None,
) -> Outcome:
    """A test scenario, simulated with the reduced model."""
    tested, start = model_of_run(model, scenario), start_of(model, scenario)
    reduced: Any = for_run(fit.reduced, tested)
    many = experiment.keep == "errors"
    # The first run loads machine code and warms caches, another is timed where it is compared.
    if not (many or fit.warm or reference is None):
        checked_run(tested, scenario.maneuver, start, reduced)
        fit.warm = True
    simulate = partial(checked_run, tested, reduced=reduced)
    run = simulate(scenario.maneuver, start)
    if run.finished and not np.isfinite(run.outputs[: run.samples_to_stop]).all():
        run = replace(run, status="diverged", message="an output is not finite")
    if reference is not None and run.stops_early(reference):
        message = f"{run.message}, where the full order drives on"
        run = replace(run, status="diverged", message=message)
    if remark := lower_rank(experiment.settings, reduced):
        run = replace(run, remark="; ".join(filter(None, (run.remark, remark))))
    method: Method = component("method", experiment.method)
    judged = run
    if not method.own_limits:
        judged = judged_by_error(run, simulate, (scenario.maneuver, start))
    trained = partial(known_inputs, model, experiment.training)
    # A model that is silent is not trusted beyond the inputs that its method knows.
    if not judged.trust and (known := method.known_range(model, experiment.settings, trained)):
        judged = run.judged(known.trust(model, scenario.maneuver, speed_of(model, scenario)))
    if many:
        return Outcome(judged, reference)
    # Times of a study on a grid are those of the method alone.
    judged = Trajectory.of(**judged.__dict__ | {"seconds": run.seconds})
    if judged.status != run.status:
        # A study shows what a protocol would not trust; the status is that of the method.
        remark = "; ".join(filter(None, (run.remark, f"untrusted: {judged.message}")))
        judged = replace(judged, status=run.status, message=run.message, remark=remark)
    if reference is None:
        return Outcome(judged, None)
    states = reference.states
    with blamed(f"method {experiment.method!r}: best_approximation", reduced):
        nearest = reduced.best_approximation(states)
    if nearest is None:
        return Outcome(judged, reference)
    if nearest is states:
        return Outcome(judged, reference, np.zeros(len(tested.outputs)))
    if np.shape(nearest) != states.shape:
        raise PlugInError(f"best_approximation gives shape {np.shape(nearest)}, not its argument's")
    projected = tested.outputs_at(nearest, reference.inputs)
    return Outcome(judged, reference, rms(projected - reference.outputs))


def for_run(reduced: Any, tested: Model) -> Any:
    """A reduced model with the online parameters of a run."""
    if not tested.definition.online or getattr(reduced, "model", tested) is tested:
        return reduced
    return getattr(reduced, "for_model", lambda _: reduced)(tested)


@lru_cache(maxsize=64)
def known_inputs(model: Model, training: tuple[Scenario, ...]) -> InputRange:
    """Range of the inputs of training scenarios, see `input_range`."""
    runs = [(scenario.maneuver, speed_of(model, scenario)) for scenario in training]
    return input_range(model, runs)
