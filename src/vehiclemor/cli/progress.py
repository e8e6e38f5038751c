"""Progress of the cells of studies: a bar on a terminal, lines elsewhere."""

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

    from vehiclemor.study.workers import Progress

# Without a terminal there is a line every so many seconds.
INTERVAL = 5.0


@contextmanager
def progress_of_cells() -> Iterator[None]:
    """Show the progress of all studies that are run inside, on standard error."""
    from rich.console import Console

    from vehiclemor.study.workers import listening

    console = Console(stderr=True)
    with _bar(console) if console.is_terminal else _lines() as update, listening(update):
        yield


@contextmanager
def _bar(console: Console) -> Iterator[Progress]:
    from rich.progress import Progress

    tasks: dict[str, TaskID] = {}
    with Progress(console=console) as bar:

        def update(study: str, done: int, total: int) -> None:
            if study not in tasks:
                tasks[study] = bar.add_task(study)
            bar.update(tasks[study], completed=done, total=total)

        yield update


@contextmanager
def _lines() -> Iterator[Progress]:
    """A line when a study begins, and one every few seconds while something is missing."""
    began = time.monotonic()
    found: dict[str, tuple[int, int]] = {}
    ended = threading.Event()

    def update(study: str, done: int, total: int) -> None:
        if study not in found and done < total:
            print(f"{study}: {total - done} of {total} cells to compute", file=sys.stderr)
        found[study] = done, total

    def tell() -> None:
        while not ended.wait(INTERVAL):
            study, (done, total) = list(found.items())[-1] if found else ("", (0, 0))
            if done < total:
                elapsed = time.monotonic() - began
                print(f"{study}: {done} of {total} cells, {elapsed:.0f} s", file=sys.stderr)

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield update
    finally:
        ended.set()
        teller.join()
