"""Progress of cells, with a terminal and without."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import TaskID


@contextmanager
def progress_of_cells() -> Iterator[Callable[[str, int, int], None]]:
    """Progress bar on a terminal, a line for each study elsewhere."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    tasks: dict[str, TaskID] = {}
    totals: dict[str, int] = {}
    with Progress(console=console, disable=not console.is_terminal) as bar:

        def update(study: str, done: int, total: int) -> None:
            if totals.get(study) != total:
                # The test of a protocol adds cells to those of its validation.
                totals[study] = total
                if done < total and not console.is_terminal:
                    print(f"{study}: {total - done} of {total} cells to compute", file=sys.stderr)
            if study not in tasks:
                tasks[study] = bar.add_task(study)
            bar.update(tasks[study], completed=done, total=total)

        yield update
