"""Studies on a cluster: workers of dask.distributed, at a scheduler's address or on this machine.

Workers write their results into the driver's folder where they see it, else the driver does.  They
compile what their cache lacks.
"""

from __future__ import annotations

import logging
import time
import uuid
import warnings
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vehiclemor.codegen.cache import cache_folder
from vehiclemor.errors import InputError, MachineError, one_line
from vehiclemor.files import temporary_path, write_text
from vehiclemor.study.cluster_worker import Place, Sent, on_worker
from vehiclemor.study.experiment import Experiment
from vehiclemor.study.store import write_encoded
from vehiclemor.study.workers import (
    KILLED,
    LARGEST,
    Done,
    Engine,
    Groups,
    Timed,
    in_batches,
    timed_batch,
)

if TYPE_CHECKING:
    from concurrent.futures import Future

    from distributed import Client

LOCAL = "local"
# Seconds: to reach a scheduler, and between two looks at who works.
REACH, LOOK = 10.0, 1.0
# Ctrl-C reaches all processes of a terminal, and the driver ends the workers.
NO_INTERRUPT = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"
# Packages that must be the same everywhere; that of Python is its first two numbers.
SAME = ("python", "distributed")
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
    others = {"the scheduler": found["scheduler"]}
    others |= {f"worker {name}": entry for name, entry in found["workers"].items()}
    for who, entry in others.items():
        for package, version in _versions(entry).items():
            if version != own[package]:
                raise InputError(
                    f"scheduler: {who} runs {package} {version}, this process {own[package]}; "
                    f"install the same versions"
                )


def _versions(entry: dict[str, Any] | None) -> dict[str, str]:
    packages = (entry or {}).get("packages") or {}
    found = {name: str(packages.get(name)) for name in SAME}
    return found | {"python": ".".join(found["python"].split(".")[:2])}


def evaluated_by_cluster(
    groups: Groups,
    folder: Path,
    alone: bool = False,
    *,
    client: Client,
    work: Callable[..., tuple[Done, Sent]] | None = None,
) -> Generator[Done, None, None]:
    """What `evaluate_and_store` gives for each batch, by the workers of a cluster.

    Parameters
    ----------
    alone
        Whether each group is a batch of its own, so that one that kills workers spoils no other.
    """
    from distributed.cfexecutor import ClientExecutor

    folder = folder.absolute()
    token = temporary_path(folder / "cells" / "token")
    place = Place(folder, token, uuid.uuid4().hex)
    pool = ClientExecutor(client, pure=False)
    seen, number, most = 0.0, 0, 1 if alone else LARGEST

    def submit(batch: list[Experiment]) -> Future[Timed]:
        return pool.submit(timed_batch, work or on_worker, batch, place)

    def places() -> int:
        nonlocal seen, number
        if time.monotonic() - seen > LOOK:
            seen, number = time.monotonic(), _places(client)
        return number

    try:
        write_text(token, place.text)
        for done, results in in_batches(groups, submit, places, _taken, most):
            for key, (content, broken) in results.items():
                write_encoded(content, folder, key, broken=broken)
            yield done
    finally:
        pool.shutdown(wait=False)
        token.unlink(missing_ok=True)


def _taken(future: Future[Timed]) -> Timed:
    """What a worker has given; what it has died of is a fault of the machine."""
    from concurrent.futures import CancelledError

    from distributed import KilledWorker

    try:
        return future.result()
    except KilledWorker:
        return Timed((([], KILLED), {}), 0.0)
    except CancelledError:
        raise MachineError(
            "the scheduler is lost; what is finished is stored: run again to resume"
        ) from None
    except (ImportError, AttributeError) as error:
        raise InputError(
            f"scheduler: a worker lacks what this process has ({one_line(error)}); "
            f"install the same versions"
        ) from error
