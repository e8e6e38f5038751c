"""One run or one model: simulated, drawn, exported, given to other programs."""

import inspect
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

import vehiclemor as vm
from vehiclemor.api import RESULTS, SHIPPED
from vehiclemor.cli.options import (
    FAILED,
    Json,
    Parameters,
    Results,
    Settings,
    Several,
    check_names,
    key_values,
    picture_file,
    result_file,
)
from vehiclemor.exceptions import InputError
from vehiclemor.exporting.export import (
    STEP,
    FileTarget,
    Integrator,
    Precision,
    destination,
    name_of,
)
from vehiclemor.report.labels import Kind
from vehiclemor.report.printing import wrapped


def simulate(
    model: str,
    *,
    method: str = "full_order",
    settings: Settings = None,
    maneuver: str | None = None,
    csv: Annotated[list[str] | None, Several] = None,
    frequency: float = 1.0,
    amplitude: float = 1.0,
    start: str | None = None,
    preset: str = "recommended",
    training: Annotated[tuple[str, ...], Several, Parameter(show_default=False)] = (),
    parameter: Parameters = None,
    out: Path | None = None,
    plot: Annotated[list[Path] | None, Parameter(consume_multiple=True)] = None,
    all_outputs: bool = False,
) -> int:
    """Simulate a model with a method; errors are against the full-order solution.

    Parameters
    ----------
    model
        Registered name.
    method
        Registered name; shipped: the reduced model that ships with the package.
    maneuver
        Registered name, or a CSV file of a log; the model's default maneuver if left out.
    csv
        key=value, one or several: how to read a CSV file. INPUT=COLUMN says which column is an
        input; time=COLUMN, unit=deg (or mm), ratio=16 (steering wheel to wheels), hold=cubic,
        separator=; and decimal=, are the words of vm.Signal.from_csv.
    frequency
        Factor on the input's frequency.
    amplitude
        Factor on the input's amplitude.
    start
        Initial condition; the model's first by default.
    preset
        Preset of the method's settings.
    training
        matched (the very run that is simulated; the default), nominal (the model's maneuver),
        protocol (the training of the model's protocol), or names of maneuvers; one or several.
    out
        netCDF file for the result.
    plot
        Draw the result into this file, or into MODEL-METHOD.png here.
    all_outputs
        Print errors of every output, not only of those that tables show.
    """
    check_names("--training", training)
    chosen = key_values("--set", settings)
    for key in inspect.signature(vm.simulate).parameters.keys() & chosen.keys():
        raise InputError(f"--set {key}: not a setting of a method, but an argument of simulate")
    picture = None
    if plot is not None:
        if len(plot) > 1:
            raise InputError(f"--plot: one file, not {len(plot)}")
        # The option may stand without a file.
        picture = picture_file("--plot", plot[0] if plot else Path(f"{model}-{method}.png"))
    if out is not None:
        result_file("--out", out)
    ready = vm.model(model, key_values("--parameter", parameter))
    dataset = vm.simulate(
        ready if parameter else model,
        method,
        maneuver=_maneuver(maneuver, csv),
        start=start,
        frequency=frequency,
        amplitude=amplitude,
        preset=preset,
        training=training or "matched",
        **chosen,
    )
    from vehiclemor.report.labels import tabled_outputs
    from vehiclemor.report.printing import simulation_text

    outputs = ready.outputs if all_outputs else tabled_outputs(ready.definition)
    print(simulation_text(dataset, outputs, ready.counts))
    _write(dataset, out, picture)
    return FAILED if dataset["status"].item() in ("diverged", "error") else 0


def _write(dataset: Any, out: Path | None, picture: Path | None) -> None:
    """Write a run to those files that are asked for, and say so."""
    if out is not None:
        from vehiclemor.netcdf_file import write_dataset

        write_dataset(dataset, out)
        print(f"written: {out}")
    if picture is not None:
        vm.plot(dataset, out=picture)
        print(f"written: {picture}")
    if out is None and picture is None:
        print("nothing is saved: --out FILE.nc saves the result, --plot draws it")


def _maneuver(name: str | None, csv: list[str] | None) -> str | vm.Signal | None:
    """A registered name, or the signal of a CSV file."""
    options = key_values("--csv", csv)
    if name and Path(name).suffix.lower() == ".csv":
        words = inspect.signature(vm.Signal.from_csv).parameters.keys() - {"path"}
        columns = {key: str(options.pop(key)) for key in options.keys() - words}
        return vm.Signal.from_csv(name, inputs=columns, **options)
    if options:
        raise InputError("--csv is for a log: --maneuver FILE.csv")
    return name


def metrics(
    model: str,
    *,
    maneuver: Annotated[list[str] | None, Several] = None,
    method: str | None = None,
    speed: float | None = None,
    amplitude: float = 1.0,
    json_output: Json = False,
) -> int:
    """Print the numbers of the standards: how a vehicle handles, full and reduced side by side.

    The exit status is 1 where a run has not come to its end, or does not reach what a number needs.

    Parameters
    ----------
    model
        A vehicle.
    maneuver
        Registered names, one or several; all that have numbers for this vehicle by default.
    method
        Reduce the model by this method too; shipped: the reduced model that ships with the package.
    speed
        Initial speed in m/s; that of the model's parameters by default.
    amplitude
        Factor on the steering.
    """
    import pandas as pd

    from vehiclemor.handling.metrics import handling_rows
    from vehiclemor.report.labels import Column
    from vehiclemor.report.printing import Table, json_text

    check_names("--maneuver", maneuver or ())
    full = vm.model(model, {} if speed is None else {"initial_speed": speed})
    models = {"full": vm.reduce(full, "full_order")}
    if method == SHIPPED:
        models[SHIPPED] = vm.rom(model)
    elif method is not None:
        models[method] = vm.reduce(model, method)
    rows = pd.DataFrame(handling_rows(models, maneuver or (), amplitude))
    if json_output:
        print(json_text(rows))
    else:
        columns = {name: Column(name) for name in ("number", "unit")}
        columns |= {name: Column(name, ".4g") for name in models}
        print(Table(rows, columns, group="test"))
    return FAILED if bool(rows[[*models]].isna().to_numpy().any()) else 0


