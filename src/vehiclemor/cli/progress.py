"""How far a study is, while it runs: a bar on a terminal, lines elsewhere."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

# Without a terminal there is a line every so many seconds.
INTERVAL = 5.0


@contextmanager
def shown_progress() -> Iterator[dict[str, int]]:
    """Show how far all that is run inside is, on standard error; gives work -> all its parts."""
    from rich.console import Console
    from rich.progress import Progress, TaskID

    from vehiclemor.progress import listening

    console = Console(stderr=True)
    bar = Progress(console=console, disable=not console.is_terminal)
    tasks: dict[str, TaskID] = {}
    totals: dict[str, int] = {}
    began = told = time.monotonic()

    def update(work: str, done: int, total: int) -> None:
        nonlocal told
        now = time.monotonic()
        # The test of a protocol adds to what its validation was.
        grown, totals[work] = totals.get(work) != total, total
        if console.is_terminal:
            if work not in tasks:
                tasks[work] = bar.add_task(work)
            bar.update(tasks[work], completed=done, total=total)
        elif grown and done < total:
            print(f"{work}: {total - done} of {total} to compute", file=sys.stderr)
        elif done < total and now - told >= INTERVAL:
            print(f"{work}: {done} of {total}, {now - began:.0f} s", file=sys.stderr)
            told = now

    with bar, listening(update):
        yield totals
