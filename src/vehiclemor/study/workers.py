"""Evaluating what is missing of some experiments, here, in processes or on a cluster.

Processes are those of joblib; a cluster is the workers of dask.distributed at a scheduler's
address, which send their results to the driver.  They compile what their cache lacks.
"""

from __future__ import annotations

import gc
import logging
import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import xarray as xr

from vehiclemor.codegen.cache import cache_folder, cached_by_one_thread
from vehiclemor.exceptions import InputError, MachineError, machine_reason, one_line
from vehiclemor.progress import tell
from vehiclemor.provenance import code_digest
from vehiclemor.study import store
from vehiclemor.study.evaluate import evaluate, model_of
from vehiclemor.study.experiment import Experiment

if TYPE_CHECKING:
    from concurrent.futures import Executor

Groups = Sequence[Sequence[Experiment]]
# How often what the machine has broken is tried; and seconds between two looks at the driver.
TRIES, LOOK = 3, 0.5
# Batches for each worker, so that all end together; and most experiments of a batch.
EACH, LARGEST = 32, 100
# Seconds to reach a scheduler, and after which it is asked whether it has workers.
REACH, IDLE = 10.0, 30.0
KILLED = "a worker process was killed, perhaps for lack of memory"
_LOG = logging.getLogger("vehiclemor")


class Done(NamedTuple):
    """Keys of what is finished, how the machine has failed in the others, if there are any.

    `sent` are contents of files by key, which the driver is to write.
    """

    finished: list[str]
    fault: str = ""
    sent: Mapping[str, bytes] = MappingProxyType({})


# What evaluates groups, if so each as a separate batch.
Engine = Callable[[Groups, bool], Generator[Done, None, None]]


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
        """Evaluate what is missing; a group stays in one process, where its fit is computed once.

        `MachineError` if the machine has failed again and again; what was finished is stored.
        """
        wanted = {experiment.key for group in groups for experiment in group}
        self.asked |= wanted
        self.finished |= store.finished_runs(self.folder, wanted - self.finished)
        if self._missing(groups):
            # A folder that can't be is named before anything is announced.
            store.prepare_folder(self.folder)
        tell(self.name, len(self.finished), len(self.asked))
        faults: list[str] = []
        for left in reversed(range(TRIES)):
            work = self._missing(groups)
            if not work:
                return
            faults = [fault for fault in self._evaluated(work, left < TRIES - 1) if fault]
            if faults and left:
                _LOG.warning("%s: %s; what is lost is tried again", self.name, faults[0])
        if missing := sum(map(len, self._missing(groups))):
            raise MachineError(
                f"{self.name}: {missing} of {len(self.asked)} runs can't be computed "
                f"({faults[0]}); what is finished is stored: run again to resume"
            )

    def result(self, experiment: Experiment) -> xr.Dataset:
        """Stored result of an experiment."""
        return store.read_run(self.folder, experiment.key).dataset()

    def _missing(self, groups: Groups) -> list[list[Experiment]]:
        """What is not finished, each once."""
        seen = set(self.finished)
        missing: list[list[Experiment]] = []
        for group in groups:
            # Two candidates may be the same experiment: it stays with the first.
            part = {
                experiment.key: experiment for experiment in group if experiment.key not in seen
            }
            seen |= part.keys()
            if part:
                missing.append([*part.values()])
        return missing

    def _evaluated(self, work: Groups, again: bool) -> Iterator[str]:
        """Evaluate groups; gives how the machine has failed in each, if it has."""
        work = one_of_each_method_first(work)
        # Starting processes costs seconds: a handful of groups is quicker without.  But what has
        # killed a worker would kill this process too.
        few = len(work) < 2 * self.jobs and not again
        if self.elsewhere:
            engine = self.elsewhere(work, again)
        elif self.jobs == 1 or few:
            engine = (evaluate_and_store(group, self.folder) for group in work)
        else:
            engine = in_processes(work, self.folder, self.jobs)
        with closing(engine):
            for done in engine:
                for key, content in done.sent.items():
                    store.write_run(content, self.folder, key)
                self.finished.update(done.finished)
                tell(self.name, len(self.finished), len(self.asked))
                yield done.fault


def one_of_each_method_first(groups: Groups) -> list[Sequence[Experiment]]:
    """Groups in an order in which workers compile different loops at a time."""
    first: dict[str, Sequence[Experiment]] = {}
    for group in groups:
        first.setdefault(group[0].method, group)
    return sorted(groups, key=lambda group: group is not first[group[0].method])


def evaluate_and_store(experiments: Sequence[Experiment], folder: Path) -> Done:
    """Evaluate some experiments, and store each complete file."""
    finished, fault = [], ""
    for experiment in experiments:
        key = experiment.key
        try:
            # Another driver may have stored it, or a worker that was killed before it said so.
            dataset = None if store.finished_runs(folder, [key]) else evaluate(experiment)
        except Exception as error:
            fault = str(error) if isinstance(error, MachineError) else machine_reason(error)
            if not fault:
                raise
            continue
        if dataset is not None:
            store.write_run(store.encoded(dataset, key), folder, key)
        finished.append(key)
    return Done(finished, fault)


