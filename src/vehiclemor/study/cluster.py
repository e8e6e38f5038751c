"""Studies on a cluster: workers of dask.distributed, at a scheduler's address.

Workers write their results into the driver's folder where they see it, else the driver does.  They
compile what their cache lacks.
"""

from __future__ import annotations

import logging
import os
import threading
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from vehiclemor.codegen.cache import once
from vehiclemor.errors import InputError, MachineError, one_line
from vehiclemor.files import temporary_path
from vehiclemor.provenance import code_digest
from vehiclemor.study.evaluate import model_of
from vehiclemor.study.experiment import Experiment
from vehiclemor.study.store import cell_path, prepare_folder
from vehiclemor.study.workers import LARGEST, Done, Engine, Groups, evaluate_and_store, in_batches

if TYPE_CHECKING:
    from distributed import Client

# Seconds: to reach a scheduler, and between two looks at who works.
REACH, LOOK = 10.0, 1.0
_LOG = logging.getLogger("vehiclemor")


@contextmanager
def reached(scheduler: str) -> Iterator[Engine]:
    """The workers of a scheduler.

    Raises
    ------
    InputError
        If the scheduler can't be reached.
    """
    try:
        from distributed import Client
        from distributed.utils import silence_logging_cmgr
    except ImportError:
        raise InputError("scheduler: needs dask: pip install 'vehiclemor[cluster]'") from None
    _knock(scheduler)
    # What matters is said in one line; dask would add a traceback for each lost connection.
    with silence_logging_cmgr(logging.CRITICAL):
        # It warns where versions differ.  Its types are those of awaited calls too.
        client: Any = Client(scheduler, timeout=REACH, set_as_default=False)
        with client:
            number = _places(client)
            work = f"{number} places for cells" if number else "no worker yet, cells wait"
            _LOG.info("scheduler %s: %s; dashboard %s", scheduler, work, client.dashboard_link)
            yield partial(evaluated_by_cluster, client=client)


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
    for e in {e.code + e.kernel: e for e in experiments}.values():
        code = code_digest(e.model, e.method, e.settings)
        if code != e.code or model_of(e).kernel_hash != e.kernel:
            from distributed import get_worker

            raise InputError(
                f"scheduler: worker {get_worker().address} has other source of {e.model} with "
                f"{e.method}; install the same versions of vehiclemor, sympy and plug-ins"
            )
