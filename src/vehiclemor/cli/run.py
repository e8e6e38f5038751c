"""`vehiclemor run`: a study, resumed where an earlier run stopped."""

import time
from pathlib import Path

from vehiclemor import api
from vehiclemor.cli.progress import shown_progress
from vehiclemor.report.printing import wrapped


def run(study: str, *, jobs: int = 1, out: Path = api.RESULTS) -> int:
    """Run a study; what an earlier run has finished is not computed again.

    A cell that stands at several points of the grid is computed once.

    Parameters
    ----------
    study
        Name of a study or collection, or a TOML file.
    jobs
        Number of processes.
    out
        Results folder.
    """
    from vehiclemor.study.run import run_studies

    began = time.perf_counter()
    with shown_progress():
        results = run_studies(study, out, jobs)
    for name, dataset in results.items():
        statuses = [str(status) for status in dataset["status"].values.ravel()]
        counted = ", ".join(f"{statuses.count(s)} {s}" for s in sorted(set(statuses)))
        path = out / "studies" / f"{name}.nc"
        print(wrapped(f"{name}: {len(statuses)} grid points: {counted}; {path}", 0, 2))
    print(f"{time.perf_counter() - began:.1f} s")
    return 0
