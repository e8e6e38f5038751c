"""Studies: run, followed, compared, drawn, reported, converted."""

import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import vehiclemor as vm
from vehiclemor.api import RESULTS
from vehiclemor.cli.options import (
    FAILED,
    MISSED,
    All,
    Jobs,
    Json,
    Results,
    Seed,
    Several,
    check_names,
    new_file,
)
from vehiclemor.report.labels import Format
from vehiclemor.report.printing import Table, ends_text, wrapped

Study = Annotated[str, Parameter(help="Name of a study or collection, or a TOML file.")]
# Reasons that are printed of each study.
REASONS = 10


def run(
    study: Study,
    *,
    jobs: Jobs = 1,
    scheduler: str = "",
    results: Results = RESULTS,
    seed: Seed = None,
) -> int:
    """Run a study; what an earlier run has finished is not computed again.

    Parameters
    ----------
    scheduler
        Address of a dask scheduler whose workers compute.
    """
    from vehiclemor.report.results import counted_ends
    from vehiclemor.report.unseen import count_rows
    from vehiclemor.study.run import run_studies

    began, errors = time.perf_counter(), 0
    with shown_progress() as runs:
        datasets = run_studies(study, results, jobs, scheduler, seed)
    for name, dataset in datasets.items():
        sizes = f"{dataset['status'].size} grid points, {runs[name]} runs"
        counts = counted_ends(dataset)
        print(wrapped(f"{name}: {sizes}: {counts}; {dataset.encoding['source']}", 0, 2))
        ends = zip(dataset["status"].values.flat, dataset["message"].values.flat, strict=True)
        _print_reasons(Counter(end for end in ends if end[0] in ("rejected", "error")))
        errors += int((dataset["status"] == "error").sum())
        if "scenario_set" in dataset:
            counts = ("item", "runs", "right", "flagged", "misses", "silent", "apart")
            print(Table([*count_rows(dataset)], counts, group="label"))
    print(f"{time.perf_counter() - began:.1f} s")
    return FAILED if errors else 0


def status(study: Study, *, results: Results = RESULTS, seed: Seed = None) -> None:
    """Show how far a study is, without computing anything."""
    for name, progress in vm.status(study, results, seed).items():
        parts = [f"{name}: {progress.done} of {progress.runs} runs done"]
        parts += [f"{progress.to_do} to do"] if progress.to_do else []
        parts += [progress.later] if progress.later and not progress.result else []
        text = ", ".join(parts)
        if progress.ends:
            ends = (kind for kind, _ in progress.ends.elements())
            text += f"; {ends_text(ends, progress.warned)}"
        older = " is older" if progress.result and progress.to_do else ""
        print(wrapped(f"{text}; {progress.result or 'not combined yet'}{older}", 0, 2))
        _print_reasons(progress.failed)


def _print_reasons(failed: Counter[tuple[str, str]]) -> None:
    """Print why runs have failed, the most frequent reasons first."""
    reasons = failed.most_common()
    for (kind, message), runs in reasons[:REASONS]:
        again = ", tried again by the next run" if kind == "error" else ""
        print(wrapped(f"{runs} {kind}{again}: {message}", 2, 4))
    if len(reasons) > REASONS:
        rest = sum(runs for _, runs in reasons[REASONS:])
        print(f"  {rest} for {len(reasons) - REASONS} other reasons")


def compare(
    what: str = "paper",
    *,
    every: All = False,
    json_output: Json = False,
    check: bool = False,
    results: Results = RESULTS,
    jobs: Jobs = 1,
    seed: Seed = None,
) -> int:
    """Set published numbers beside reproduced ones, or the methods of a study side by side.

    Studies and timings that are missing are run first.

    Parameters
    ----------
    what
        The comparison: paper (published beside reproduced), predictive (reduced models on inputs
        that they have not seen), the name of a model (every method that fits it), or a study,
        collection or protocol by its name or TOML file.
    every
        Of the comparison with the paper: print the costs too.
    check
        Exit with status 1 if a bound of the paper or a target of a protocol is missed.
    """
    from vehiclemor.report.printing import json_text
    from vehiclemor.report.screens import comparison_text

    with shown_progress():
        rows = vm.compare(what, results, jobs, seed)
    print(json_text(rows) if json_output else comparison_text(what, rows, results, every))
    return MISSED if check and "verdict" in rows and "missed" in set(rows["verdict"]) else 0


def figures(
    *,
    only: Annotated[list[str] | None, Several] = None,
    out: Path | None = None,
    results: Results = RESULTS,
    jobs: Jobs = 1,
) -> int:
    """Draw the figures of any study; studies that are missing are run first.

    Parameters
    ----------
    only
        One or several: a study, collection or protocol by name or TOML file, of which is drawn
        what its dimensions ask for.  The studies of the paper by default.
    out
        Folder of the figures; by default `figures` in the results folder.
    """
    check_names("--only", only or ())
    failed: dict[str, str] = {}
    with shown_progress():
        written = vm.figures(only or (), out, results, jobs, failed=failed)
    for path in written:
        print(path)
    for name, why in failed.items():
        print(f"figure {name} can't be drawn: {why}", file=sys.stderr)
    return FAILED if failed else 0


def report(
    *studies: str, out: Path = Path("report.html"), results: Results = RESULTS, jobs: Jobs = 1
) -> None:
    """Write results as one HTML file: verdicts, tables, figures, settings and provenance.

    It needs no network and loads no other file.

    Parameters
    ----------
    studies
        Studies, collections, TOML files, or models, which stand for their default studies; what is
        missing is run first. Without any: everything that the results folder holds.
    out
        The file, which ends with .html.
    """
    check_names("report", studies)
    new_file("--out", out, (".html", ".htm"))
    with shown_progress():
        print(f"written: {vm.write_report(studies, out, results, jobs)}")


def convert(study: str, *, to: Format, out: Path | None = None, results: Results = RESULTS) -> None:
    """Write the stored result of a study in another format.

    Parameters
    ----------
    study
        Name or file of a study that has been run, or a netCDF file of its result.
    to
        zarr: the dataset; parquet, csv: a table with a row for each point of the grid.
    out
        New file or folder; under the study's name here by default.
    """
    print(f"written: {vm.convert(study, to, out, results)}")


# Without a terminal there is a line every so many seconds.
INTERVAL = 5.0


@contextmanager
def shown_progress() -> Iterator[dict[str, int]]:
    """Show how far all that is run inside is, on standard error; gives work -> all its parts."""
    from rich.console import Console
    from rich.progress import Progress, TaskID

    from vehiclemor.progress import listening

    console = Console(stderr=True)
    bar = Progress(console=console)
    tasks: dict[str, TaskID] = {}
    totals: dict[str, int] = {}
    began = printed = time.monotonic()

    def update(work: str, done: int, total: int) -> None:
        nonlocal printed
        now = time.monotonic()
        # The test of a protocol adds to what its validation was.
        grown = totals.get(work) != total
        totals[work] = total
        if console.is_terminal:
            if work not in tasks:
                tasks[work] = bar.add_task(work)
            bar.update(tasks[work], completed=done, total=total)
        elif grown and done < total:
            print(f"{work}: {total - done} of {total} to compute", file=sys.stderr)
        elif done < total and now - printed >= INTERVAL:
            print(f"{work}: {done} of {total}, {now - began:.0f} s", file=sys.stderr)
            printed = now

    # Where there is no terminal, older versions of rich would print an empty line.
    with bar if console.is_terminal else nullcontext(), listening(update):
        yield totals
