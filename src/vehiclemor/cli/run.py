"""`vehiclemor run`: a study, resumed where an earlier run stopped."""

import sys
import time
from collections import Counter
from pathlib import Path

from vehiclemor import api
from vehiclemor.cli.exit_status import FAILED
from vehiclemor.cli.progress import progress_of_cells


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
    from vehiclemor.study.run import run_studies

    began = time.perf_counter()
    cells: dict[str, int] = {}
    with progress_of_cells() as progress:

        def counted(name: str, done: int, total: int) -> None:
            cells[name] = total
            progress(name, done, total)

        results = run_studies(study, out, jobs, counted)
    errors = 0
    for name, dataset in results.items():
        count = Counter(str(status) for status in dataset["status"].values.ravel())
        shared = cells[name] != count.total()
        places = f"{cells[name]} cells" + (f" fill {count.total()} places" if shared else "")
        statuses = ", ".join(f"{n} {status}" for status, n in sorted(count.items()))
        print(f"{name}: {places}: {statuses}; {out / 'studies' / (name + '.nc')}")
        errors += count["error"]
    print(f"{time.perf_counter() - began:.1f} s")
    if errors:
        print("cells with the status error are tried again by the next run", file=sys.stderr)
    return FAILED if errors else 0
