"""Evaluating what is missing of some experiments, in one process or several, and storing it."""

from __future__ import annotations

import logging
import os
import signal
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from vehiclemor.codegen.cache import cache_folder
from vehiclemor.errors import MachineError, machine_reason
from vehiclemor.study.evaluate import evaluate, layout_of
from vehiclemor.study.experiment import Experiment
from vehiclemor.study.progress import tell
from vehiclemor.study.store import (
    cell_path,
    finished_cells,
    prepare_folder,
    read_cell,
    remove_partial,
    write_cell,
)

if TYPE_CHECKING:
    from concurrent.futures import Future

    import xarray as xr

Groups = Sequence[Sequence[Experiment]]
# Keys of what is finished of a group, and how the machine has failed in the rest, if it has.
Done = tuple[list[str], str]
# What evaluates groups elsewhere and stores their results, if so each by itself.
Engine = Callable[[Groups, Path, bool], Generator[Done, None, None]]
# How often what the machine has spoiled is tried; and seconds between two looks at the driver.
TRIES, LOOK = 3, 0.5
# Batches sent for each worker, so that none is idle; more would not fit into its queue.
WAITING = 2
# Seconds that a batch should take, beside which it is nothing to send it; and its most experiments.
BATCH, LARGEST = 0.5, 100
KILLED = "a worker process was killed, perhaps for lack of memory"
_LOG = logging.getLogger("vehiclemor")


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
        remove_partial(self.folder)
        wanted = {e.key: e for group in groups for e in group}
        self.asked |= wanted.keys()
        self.finished |= finished_cells(
            self.folder, wanted.keys() - self.finished, lambda key: layout_of(wanted[key])
        )
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
        few = len(work) < 2 * self.jobs and not again
        if not self.elsewhere and (self.jobs == 1 or few):
            for group in work:
                yield self._taken(*evaluate_and_store(group, self.folder))
            return
        # One group of each method first, so that workers compile different loops at a time.
        first = {id(group) for group in {g[0].method: g for g in reversed(work)}.values()}
        work.sort(key=lambda group: id(group) not in first)
        if self.elsewhere:
            engine = self.elsewhere(work, self.folder, again)
        else:
            engine = evaluated_by_workers(work, self.folder, self.jobs)
        with closing(engine):
            for done in engine:
                yield self._taken(*done)

    def _taken(self, finished: list[str], fault: str) -> str:
        self.finished.update(finished)
        self._report()
        return fault


def evaluate_and_store(experiments: Sequence[Experiment], folder: Path) -> Done:
    """Evaluate some experiments, and move each complete file into place.

    Raises
    ------
    MachineError
        If a result can't be stored: no other could.
    """
    # Another driver may have stored it, or a worker that was killed before it could say so.
    there = {e.key for e in experiments if cell_path(folder, e.key).exists()}
    left = [e for e in experiments if e.key not in there]

    def keep(key: str, dataset: xr.Dataset, seconds: float) -> None:
        write_cell(dataset, folder, key, seconds)

    finished, fault = evaluated(left, keep)
    return [*there, *finished], fault


def evaluated(
    experiments: Sequence[Experiment], keep: Callable[[str, xr.Dataset, float], object]
) -> Done:
    """Evaluate some experiments, and keep what each gives, under its key, and its seconds."""
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
        keep(experiment.key, dataset, time.perf_counter() - began)
        finished.append(experiment.key)
    return finished, fault


class Timed(NamedTuple):
    """What a batch gives, and the seconds that a worker took for it."""

    result: Any
    seconds: float


def timed_batch(work: Callable[..., Any], *arguments: object) -> Timed:
    """Run a batch on a worker."""
    began = time.perf_counter()
    return Timed(work(*arguments), time.perf_counter() - began)


def in_batches(
    groups: Groups,
    submit: Callable[[list[Experiment]], Future[Timed]],
    places: Callable[[], int],
    taken: Callable[[Future[Timed]], Timed],
    most: int = LARGEST,
) -> Generator[Any, None, None]:
    """Send groups to workers, several at once where they are quick; gives what comes back.

    Parameters
    ----------
    submit
        Sends a batch.
    places
        Tells how many batches can be worked at a time.
    taken
        Gives what a batch that is done has given.
    most
        Experiments of a batch, unless one group has more.
    """
    from concurrent.futures import FIRST_COMPLETED, wait

    waiting: dict[Future[Timed], int] = {}
    left, size = deque(groups), 1
    while left or waiting:
        at_once = WAITING * max(places(), 1)
        while left and len(waiting) < at_once:
            batch = list(left.popleft())
            # The last batches are small, so that workers end together.
            while left and len(batch) + len(left[0]) <= min(size, len(left) // at_once):
                batch += left.popleft()
            waiting[submit(batch)] = len(batch)
        for future in wait(waiting, return_when=FIRST_COMPLETED).done:
            number, (result, seconds) = waiting.pop(future), taken(future)
            if seconds > 0.0:
                size = int(min(max(BATCH * number / seconds, 1), most))
            yield result


def evaluated_by_workers(
    groups: Groups, folder: Path, jobs: int, work: Callable[..., Done] = evaluate_and_store
) -> Generator[Done, None, None]:
    """What `evaluate_and_store` gives for each batch, in processes that end with this one."""
    from concurrent.futures import Future
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

    def submit(batch: list[Experiment]) -> Future[Timed]:
        return pool.submit(timed_batch, work, batch, folder)

    try:
        yield from in_batches(groups, submit, lambda: jobs, Future.result)
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
