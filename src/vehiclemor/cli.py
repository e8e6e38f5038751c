"""Command line: the same functions as the Python interface, one clear line for what is wrong."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, CycloptsError, Parameter

from vehiclemor import __version__, api
from vehiclemor.errors import InputError, VehiclemorError

if TYPE_CHECKING:
    from rich.progress import TaskID

# Exit statuses: 0 done, 1 a published bound is missed or a simulation failed, 2 wrong input,
# 130 interrupted.
MISSED, FAILED, WRONG_INPUT, INTERRUPTED = 1, 1, 2, 130

app = App(
    name="vehiclemor",
    version=__version__,
    help="Benchmark suite for model order reduction of multibody vehicle models.",
)


@app.command(name="list")
def list_components(
    what: Literal["models", "methods", "maneuvers", "studies"] | None = None,
    *,
    json_output: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> int:
    """List what is registered.

    Parameters
    ----------
    what
        One kind; all by default.
    json_output
        Print JSON.
    """
    kinds = ("models", "methods", "maneuvers", "studies") if what is None else (what,)
    found = {kind: getattr(api, kind)() for kind in kinds}
    if json_output:
        print(json.dumps(found if what is None else found[what], indent=2))
        return 0
    for kind, entries in found.items():
        print(f"{kind}:")
        width = max(len(name) for name in entries)
        for name, summary in entries.items():
            print(f"  {name:<{width}}  {summary}")
    return 0


@app.command
def simulate(
    model: str,
    *,
    method: str = "full_order",
    settings: Annotated[tuple[str, ...], Parameter(name="--set", negative="")] = (),
    maneuver: str | None = None,
    frequency: float = 1.0,
    amplitude: float = 1.0,
    start: str | None = None,
    preset: str = "recommended",
    training: str = "matched",
    parameters: Path | None = None,
    out: Path | None = None,
) -> int:
    """Simulate a model with a method; errors are against the full-order solution.

    Parameters
    ----------
    model
        Registered name.
    method
        Registered name.
    settings
        key=value: a setting of the method; may be given several times.
    maneuver
        Registered name; the model's own by default.
    frequency
        Factor on the input's frequency.
    amplitude
        Factor on the input's amplitude.
    start
        Initial condition; the model's first by default.
    preset
        Preset of the method's settings.
    training
        matched, or nominal (trained on the unperturbed input).
    parameters
        Parameter file; the model's own public data by default.
    out
        netCDF file for the result.
    """
    from vehiclemor.reduction.validation import parsed

    chosen: dict[str, Any] = {}
    for setting in settings:
        key, separator, value = setting.partition("=")
        if not separator or not key:
            raise InputError(f"--set {setting!r} is not key=value")
        if key in chosen:
            raise InputError(f"--set {key} is given twice")
        chosen[key] = parsed(value)
    if out is not None:
        _check_writable(out)
    ready = api.model(model, parameter_file=parameters)
    reserved = {"frequency", "amplitude", "maneuver", "start", "preset", "training", "training_set"}
    for key in reserved & set(chosen):
        raise InputError(f"--set {key}: not a setting of a method; use --{key}")
    dataset = api.simulate(
        ready,
        method,
        maneuver=maneuver,
        start=start,
        frequency=frequency,
        amplitude=amplitude,
        preset=preset,
        training=training,
        **chosen,
    )
    if out is not None:
        from vehiclemor.study.store import write_dataset

        write_dataset(dataset, out)
    from vehiclemor.report.simulation import simulation_text

    print(simulation_text(dataset, ready.counts))
    if out is not None:
        print(f"written: {out}")
    return FAILED if dataset["status"].item() in ("diverged", "error") else 0


def _check_writable(out: Path) -> None:
    from vehiclemor.study.store import read_dataset

    if out.is_dir():
        raise InputError(f"--out {out}: is a folder, not a file")
    if not out.parent.is_dir():
        raise InputError(f"--out {out}: the folder {out.parent} does not exist")
    if out.exists():
        read_dataset(out, "source", "vehiclemor")


@app.command
def run(study: str, *, jobs: int = 1, out: Path = api.RESULTS) -> int:
    """Run a study; what an earlier run has finished is not computed again.

    Parameters
    ----------
    study
        Name of a study or collection, or a TOML file.
    jobs
        Number of processes.
    out
        Results folder.
    """
    import time

    from vehiclemor.study.run import run_studies

    began = time.perf_counter()
    with _progress() as progress:
        results = run_studies(study, out, jobs, progress)
    for name, dataset in results.items():
        statuses = [str(status) for status in dataset["status"].values.ravel()]
        counted = ", ".join(f"{statuses.count(s)} {s}" for s in sorted(set(statuses)))
        print(f"{name}: {counted}; {out / 'studies' / (name + '.nc')}")
    print(f"{time.perf_counter() - began:.1f} s")
    return 0


@contextmanager
def _progress() -> Iterator[Callable[[str, int, int], None]]:
    """Progress bar on a terminal, a line for each study elsewhere."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    tasks: dict[str, TaskID] = {}
    with Progress(console=console, disable=not console.is_terminal) as bar:

        def update(study: str, done: int, total: int) -> None:
            if study not in tasks:
                if done < total and not console.is_terminal:
                    print(f"{study}: {total - done} of {total} cells to compute", file=sys.stderr)
                tasks[study] = bar.add_task(study, total=total)
            bar.update(tasks[study], completed=done)

        yield update


