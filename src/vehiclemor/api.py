"""The Python interface: models, methods, simulations, studies, comparison, figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.errors import InputError, UnreachableError
from vehiclemor.registry import component, names

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from vehiclemor.maneuvers import Maneuver
    from vehiclemor.simulation.model import Model

RESULTS = Path("results")


def models() -> dict[str, str]:
    """Registered models: name -> one line."""
    return _summaries("model", "summary")


def methods() -> dict[str, str]:
    """Registered reduction methods: name -> one line."""
    return _summaries("method", "summary")


def maneuvers() -> dict[str, str]:
    """Registered maneuvers: name -> one line."""
    return _summaries("maneuver", "summary")


def _summaries(kind: str, attribute: str) -> dict[str, str]:
    """One line for each component; a broken plug-in is listed with what is wrong with it."""
    lines = {}
    for name in names(kind):
        try:
            lines[name] = str(getattr(component(kind, name), attribute))
        except InputError as error:
            lines[name] = f"broken: {error}"
    return lines


def studies() -> dict[str, str]:
    """Studies that come with the package: name -> one line."""
    from vehiclemor.resources import data_names
    from vehiclemor.study.plans.study_file import StudyFile, study_path
    from vehiclemor.toml_files import read_toml

    return {name: read_toml(study_path(name), StudyFile).title for name in data_names("studies")}


def describe(
    name: str,
    parameters: Mapping[str, object] | None = None,
    parameter_file: str | Path | None = None,
) -> dict[str, object]:
    """What a model, method, maneuver or study declares; lists of dictionaries are tables.

    Parameters
    ----------
    name
        Registered name, name or TOML file of a study, or `study-schema`, `protocol-schema`,
        `parameter-schema` for the keys of such a file.
    parameters, parameter_file
        As of `model()`.

    Raises
    ------
    VehiclemorError
        If nothing has that name, or a parameter is wrong.
    """
    from vehiclemor.report.description.describe import description

    return description(name, parameters, Path(parameter_file) if parameter_file else None)


def model(
    name: str,
    parameters: Mapping[str, object] | None = None,
    parameter_file: str | Path | None = None,
) -> Model:
    """A model ready to run: derived, compiled (or fetched from the kernel cache), parametrised.

    Parameters
    ----------
    name
        Registered name, see `models()`.
    parameters
        Parameter name -> value in SI units that replaces the file's.
    parameter_file
        Parameter file; the model's own public data by default.

    Raises
    ------
    VehiclemorError
        If a name or value is wrong, or the mechanism can't be assembled.
    """
    from vehiclemor.simulation.build import build

    component("model", name)
    return build(name, Path(parameter_file) if parameter_file else None, parameters)


_model = model


def simulate(
    model: str | Model,
    method: str = "full_order",
    *,
    maneuver: str | Maneuver | None = None,
    start: str | None = None,
    frequency: float = 1.0,
    amplitude: float = 1.0,
    preset: str = "recommended",
    training: str = "matched",
    training_set: Sequence[tuple[float, float]] = (),
    rtol: float | None = None,
    **settings: object,
) -> xr.Dataset:
    """Simulate a model with a method and measure its errors against the full-order solution.

    Parameters
    ----------
    model
        Registered name, or a model made by `model()`.
    method
        Registered name, see `methods()`.
    maneuver
        Registered name; the model's own by default.
    start
        Initial condition; the model's first by default.
    frequency, amplitude
        Factors on the maneuver.
    preset
        `recommended`, or another preset of the method, such as `literal` (the paper's words).
    training
        `matched` (the very run that is simulated), `nominal` (factors 1) or `set`.
    training_set
        (frequency, amplitude) factors of the policy `set`.
    rtol
        Tolerance of the solver; for a kinematic model the largest step of the last iteration.
    **settings
        Settings of the method, such as `rank=3`.

    Returns
    -------
    xarray.Dataset
        Histories, errors, floors, counts, seconds and status, with units.

    Raises
    ------
    VehiclemorError
        If the input is wrong or asks for a position that can't be reached.  A reduced model that
        diverges is a result: its status says so.
    """
    from vehiclemor.study.evaluate import evaluate
    from vehiclemor.study.experiment import make_experiment
    from vehiclemor.study.method_settings import complete_settings
    from vehiclemor.study.scenario import Scenario, check, training_scenarios

    ready = _model(model) if isinstance(model, str) else model
    if isinstance(maneuver, str) or maneuver is None:
        default = component("model", ready.name).maneuver
        base: Maneuver = component("maneuver", maneuver or default)
    else:
        base = maneuver
    if rtol is not None:
        settings["tolerance"] = rtol
    chosen = complete_settings(ready, method, settings, preset)
    test = Scenario(base.perturbed(frequency, amplitude), start or ready.starts[0])
    check(ready, test)
    factors = [(float(f), float(a)) for f, a in training_set]
    trained = training_scenarios(test, training, factors)
    dataset = evaluate(make_experiment(ready, method, chosen, trained, (test,)), ready)
    status = str(dataset["status"].item())
    if status in ("unreachable", "rejected"):
        error = UnreachableError if status == "unreachable" else InputError
        raise error(str(dataset["message"].item()))
    return dataset


def run_study(
    study: str,
    jobs: int = 1,
    out: str | Path = RESULTS,
    progress: Callable[[str, int, int], None] | None = None,
) -> xr.Dataset:
    """Run a study, resuming where an earlier run stopped.

    Parameters
    ----------
    study
        Name of a study or collection (see `studies()`), or path of a TOML file.
    jobs
        Number of processes.
    out
        Results folder.
    progress
        Called with (study, finished cells, all cells).

    Returns
    -------
    xarray.Dataset
        Combined dataset on the dimensions of the study's grid.  For a collection, one row for each
        cell of its studies on the dimension `cell`, without histories; the studies' own datasets
        are in the folder `studies`.
    """
    from vehiclemor.study.plans.grid_results import flattened
    from vehiclemor.study.run import run_studies

    results = run_studies(study, Path(out), jobs, progress)
    return next(iter(results.values())) if len(results) == 1 else flattened(results)


def compare(what: str = "paper", out: str | Path = RESULTS, jobs: int = 1) -> pd.DataFrame:
    """A comparison as a table; studies and timings that are missing are run first.

    Parameters
    ----------
    what
        `paper`: published beside reproduced.  `predictive`: reduced models on inputs that they have
        not seen, beside full-order integrators.  The name of a model: every method that fits it,
        nominal, perturbed and on unseen inputs, with costs.
    out
        Results folder.
    jobs
        Number of processes.

    Returns
    -------
    pandas.DataFrame
        Of `paper` the columns id, model, item, variant, start, published, bound, reproduced, unit,
        floor, replay, within, verdict (`met`, `missed`, `not_comparable`, or `ours`: from a start
        that the paper doesn't have), measure, reason, threshold_source; described at
        `comparison.rows.Row`, those of the others at `predictive_comparison` and
        `model_comparison` in `vehiclemor.report`.
    """
    from vehiclemor.report.comparison.kinds import comparison

    return comparison(what, Path(out), jobs)


def figures(
    only: Sequence[str] = (),
    out: str | Path = RESULTS,
    results: str | Path = RESULTS,
    jobs: int = 1,
) -> list[Path]:
    """Regenerate figures of the paper from stored results; studies that are missing are run first.

    Parameters
    ----------
    only
        Figure names such as `6`, or `histories-`, `errors-`, `map-` or `pareto-` and the name of a
        model; the paper's by default.
    out
        Folder of the figures.
    results
        Results folder.
    jobs
        Number of processes for missing studies.

    Returns
    -------
    list of Path
        Files written.
    """
    from vehiclemor.report.regenerate import regenerate_figures

    return regenerate_figures(Path(results), Path(out), only, jobs)
