"""What a worker of a cluster does: its cells, as its driver would."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from vehiclemor.codegen.cache import once
from vehiclemor.errors import FileError, InputError, MachineError
from vehiclemor.files import probe_folder
from vehiclemor.study.cell_file import encoded
from vehiclemor.study.evaluate import model_of
from vehiclemor.study.experiment import Experiment
from vehiclemor.study.provenance import code_digest
from vehiclemor.study.workers import Done, evaluate_and_store, evaluated

if TYPE_CHECKING:
    import xarray as xr

# Key -> content of a cell's file, and whether a bug has ended it: what the driver is to write.
Sent = dict[str, tuple[bytes, bool]]


class Place(NamedTuple):
    """Where results belong, and how a worker finds out whether it sees that folder.

    Attributes
    ----------
    token, text
        A file of the driver's, and what it holds.
    """

    folder: Path
    token: Path
    text: str


def on_worker(experiments: Sequence[Experiment], place: Place) -> tuple[Done, Sent]:
    """Evaluate some experiments; gives their results too, if the driver is to write them."""
    with _turn():
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
    """Raise `InputError` if results would be those of other source."""
    for e in {(e.model, e.method): e for e in experiments}.values():
        if code_digest(e.model, e.method) != e.code or model_of(e).kernel_hash != e.kernel:
            from distributed import get_worker

            raise InputError(
                f"scheduler: worker {get_worker().address} has other source of {e.model} with "
                f"{e.method}; install the same versions of vehiclemor, sympy and plug-ins"
            )
