"""`vehiclemor run`: a study, resumed where an earlier run stopped."""

import time
from collections import Counter
from pathlib import Path

from vehiclemor import api
from vehiclemor.cli.exit_status import FAILED
from vehiclemor.cli.progress import shown_progress
from vehiclemor.cli.status import print_reasons
from vehiclemor.report.printing import wrapped


def run(
    study: str,
    *,
    jobs: int = 1,
    scheduler: str = "",
    out: Path = api.RESULTS,
    seed: int | None = None,
) -> int:
    """Run a study; what an earlier run has finished is not computed again.

    A cell that stands at several points of the grid is computed once.

    Parameters
    ----------
    study
        Name of a study or collection, or a TOML file.
    jobs
        Number of processes.
    scheduler
        Address of a dask scheduler whose workers compute the cells.
    out
        Results folder.
    seed
        Draws fresh test runs of protocols, for an audit; their results stand apart.
    """
    from vehiclemor.progress import listening
    from vehiclemor.report.frames import counted_ends
    from vehiclemor.study.run import run_studies

    began = time.perf_counter()
    cells: dict[str, int] = {}
    with shown_progress() as shown:

        def counted(name: str, done: int, total: int) -> None:
            cells[name] = total
            shown(name, done, total)

        with listening(counted):
            results = run_studies(study, out, jobs, scheduler, seed)
    errors = 0
    for name, dataset in results.items():
        places = f"{dataset['status'].size} grid points, {cells[name]} cells"
        counts = counted_ends(dataset)
        print(wrapped(f"{name}: {places}: {counts}; {dataset.encoding['source']}", 0, 2))
        ends = zip(dataset["status"].values.flat, dataset["message"].values.flat, strict=True)
        print_reasons(Counter(end for end in ends if end[0] in ("rejected", "error")))
        errors += int((dataset["status"] == "error").sum())
    print(f"{time.perf_counter() - began:.1f} s")
    return FAILED if errors else 0
