"""The Python interface: models, methods, simulations, studies, reports."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.arguments import file_path, flag, quoted, real_array
from vehiclemor.exceptions import InputError, UnreachableError, VehiclemorError
from vehiclemor.registry import component, names

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from vehiclemor.inputs.excitation import Excitation
    from vehiclemor.reduction.reduced_model import ReducedOrderModel
    from vehiclemor.simulation.model import Model
    from vehiclemor.simulation.trajectory import Start, Trajectory
    from vehiclemor.study.plans.training import Given
    from vehiclemor.study.run import StudyStatus
    from vehiclemor.study.scenario import Scenario

RESULTS = Path("results")
# Method that stands for the reduced model that ships.
SHIPPED = "shipped"


def models() -> dict[str, str]:
    """Registered models: name -> one line."""
    return _summaries("model")


def methods() -> dict[str, str]:
    """Registered reduction methods: name -> one line."""
    return _summaries("method")


def maneuvers() -> dict[str, str]:
    """Registered maneuvers: name -> one line."""
    return _summaries("maneuver")


def _summaries(kind: str) -> dict[str, str]:
    """One line for each component; a broken plug-in is listed with what is wrong with it."""
    lines = {}
    for name in names(kind):
        try:
            lines[name] = str(component(kind, name).summary)
        except VehiclemorError as error:
            lines[name] = f"broken: {error}"
    return lines


def studies() -> dict[str, str]:
    """Studies that come with the package: name -> one line."""
    from vehiclemor.files import data_names
    from vehiclemor.study.plans.loading import read_study, study_path

    return {name: read_study(study_path(name)).title for name in data_names("studies")}


def describe(name: str | Path) -> dict[str, object]:
    """What a model, method, maneuver or study declares; lists of dictionaries are tables.

    Parameters
    ----------
    name
        Registered name, name or TOML file of a study, or `study-schema`,
        `parameter-schema` for the keys of such a file.

    Raises
    ------
    VehiclemorError
        If nothing has that name.
    """
    from vehiclemor.report.description import description

    return description(str(file_path("name", name)))


def model(
    name: str,
    parameters: Mapping[str, object] | None = None,
    parameter_file: str | Path | None = None,
    inputs: Mapping[str, object] | None = None,
) -> Model:
    """A model ready to run: derived, compiled (or fetched from the kernel cache), parametrised.

    Parameters
    ----------
    name
        Registered name, see `models()`.
    parameters
        Parameter name -> value in SI units that replaces the file's.
    parameter_file
        Parameter file; the model's public data by default.
    inputs
        Optional input, such as the friction of a tire, -> constant value in SI units in runs that
        don't drive it.  It is a parameter then.

    Raises
    ------
    VehiclemorError
        If a name or value is wrong, or the mechanism can't be assembled.
    """
    from vehiclemor.simulation.build import build

    path = None if parameter_file is None else file_path("parameter_file", parameter_file)
    return build(name, path, parameters, constant_inputs=inputs)


def reduce(
    model: str | Model,
    method: str,
    *,
    training: Given | None = None,
    preset: str = "recommended",
    **settings: object,
) -> ReducedOrderModel:
    """Reduce a model: fit a method to training runs of the full model.

    Parameters
    ----------
    model
        Registered name, or a model of `model()`.
    method
        Registered name, see `methods()`; `full_order` gives the full model with the same names.
    training
        `nominal`: the model's maneuver from its first start.  `protocol`: the training set of the
        model's protocol, the default of the methods that compete there.  Or the name of a maneuver,
        a maneuver, a signal, a scenario, or a list of these.
    preset, **settings
        Of the method; see `describe()`.

    Raises
    ------
    VehiclemorError
        If a name or value is wrong, or the method can't reduce the model.
    """
    from vehiclemor.progress import first_use
    from vehiclemor.reduction.reduced_model import ReducedOrderModel
    from vehiclemor.reduction.validation import checked_settings, fitted, validated
    from vehiclemor.simulation.build import build
    from vehiclemor.simulation.model import Model
    from vehiclemor.simulation.run_timer import one_thread
    from vehiclemor.study.evaluate import known_inputs
    from vehiclemor.study.plans.training import training_set
    from vehiclemor.study.scenario import driven_by_all, training_run

    ready = model if isinstance(model, Model) else build(model)
    definition = component("method", method)
    definition.require(ready)
    scenarios = training_set(ready, method, training)
    ready = driven_by_all(ready, scenarios)
    definition.require(ready)
    complete = validated(definition, ready.kind, settings, preset, len(ready.coordinates))
    checked_settings(definition, ready, complete)
    with first_use(f"{ready.name} with {method}"), one_thread():
        runs = [training_run(ready, scenario) for scenario in scenarios]
        reduced = fitted(definition, ready, runs, complete)
    known = known_inputs(ready, scenarios)
    return ReducedOrderModel(ready, method, complete.model_dump(), scenarios, reduced, known)


def simulate(
    model: str | Model,
    method: str = "full_order",
    *,
    maneuver: str | Excitation | None = None,
    start: Start | None = None,
    frequency: float = 1.0,
    amplitude: float = 1.0,
    preset: str = "recommended",
    training: Given = "matched",
    training_set: Sequence[tuple[float, float]] = (),
    errors: bool = True,
    **settings: object,
) -> xr.Dataset:
    """Simulate a model with a method and measure its errors against the full-order solution.

    Models by name, the last fits and the last full-order solutions are cached, and used again
    while nothing that they depend on changes.

    Parameters
    ----------
    model
        Registered name, or a model of `model()`.
    method
        Registered name, see `methods()`; or `shipped`, the model of `vm.rom`, of a model by name.
    maneuver
        Registered name, maneuver or signal; the model's maneuver by default.
    start
        Initial condition, by name or as a state (n,); the model's first by default.
    frequency, amplitude
        Factors on the maneuver, times those that it has.
    preset
        `recommended`, or another preset of the method, such as `literal` (the paper's words).
    training
        Training runs: `matched` (the very run that is simulated), `nominal` (the model's maneuver),
        the name of a maneuver, a maneuver, a signal or a scenario; `protocol` (the training of the
        model's protocol), `set`; or a list of these.
    training_set
        (frequency, amplitude) factors on the maneuver, of `set`.
    errors
        Whether to compare with the full-order solution; else only the method runs.
    **settings
        Settings of the method, such as `rank=3`, and `tolerance` of its solver.

    Returns
    -------
    xarray.Dataset
        Histories, errors, projection errors, counts, seconds and status, with units.

    Raises
    ------
    VehiclemorError
        If the input is wrong or can't be reached.  A model that diverges is a result.
    """
    from vehiclemor.simulation.build import kept_build
    from vehiclemor.simulation.model import Model
    from vehiclemor.study.evaluate import evaluate, evaluate_shipped
    from vehiclemor.study.experiment import complete_settings, make_experiment
    from vehiclemor.study.plans.training import training_set as training_of

    ready = model if isinstance(model, Model) else kept_build(model)
    flag("errors", errors)
    test = _scenario(ready, maneuver, start, (frequency, amplitude))
    if method == SHIPPED:
        chosen = settings or len(training_set) or (preset, training) != ("recommended", "matched")
        if chosen or not isinstance(model, str):
            with_no = "give a model by its name, no settings, preset, training or parameters"
            raise InputError(f"method {SHIPPED} is fitted already: {with_no}")
        dataset = evaluate_shipped(model, test, errors=errors)
    else:
        chosen = complete_settings(ready, method, settings, preset)
        trained = training_of(ready, method, training, test, _pairs(training_set))
        experiment = make_experiment(ready, method, chosen, trained, (test,))
        dataset = evaluate(experiment, ready, errors=errors)
    errors_of = {"unreachable": UnreachableError, "rejected": InputError}
    if (status := str(dataset["status"].item())) in errors_of:
        raise errors_of[status](str(dataset["message"].item()))
    return dataset


def _scenario(
    model: Model,
    maneuver: str | Excitation | None,
    start: Start | None,
    factors: tuple[float, float],
) -> Scenario:
    """The run to simulate, checked."""
    from vehiclemor.inputs.checks import checked_maneuver
    from vehiclemor.inputs.excitation import FACTORS, checked_factor
    from vehiclemor.study.scenario import Scenario, check

    chosen = model.definition.maneuver if maneuver is None else maneuver
    base = checked_maneuver(chosen, model.driven_by(chosen).definition)
    start = model.starts[0] if start is None else start
    begin = start if isinstance(start, str) else tuple(model.start(start).tolist())
    pairs = zip(FACTORS, factors, strict=True)
    scaled = [checked_factor(name, f) * getattr(base, f"{name}_factor") for name, f in pairs]
    scenario = Scenario(base.perturbed(*scaled), begin)
    check(model, scenario)
    return scenario


def _pairs(training_set: Any) -> list[tuple[float, float]]:
    """Pairs (frequency factor, amplitude factor); `InputError` if they are none."""
    wrong = f"training_set is {quoted(training_set)}, not a list of pairs (frequency, amplitude)"
    try:
        pairs = real_array(training_set if len(training_set) else np.zeros((0, 2)))
    except (TypeError, ValueError):
        raise InputError(wrong) from None
    if pairs.ndim != 2 or pairs.shape[1] != 2:
        raise InputError(wrong)
    return [(frequency, amplitude) for frequency, amplitude in pairs.tolist()]


def run_study(
    study: str | Path,
    jobs: int = 1,
    results: str | Path = RESULTS,
    progress: Callable[[str, int, int], None] | None = None,
    scheduler: str = "",
    seed: int | None = None,
) -> xr.Dataset:
    """Run a study, resuming where an earlier run stopped.

    Parameters
    ----------
    study
        Name of a study or collection (see `studies()`), or path of a TOML file.
    jobs
        Number of processes.
    results
        Results folder.
    progress
        Called with (study, finished runs, all runs).
    scheduler
        Address of a dask scheduler whose workers compute.
    seed
        Samples fresh test runs of protocols, for an audit; by default the file's seed.

    Returns
    -------
    xarray.Dataset
        Combined dataset on the dimensions of the study's grid.  For a collection, one row for each
        run of its studies on the dimension `cell`, without histories; the datasets of the studies
        are in the folder `studies`.
    """
    from vehiclemor.progress import listening
    from vehiclemor.study.plans.results import flattened
    from vehiclemor.study.run import run_studies

    if progress is not None and not callable(progress):
        raise InputError(f"progress is {quoted(progress)}, not a function")
    if not isinstance(scheduler, str):
        raise InputError(f"scheduler is {quoted(scheduler)}, not an address")
    with listening(progress):
        study, folder = str(file_path("study", study)), file_path("results", results)
        datasets = run_studies(study, folder, jobs, scheduler, seed)
    return next(iter(datasets.values())) if len(datasets) == 1 else flattened(datasets)


def status(
    study: str | Path, results: str | Path = RESULTS, seed: int | None = None
) -> dict[str, StudyStatus]:
    """How far a study, or every one of a collection, is; nothing is computed.

    Parameters
    ----------
    study, results, seed
        As of `run_study`.

    Returns
    -------
    dict
        Study name -> runs that are done, failed (with reasons) and to do.
    """
    from vehiclemor.study.run import status_of

    return status_of(str(file_path("study", study)), file_path("results", results), seed)


def plot(
    result: xr.Dataset | Trajectory | str | Path,
    *beside: Trajectory | str,
    kind: str = "histories",
    out: str | Path | None = None,
    results: str | Path = RESULTS,
    **at: object,
) -> Figure:
    """Draw a result.

    Parameters
    ----------
    result
        A run, a dataset, a netCDF file, or the name of a study that was run.
    *beside
        The full-order run of the same input, to be drawn with the run; or the kind.
    kind
        `histories`, `paths` or `errors`.
    out
        Picture to write (PNG, SVG or PDF).
    results
        Results folder in which studies are looked for.
    **at
        Point of a study's grid, such as `rank=3`; else factors are 1 and the others first, but
        errors are over all of them.  All methods are drawn where none is chosen.

    Raises
    ------
    VehiclemorError
        If there is no such result, kind or point, or the result holds no histories.
    """
    import xarray as xr

    from vehiclemor.report.figures.result_plot import plot_result
    from vehiclemor.report.results import dataset_of, select_point, stored_result
    from vehiclemor.simulation.trajectory import Trajectory

    if isinstance(result, str | Path):
        result = stored_result(str(result), file_path("results", results))
    elif isinstance(result, Trajectory):
        result = dataset_of(result, *(full for full in beside if not isinstance(full, str)))
    if not isinstance(result, xr.Dataset):
        raise InputError(f"result is {quoted(result)}; it must be a run, a dataset, file or study")
    kind = next((str(given) for given in beside if isinstance(given, str)), kind)
    dataset, _ = select_point(result, kind, at)
    return plot_result(dataset, None if out is None else file_path("out", out), kind)