def plot(
    result: str,
    *,
    kind: Kind = "histories",
    select: Annotated[list[str] | None, Several] = None,
    out: Path | None = None,
    results: Results = RESULTS,
) -> None:
    """Draw a stored result: histories of the outputs, paths, or errors.

    Parameters
    ----------
    result
        A netCDF file that simulate has written, or a study that has been run.
    kind
        What is drawn.
    select
        dimension=value of the study's grid, one or several.  Without it factors are 1, other
        values are the first, errors are over all and methods all drawn.
    out
        Picture (PNG, SVG or PDF); RESULT-KIND.png here by default.
    """
    picture = picture_file("--out", out or Path(f"{Path(result).stem}-{kind}.png"))
    from vehiclemor.report.figures.result_plot import plot_result
    from vehiclemor.report.results import select_point, stored_result

    stored, chosen = stored_result(result, results), key_values("--select", select)
    dataset, point = select_point(stored, kind, chosen)
    plot_result(dataset, picture, kind)
    if point:
        print(wrapped(f"at {point}; --select dimension=value draws another point", 0, 2))
    print(f"written: {picture}")


@Parameter(name="*")
@dataclass(frozen=True)
class Exported:
    """Options of what an export holds: its integrator, numbers, inputs and outputs.

    Parameters
    ----------
    step
        Step size in s of the integrator in C and FMU.
    integrator
        In C and FMU: rk4, explicit; ros2, linearly implicit with one Jacobian, for longer steps.
    precision
        Of the numbers in C and FMU.
    inputs
        Optional inputs of the full model that the export has, such as brake_torque_FL.
    outputs
        Outputs that the export computes; all by default.
    """

    step: float = STEP
    integrator: Integrator = "rk4"
    precision: Precision = "double"
    inputs: Annotated[tuple[str, ...], Several, Parameter(name="--input", show_default=False)] = ()
    outputs: Annotated[list[str] | None, Several, Parameter(name="--output")] = None


def export(
    model: str,
    *,
    to: FileTarget,
    method: str | None = None,
    settings: Settings = None,
    parameter: Parameters = None,
    out: Path | None = None,
    overwrite: bool = False,
    exported: Exported = Exported(),
) -> None:
    """Export a model, or a reduced one, for another tool.

    Parameters
    ----------
    model
        Registered name, or file of a reduced model.
    to
        c: a folder with C99 sources; fmu: a functional mock-up unit by FMI 2.0; casadi: a function
        that CasADi loads.  For jax and rollouts see vm.export in Python.
    method
        Reduce the model by this method first, of which --set may give preset and training (nominal,
        protocol) too; shipped: the reduced model that ships with the package.  The full model by
        default.
    out
        Folder or file; under the model's name here by default.
    overwrite
        Replace an export that is there.
    """
    given, values = key_values("--set", settings), key_values("--parameter", parameter)
    file = Path(model).suffix == ".nc"
    saved = file or method == SHIPPED
    if (file and method) or (saved and (given or values)):
        raise InputError("a saved reduced model has its method, settings and parameters")
    if given and method is None:
        raise InputError("--set is for a method: --method NAME")
    if saved:
        chosen = vm.load(model) if file else vm.rom(model)
        out = destination(name_of(chosen.model.name, chosen.method), to, out, overwrite)
    else:
        chosen = vm.model(model, values)
        # Before anything is fitted.
        out = destination(name_of(model, method), to, out, overwrite)
        if method is not None:
            chosen = vm.reduce(chosen, method, **given)
    written = vm.export(chosen, to, out, overwrite=overwrite, **vars(exported))
    print(f"written: {written}")


def dataset(model: str, *, out: Path | None = None) -> None:
    """Write the training, validation and test runs of a protocol, for methods of other programs.

    Parameters
    ----------
    model
        A model, whose protocol is meant; or name or TOML file of a study with bounds.
    out
        New folder; MODEL-dataset here by default.
    """
    from vehiclemor.cli.studies import shown_progress

    with shown_progress():
        print(f"written: {vm.dataset(model, out)}")


def judge(
    file: Path, *, dataset: Path, json_output: Json = False, results: Results = RESULTS
) -> None:
    """Judge predictions of a method of another program on the test set.

    Parameters
    ----------
    file
        Predictions: a netCDF file.
    dataset
        Folder that the command dataset has written.
    """
    from vehiclemor.report.printing import Table, json_text

    rows = vm.judge(file, dataset, results)
    if json_output:
        print(json_text(rows))
        return
    errors = ["score", "median_score"]
    columns = ["label", "runs", "misses", "silent", "flagged", *errors, "output"]
    if bool(rows["seconds"].notna().any()):
        columns.append("seconds")
    methods, outputs = (rows.query(f"kind == {kind!r}") for kind in ("method", "output"))
    print(Table(methods, columns))
    each = ["output", "measure", "bound", "unit", "misses", "silent", *errors]
    print(f"\n{Table(outputs, each, explain=False)}")