def in_batches(
    pool: Executor,
    work: Callable[[list[Experiment]], Done],
    groups: Groups,
    size: int,
    at_once: int | None = None,
    killed: type[Exception] | tuple[()] = (),
    idle: Callable[[], object] = bool,
) -> Generator[Done, None, None]:
    """What some work gives for each batch of so many groups in a pool, which has some `at_once`.

    `killed` is raised of a batch whose worker was killed, while the pool lives on.  While nothing
    ends `idle` is called now and then.
    """
    from concurrent.futures import FIRST_COMPLETED, Future, wait

    batches = [[*chain(*groups[at : at + size])] for at in range(0, len(groups), size)]
    running: set[Future[Done]] = set()
    while batches or running:
        free = len(batches) if at_once is None else at_once - len(running)
        running |= {pool.submit(work, batch) for batch in batches[:free]}
        del batches[:free]
        done, running = wait(running, IDLE, FIRST_COMPLETED)
        if not done:
            idle()
        for future in done:
            try:
                yield future.result()
            except killed:
                yield Done([], KILLED)


def batch_size(groups: Groups, workers: int) -> int:
    """Groups of a batch, where so many batches are worked at a time."""
    return min(max(len(groups) // (EACH * max(workers, 1)), 1), LARGEST)


def in_processes(groups: Groups, folder: Path, jobs: int) -> Generator[Done, None, None]:
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
        size = batch_size(groups, jobs)
        # No more than the pool hands on: what it still held when it is ended would break it.
        yield from in_batches(pool, work, groups, size, 2 * jobs)
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


@contextmanager
def cluster(scheduler: str) -> Iterator[Engine]:
    """The workers of a scheduler; `InputError` if it can't be reached."""
    try:
        from distributed import Client
        from distributed.utils import silence_logging_cmgr
    except ImportError:
        raise InputError("scheduler: needs dask: pip install 'vehiclemor[cluster]'") from None
    # What matters is said in one line; dask would add a traceback for each lost connection.
    with silence_logging_cmgr(logging.CRITICAL):
        try:
            # Its types are those of awaited calls too.
            client: Any = Client(scheduler, timeout=REACH, set_as_default=False)
        except (OSError, TypeError, ValueError) as error:
            reason = str(error)
            # An incomplete client closes itself when it is collected: now, as within the next call
            # of dask it would wait for a lock that this call holds.
            error.__traceback__ = None
            gc.collect()
            raise InputError(f"scheduler {scheduler}: can't be reached ({reason})") from None
        with client:
            number = sum(client.nthreads().values())
            work = f"{number} threads for runs" if number else "no worker yet, runs wait"
            _LOG.info("scheduler %s: %s; dashboard %s", scheduler, work, client.dashboard_link)
            yield partial(on_cluster, client=client)


def on_cluster(groups: Groups, alone: bool = False, *, client: Any) -> Generator[Done, None, None]:
    """What `on_worker` gives for each batch.

    If `alone`, each group is a separate batch, so that one that kills workers harms no other.
    """
    from concurrent.futures import CancelledError

    from distributed import KilledWorker

    def warn_of_no_worker() -> None:
        if not client.nthreads():
            _LOG.warning("the scheduler has no worker: runs wait for one")

    pool = client.get_executor(pure=False)
    size = 1 if alone else batch_size(groups, sum(client.nthreads().values()))
    try:
        yield from in_batches(
            pool, on_worker, groups, size, killed=KilledWorker, idle=warn_of_no_worker
        )
    except CancelledError:
        raise MachineError(
            "the scheduler is lost; what is finished is stored: run again to resume"
        ) from None
    except (ImportError, AttributeError) as error:
        raise InputError(
            f"scheduler: a worker lacks what this process has ({one_line(error)}); "
            f"install the same versions"
        ) from error
    finally:
        pool.shutdown(wait=False)


def on_worker(experiments: Sequence[Experiment]) -> Done:
    """As `evaluate_and_store`, on a worker: files are sent."""
    with _turn(), TemporaryDirectory() as name:
        for e in {e.code + e.kernel: e for e in experiments}.values():
            code = code_digest(e.model, e.method)
            if code != e.code or model_of(e).kernel_hash != e.kernel:
                from distributed import get_worker

                raise InputError(
                    f"scheduler: worker {get_worker().address} has other source of {e.model} with "
                    f"{e.method}; install the same versions of vehiclemor, sympy and plug-ins"
                )
        done = evaluate_and_store(experiments, folder := Path(name))
        sent = {key: store.run_path(folder, key).read_bytes() for key in done.finished}
        return done._replace(sent=sent)


@cached_by_one_thread
def _turn() -> threading.Lock:
    """Runs of one process take turns: the limit of linear algebra is one for all its threads."""
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)
    return threading.Lock()
