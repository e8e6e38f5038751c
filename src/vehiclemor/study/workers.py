"""Evaluating what is missing of some experiments, in one process or several, and storing it."""

from __future__ import annotations

import logging
import os
import signal
import threading
import time
import warnings
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.codegen.object_cache import cache_folder
from vehiclemor.errors import MachineError, machine_reason
from vehiclemor.study.evaluate import evaluate
from vehiclemor.study.experiment import Experiment
from vehiclemor.study.progress import tell
from vehiclemor.study.store import (
    finished_cells,
    prepare_folder,
    read_cell,
    remove_partial,
    write_cell,
)

if TYPE_CHECKING:
    import xarray as xr

Groups = Sequence[Sequence[Experiment]]
# How often what the machine has spoiled is tried; and seconds between two looks at the driver.
TRIES, LOOK = 3, 0.5
# Groups sent for each worker, so that none is idle; more would not fit into its queue.
WAITING = 2
KILLED = "a worker process was killed, perhaps for lack of memory"
_LOG = logging.getLogger("vehiclemor")


@dataclass
class Workers:
    """Evaluates what is missing of some experiments, in so many jobs, and stores it."""

    name: str
    folder: Path
    jobs: int = 1
    asked: set[str] = field(default_factory=set)
    finished: set[str] = field(default_factory=set)

    def __call__(self, groups: Groups) -> None:
        """Evaluate what is missing; a group stays in one process, where its fit is made once.

        Raises
        ------
        MachineError
            If the machine has failed again and again; what was finished is stored.
        """
        remove_partial(self.folder)
        keys = {e.key for group in groups for e in group}
        self.asked |= keys
        self.finished |= finished_cells(self.folder, keys - self.finished)
        if self._missing(groups):
            # A folder that can't be is told before anything is announced.
            prepare_folder(self.folder)
        self._report()
        faults: list[str] = []
        for left in reversed(range(TRIES)):
            work = self._missing(groups)
            if not work:
                return
            again = left < TRIES - 1
            faults = [fault for fault in self._evaluated(work, again) if fault]
            if faults and left:
                _LOG.warning("%s: %s; what it has spoiled is tried again", self.name, faults[0])
        spoiled = sum(len(group) for group in self._missing(groups))
        if spoiled:
            raise MachineError(
                f"{self.name}: {spoiled} of {len(self.asked)} cells can't be computed "
                f"({faults[0]}); what is finished is stored: run again to resume"
            )

    def result(self, experiment: Experiment) -> xr.Dataset:
        """Stored result of an experiment."""
        return read_cell(self.folder, experiment.key)

    def _missing(self, groups: Groups) -> list[list[Experiment]]:
        """What is not finished, each once."""
        missing = {e.key: e for group in groups for e in group if e.key not in self.finished}
        # Two candidates may be the same experiment: `pop` leaves it to the first.
        parts = [[f for e in group if (f := missing.pop(e.key, None))] for group in groups]
        return [part for part in parts if part]

    def _report(self) -> None:
        tell(self.name, len(self.finished), len(self.asked))

    def _evaluated(self, work: list[list[Experiment]], again: bool) -> Iterator[str]:
        """Evaluate groups; gives how the machine has failed in each, if it has."""
        # Starting processes costs seconds: a handful of groups is quicker without.  But what has
        # killed a worker would kill this process too.
        if self.jobs == 1 or (len(work) < 2 * self.jobs and not again):
            for group in work:
                yield self._taken(*evaluate_and_store(group, self.folder))
            return
        # One group of each method first, so that workers compile different loops at a time.
        first = {id(group) for group in {g[0].method: g for g in reversed(work)}.values()}
        work.sort(key=lambda group: id(group) not in first)
        with closing(evaluated_by_workers(work, self.folder, self.jobs)) as pool:
            for done in pool:
                yield self._taken(*done)

    def _taken(self, finished: list[str], fault: str) -> str:
        self.finished.update(finished)
        self._report()
        return fault


def evaluate_and_store(experiments: Sequence[Experiment], folder: Path) -> tuple[list[str], str]:
    """Evaluate some experiments, and move each complete file into place.

    Returns
    -------
    tuple
        Keys of those that are stored, and how the machine has failed in others; empty if it has
        not.

    Raises
    ------
    MachineError
        If a result can't be stored: no other could.
    """
    finished, fault = [], ""
    for experiment in experiments:
        began = time.perf_counter()
        try:
            dataset = evaluate(experiment)
        except Exception as error:
            fault = str(error) if isinstance(error, MachineError) else machine_reason(error)
            if not fault:
                raise
            continue
        write_cell(dataset, folder, experiment.key, time.perf_counter() - began)
        finished.append(experiment.key)
    return finished, fault


def evaluated_by_workers(
    groups: Groups, folder: Path, jobs: int
) -> Generator[tuple[list[str], str], None, None]:
    """What `evaluate_and_store` gives for each group, in processes that end with this one."""
    from concurrent.futures import FIRST_COMPLETED, Future, wait
    from concurrent.futures.process import BrokenProcessPool

    from joblib.externals.loky import get_reusable_executor

    # A system without `pgrep` makes the pool say so, at length, when it ends workers.
    warnings.filterwarnings("ignore", "Failed to kill subprocesses")
    # Without the empty value a worker that crashes would print where each of its threads was.
    pool = get_reusable_executor(
        jobs,
        initializer=begin,
        initargs=(os.getpid(), str(cache_folder())),
        env={"PYTHONFAULTHANDLER": ""},
    )
    waiting: set[Future] = set()
    left = iter(groups)
    try:
        while True:
            while len(waiting) < WAITING * jobs and (group := next(left, None)):
                waiting.add(pool.submit(evaluate_and_store, group, folder))
            if not waiting:
                return
            done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for future in done:
                yield future.result()
    except BrokenProcessPool:
        yield [], KILLED
    except BaseException:
        pool.shutdown(kill_workers=True)
        raise
    finally:
        remove_partial(folder)


def begin(driver: int, cache: str) -> None:
    """Begin a worker: it shares the driver's cache, leaves interrupts to it, and ends with it."""
    os.environ["VEHICLEMOR_CACHE"] = cache
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == driver:
            time.sleep(LOOK)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
