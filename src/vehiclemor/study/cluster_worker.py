"""What a worker of a cluster does: its cells, as its driver would, with its driver's kernels."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from vehiclemor.codegen.cache import asking, once, packed, unpacked
from vehiclemor.errors import FileError, InputError, MachineError
from vehiclemor.files import probe_folder
from vehiclemor.study.cell_file import encoded
from vehiclemor.study.evaluate import model_of
from vehiclemor.study.experiment import Experiment
from vehiclemor.study.provenance import code_digest
from vehiclemor.study.workers import Done, evaluate_and_store, evaluated

if TYPE_CHECKING:
    import xarray as xr

# Seconds until the driver has answered.
ANSWER = 20.0
# Key -> content of a cell's file, and whether a bug has ended it: what the driver is to write.
Sent = dict[str, tuple[bytes, bool]]


class Place(NamedTuple):
    """Where results belong, and how a worker finds out whether it sees that folder.

    Attributes
    ----------
    token, text
        A file of the driver's, and what it holds.
    topic
        Under which the driver is asked for kernels.
    """

    folder: Path
    token: Path
    text: str
    topic: str


def on_worker(experiments: Sequence[Experiment], place: Place) -> tuple[Done, Sent]:
    """Evaluate some experiments; gives their results too, if the driver is to write them."""
    with _turn(), asking(partial(from_others, place.topic)):
        _same_source(experiments)
        if _sees(place):
            return evaluate_and_store(experiments, place.folder), {}
        results: Sent = {}

        def keep(key: str, dataset: xr.Dataset, seconds: float) -> None:
            results[key] = encoded(dataset, key, seconds), "error" in dataset["status"].values

        return evaluated(experiments, keep), results


@once
def _turn() -> threading.Lock:
    """Cells of one process take turns: the limit of linear algebra is one for all its threads."""
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)
    return threading.Lock()


@cache
def _sees(place: Place) -> bool:
    """Whether a worker can write into the driver's own folder, not into another of its name."""
    try:
        if place.token.read_text() != place.text:
            return False
        probe_folder(place.token.parent)
    except (OSError, FileError, MachineError):
        return False
    return True


def _same_source(experiments: Sequence[Experiment]) -> None:
    """Raise `InputError` if results would be those of other source or another compiler."""
    for e in {(e.model, e.method): e for e in experiments}.values():
        what = ""
        if code_digest(e.model, e.method) != e.code:
            what = "another version of vehiclemor, or of the package of"
        elif model_of(e).kernel_hash != e.kernel:
            what = "another processor or compiler, which gives other kernels of"
        if what:
            from distributed import get_worker

            raise InputError(
                f"scheduler: worker {get_worker().address} has {what} {e.model} with {e.method}; "
                f"cells are known by what computes them, so it must be the driver's own"
            )


def from_others(topic: str, name: str, make: Callable[[], bytes]) -> bytes:
    """A file of the cache: the driver's, or another worker's, or else made for all."""
    from distributed import Lock, Variable, get_client, get_worker

    client = get_client()
    shared: Any = Variable(f"{topic} {name}", client=client)
    with Lock(f"{topic} {name}"):
        for answer in (0.0, ANSWER):
            if answer:
                get_worker().log_event(topic, name)
            try:
                content = unpacked(name, shared.get(timeout=answer))
            except TimeoutError:
                continue
            if content is not None:
                return content
        content = make()
        shared.set(packed(name, content))
    return content
