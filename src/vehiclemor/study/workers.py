"""Evaluating what is missing of some experiments, in one process or several, and storing it."""

from __future__ import annotations

import logging
import os
import signal
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from vehiclemor.codegen.cache import cache_folder
from vehiclemor.errors import MachineError, machine_reason
from vehiclemor.progress import tell
from vehiclemor.study.evaluate import evaluate
from vehiclemor.study.experiment import Experiment
from vehiclemor.study.store import (
    finished_cells,
    is_stored,
    prepare_folder,
    read_cell,
    write_cell,
    write_encoded,
)

if TYPE_CHECKING:
    from concurrent.futures import Executor, Future

    import xarray as xr

Groups = Sequence[Sequence[Experiment]]
# How often what the machine has spoiled is tried; and seconds between two looks at the driver.
TRIES, LOOK = 3, 0.5
# Batches sent for each worker, so that none is idle; more would not fit into its queue.
WAITING = 2
# Seconds that a batch should take, beside which it is nothing to send it; and its most experiments.
BATCH, LARGEST = 0.5, 100
KILLED = "a worker process was killed, perhaps for lack of memory"
_LOG = logging.getLogger("vehiclemor")


class Done(NamedTuple):
    """What has become of some experiments.

    Attributes
    ----------
    finished
        Keys.
    fault
        How the machine has failed in the others, if there are any.
    seconds
        That all have taken.
    sent
        Key -> content of a cell's file that the driver is to write.
    """

    finished: list[str]
    fault: str = ""
    seconds: float = 0.0
    sent: Mapping[str, bytes] = MappingProxyType({})


# What evaluates groups elsewhere, if so each by itself.
Engine = Callable[[Groups, Path, bool], Generator[Done, None, None]]


@dataclass
class Workers:
    """Evaluates what is missing of experiments, in so many jobs or elsewhere, and stores it."""

    name: str
    folder: Path
    jobs: int = 1
    elsewhere: Engine | None = None
    asked: set[str] = field(default_factory=set)
    finished: set[str] = field(default_factory=set)

    def __call__(self, groups: Groups) -> None:
        """Evaluate what is missing; a group stays in one process, where its fit is made once.

        Raises
        ------
        MachineError
            If the machine has failed again and again; what was finished is stored.
        """
        wanted = {e.key: e for group in groups for e in group}
        self.asked |= wanted.keys()
        self.finished |= finished_cells(self.folder, wanted.keys() - self.finished)
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
        return read_cell(self.folder, experiment.key).dataset()

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
        # One group of each method first, so that workers compile different loops at a time.
        first = {id(group) for group in {g[0].method: g for g in reversed(work)}.values()}
        work.sort(key=lambda group: id(group) not in first)
        # Starting processes costs seconds: a handful of groups is quicker without.  But what has
        # killed a worker would kill this process too.
        few = len(work) < 2 * self.jobs and not again
        if self.elsewhere:
            engine = self.elsewhere(work, self.folder, again)
        elif self.jobs == 1 or few:
            engine = (evaluate_and_store(group, self.folder) for group in work)
        else:
            engine = evaluated_by_workers(work, self.folder, self.jobs)
        with closing(engine):
            for done in engine:
                for key, content in done.sent.items():
                    write_encoded(content, self.folder, key)
                self.finished.update(done.finished)
                self._report()
                yield done.fault


def evaluate_and_store(experiments: Sequence[Experiment], folder: Path) -> Done:
    """Evaluate some experiments, and move each complete file into place.

    Raises
    ------
    MachineError
        If a result can't be stored: no other could.
    """
    finished, fault, first = [], "", time.perf_counter()
    for experiment in experiments:
        # Another driver may have stored it, or a worker that was killed before it could say so.
        if not is_stored(folder, experiment.key):
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
    return Done(finished, fault, time.perf_counter() - first)


def in_batches(
    pool: Executor,
    work: Callable[[list[Experiment]], Done],
    groups: Groups,
    places: Callable[[], int],
    most: int = LARGEST,
    killed: type[Exception] | tuple[()] = (),
) -> Generator[Done, None, None]:
    """What some work gives for each batch of groups; where they are quick, a batch has several.

    Parameters
    ----------
    places
        Tells how many batches can be worked at a time.
    most
        Experiments of a batch, unless one group has more.
    killed
        Raised of a batch whose worker was killed, while the pool lives on.
    """
    from concurrent.futures import FIRST_COMPLETED, wait

    waiting: dict[Future[Done], int] = {}
    left, size = deque(groups), 1
    while left or waiting:
        at_once = WAITING * max(places(), 1)
        while left and len(waiting) < at_once:
            batch = list(left.popleft())
            # The last batches are small, so that workers end together.
            while left and len(batch) + len(left[0]) <= min(size, len(left) // at_once):
                batch += left.popleft()
            waiting[pool.submit(work, batch)] = len(batch)
        for future in wait(waiting, return_when=FIRST_COMPLETED).done:
            number = waiting.pop(future)
            try:
                done = future.result()
            except killed:
                done = Done([], KILLED)
            if done.seconds > 0.0:
                size = int(min(max(BATCH * number / done.seconds, 1), most))
            yield done


def evaluated_by_workers(groups: Groups, folder: Path, jobs: int) -> Generator[Done, None, None]:
    """What `evaluate_and_store` gives for each batch, in processes that end with this one."""
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
    try:
        work = partial(evaluate_and_store, folder=folder)
        yield from in_batches(pool, work, groups, lambda: jobs)
    except BrokenProcessPool:
        yield Done([], KILLED)
    except BaseException:
        pool.shutdown(kill_workers=True)
        raise


def begin(driver: int, cache: str) -> None:
    """Begin a worker: it shares the driver's cache, leaves interrupts to it, and ends with it."""
    os.environ["VEHICLEMOR_CACHE"] = cache
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == driver:
            time.sleep(LOOK)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