@app.command
def compare(
    what: str = "paper",
    *,
    json_output: Annotated[bool, Parameter(name="--json", negative="")] = False,
    out: Path = api.RESULTS,
    jobs: int = 1,
) -> int:
    """Set published numbers beside reproduced ones, or reduced models beside full order.

    Exit status 1 if a bound is missed.

    Parameters
    ----------
    what
        The comparison: paper (published beside reproduced), predictive (reduced models on inputs
        that they have not seen), or the name of a model (every method that fits it).
    json_output
        Print JSON.
    out
        Results folder; studies and timings that are missing are run first.
    jobs
        Number of processes for missing studies.
    """
    rows = api.compare(what, out, jobs)
    if json_output:
        print(rows.to_json(orient="records", indent=2))
    else:
        from vehiclemor.report.comparison.kinds import comparison_text

        print(comparison_text(what, rows, out))
    # The comparison of a model judges nothing that was published.
    judged = what in ("paper", "predictive")
    return MISSED if judged and "missed" in set(rows["verdict"]) else 0


@app.command
def figures(
    *,
    only: str = "",
    out: Path = api.RESULTS / "figures",
    results: Path = api.RESULTS,
    jobs: int = 1,
) -> int:
    """Regenerate the paper's figures from stored results.

    Parameters
    ----------
    only
        Names of figures, separated by commas: those of the paper, such as 6, or histories-,
        errors-, map- or pareto- and the name of a model.  The paper's by default.
    out
        Folder of the figures.
    results
        Results folder; studies that are missing are run first.
    jobs
        Number of processes for missing studies.
    """
    chosen = [name.strip() for name in only.split(",") if name.strip()]
    if only and not chosen:
        raise InputError(f"--only {only!r} names no figure")
    for path in api.figures(chosen, out, results, jobs):
        print(path)
    return 0


@app.command
def cite() -> int:
    """Print how to cite this suite, the paper, and the methods with a reference of their own."""
    from vehiclemor.report.citation import citations

    print(citations())
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; wrong input is one line on standard error and exit status 2."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        status = app(given, exit_on_error=False, print_error=False, result_action="return_value")
    except (CycloptsError, VehiclemorError) as error:
        print("vehiclemor: " + " ".join(str(error).split()), file=sys.stderr)
        return WRONG_INPUT
    except KeyboardInterrupt:
        text = "vehiclemor: interrupted; finished cells are stored, run again to resume"
        print(text, file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    return int(status or 0)


if __name__ == "__main__":
    sys.exit(main())
