"""Progress of studies and of rounds of times: a bar on a terminal, lines elsewhere."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import TaskID

    from vehiclemor.progress import Progress

# Without a terminal there is a line every so many seconds.
INTERVAL = 5.0


@contextmanager
def shown_progress() -> Iterator[Progress]:
    """Show how far all that is run inside is, on standard error; gives what shows it."""
    from rich.console import Console

    from vehiclemor.progress import listening

    console = Console(stderr=True)
    with _bar(console) if console.is_terminal else _lines() as update, listening(update):
        yield update


@contextmanager
def _bar(console: Console) -> Iterator[Progress]:
    from rich.progress import Progress

    tasks: dict[str, TaskID] = {}
    with Progress(console=console) as bar:

        def update(work: str, done: int, total: int) -> None:
            if work not in tasks:
                tasks[work] = bar.add_task(work)
            bar.update(tasks[work], completed=done, total=total)

        yield update


@contextmanager
def _lines() -> Iterator[Progress]:
    """A line when some work begins, and one every few seconds while something is missing."""
    began = time.monotonic()
    found: dict[str, tuple[int, int]] = {}
    ended = threading.Event()

    def update(work: str, done: int, total: int) -> None:
        # The test of a protocol adds to what its validation was.
        if found.get(work, (0, 0))[1] != total and done < total:
            print(f"{work}: {total - done} of {total} to compute", file=sys.stderr)
        # The latest is the last.
        found.pop(work, None)
        found[work] = done, total

    def tell() -> None:
        while not ended.wait(INTERVAL):
            work, (done, total) = list(found.items())[-1] if found else ("", (0, 0))
            if done < total:
                elapsed = time.monotonic() - began
                print(f"{work}: {done} of {total}, {elapsed:.0f} s", file=sys.stderr)

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield update
    finally:
        ended.set()
        teller.join()
