"""Studies on a cluster: workers of dask.distributed, at a scheduler's address or on this machine.

Workers write their results into the driver's folder where they see it, else the driver does.  They
compile what their cache lacks.
"""

from __future__ import annotations

import logging
import os
import threading
import time
import warnings
from collections.abc import Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from vehiclemor.codegen.cache import cache_folder, once
from vehiclemor.errors import InputError, MachineError, one_line
from vehiclemor.files import temporary_path
from vehiclemor.study.evaluate import model_of
from vehiclemor.study.experiment import Experiment
from vehiclemor.study.provenance import code_digest
from vehiclemor.study.store import cell_path, prepare_folder
from vehiclemor.study.workers import LARGEST, Done, Engine, Groups, evaluate_and_store, in_batches

if TYPE_CHECKING:
    from distributed import Client

LOCAL = "local"
# Seconds: to reach a scheduler, and between two looks at who works.
REACH, LOOK = 10.0, 1.0
# Ctrl-C reaches all processes of a terminal, and the driver ends the workers.
NO_INTERRUPT = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"
_LOG = logging.getLogger("vehiclemor")


@contextmanager
def reached(scheduler: str, jobs: int) -> Iterator[Engine]:
    """The workers of a scheduler, or with `local` so many new ones that end with this process.

    Raises
    ------
    InputError
        If the scheduler can't be reached, or runs other versions.
    """
    try:
        import distributed
    except ImportError:
        raise InputError("scheduler: needs dask: pip install 'vehiclemor[cluster]'") from None
    from distributed.utils import silence_logging_cmgr

    with ExitStack() as stack:
        # What matters is said in one line; it would add a traceback for each lost connection.
        stack.enter_context(silence_logging_cmgr(logging.CRITICAL))
        address: Any = scheduler
        if scheduler == LOCAL:
            from vehiclemor.study import cluster_local

            word = {cluster_local.VARIABLE: cluster_local.WORD}
            address = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=jobs,
                    threads_per_worker=1,
                    processes=True,
                    dashboard_address="127.0.0.1:0",
                    silence_logs=logging.CRITICAL,
                    protocol=cluster_local.PROTOCOL,
                    preload=[NO_INTERRUPT, cluster_local.__name__],
                    env={"VEHICLEMOR_CACHE": str(cache_folder()), "NUMBA_NUM_THREADS": "1"} | word,
                )
            )
        yield partial(evaluated_by_cluster, client=stack.enter_context(_client(address)))


@contextmanager
def _client(address: Any) -> Iterator[Client]:
    from distributed import Client

    if isinstance(address, str):
        _knock(address)
    with warnings.catch_warnings():
        # What differs is an error below.
        warnings.simplefilter("ignore")
        # Its types are those of awaited calls too.
        client: Any = Client(address, timeout=REACH, set_as_default=False)
    with client:
        _same_versions(client)
        number = _places(client)
        work = f"{number} places for cells" if number else "no worker yet, cells wait for the first"
        at, dashboard = client.scheduler.address, client.dashboard_link
        _LOG.info("scheduler %s: %s; dashboard %s", at, work, dashboard)
        yield client


def _knock(address: str) -> None:
    """Raise `InputError` if there is no scheduler: a client that fails hangs when it is deleted."""
    import asyncio
    from concurrent.futures import ThreadPoolExecutor

    from distributed.core import connect
    from distributed.security import Security

    async def knock() -> None:
        arguments = Security().get_connection_args("client")
        # What is no scheduler may accept the connection, and never answer.
        connection = await asyncio.wait_for(connect(address, timeout=REACH, **arguments), REACH + 1)
        connection.abort()

    try:
        # A notebook has a loop of its own in this thread.
        with ThreadPoolExecutor(1) as other:
            other.submit(lambda: asyncio.run(knock())).result()
    except Exception as error:
        # Each kind of address has errors of its own.
        reason = " ".join(str(error).split()) or f"no answer in {REACH:g} s"
        raise InputError(f"scheduler {address}: can't be reached ({reason})") from error


def _places(client: Any) -> int:
    return sum(client.nthreads().values())


def _same_versions(client: Any) -> None:
    """Raise `InputError` if the scheduler or a worker runs other versions than this process."""
    found = client.get_versions()
    own = _versions(found["client"])
    for who, entry in {"the scheduler": found["scheduler"], **found["workers"]}.items():
        if (versions := _versions(entry)) != own:
            raise InputError(
                f"scheduler: {who} runs {versions}, this process {own}; install the same versions"
            )


def _versions(entry: dict[str, Any] | None) -> str:
    packages = (entry or {}).get("packages") or {}
    python = ".".join(str(packages.get("python")).split(".")[:2])
    return f"distributed {packages.get('distributed')} on Python {python}"


def evaluated_by_cluster(
    groups: Groups, folder: Path, alone: bool = False, *, client: Client
) -> Generator[Done, None, None]:
    """What `on_worker` gives for each batch.

    Parameters
    ----------
    alone
        Whether each group is a batch of its own, so that one that kills workers spoils no other.
    """
    from concurrent.futures import CancelledError

    from distributed import KilledWorker

    mark = temporary_path(folder.absolute() / "cells" / "driver")
    pool = client.get_executor(pure=False)
    seen, number = 0.0, 0

    def places() -> int:
        nonlocal seen, number
        if time.monotonic() - seen > LOOK:
            seen, number = time.monotonic(), _places(client)
        return number

    try:
        mark.touch()
        work, most = partial(on_worker, mark=mark), 1 if alone else LARGEST
        yield from in_batches(pool, work, groups, places, most, KilledWorker)
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
        mark.unlink(missing_ok=True)


def on_worker(experiments: Sequence[Experiment], mark: Path) -> Done:
    """As `evaluate_and_store`, on a worker; what it can't store is sent.

    Parameters
    ----------
    mark
        File of a random name in the driver's folder: who sees it sees that folder, and not another
        one of the same name.
    """
    with _turn():
        _same_source(experiments)
        if _seen(mark):
            return evaluate_and_store(experiments, mark.parents[1])
        with TemporaryDirectory() as name:
            prepare_folder(own := Path(name))
            done = evaluate_and_store(experiments, own)
            sent = {key: cell_path(own, key).read_bytes() for key in done.finished}
            return done._replace(sent=sent)


@once
def _turn() -> threading.Lock:
    """Cells of one process take turns: the limit of linear algebra is one for all its threads."""
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)
    return threading.Lock()


@cache
def _seen(mark: Path) -> bool:
    return mark.exists() and os.access(mark.parent, os.W_OK)


def _same_source(experiments: Sequence[Experiment]) -> None:
    """Raise `InputError` if results would be those of other source."""
    for e in {(e.model, e.method): e for e in experiments}.values():
        if code_digest(e.model, e.method) != e.code or model_of(e).kernel_hash != e.kernel:
            from distributed import get_worker

            raise InputError(
                f"scheduler: worker {get_worker().address} has other source of {e.model} with "
                f"{e.method}; install the same versions of vehiclemor, sympy and plug-ins"
            )
