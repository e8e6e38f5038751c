"""Runs of studies that something disturbs, and whether they resume to the undisturbed dataset."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from vehiclemor.files import TEMPORARY
from vehiclemor.study.run import run_studies
from vehiclemor.study.status import status_of

if TYPE_CHECKING:
    import xarray as xr

SECONDS = ("seconds", "offline_seconds")
# Seconds that a run may take, and until all its processes have ended.
PATIENCE, ENDED = 300.0, 15.0


class Subject(NamedTuple):
    """A study, the dataset that it always is to give, and a folder with its results."""

    path: Path
    expected: xr.Dataset
    cells: int
    done: Path


class Run(NamedTuple):
    """A driver in a process of its own, with all that it has started in its session."""

    process: subprocess.Popen
    text: Path
    known: tuple[str, ...]

    def ended(self, expected: int) -> list[str]:
        """What is wrong with how it ends."""
        try:
            status = self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return ["it hangs"]
        said = self.text.read_text()
        wrong = [f"exit status {status}: {said}"] if status != expected else []
        # Beside progress and what is tried again there is one line, if any.
        others = [line for line in said.splitlines() if not line.startswith(self.known)]
        if len(others) != (status > 0) or not all(o.startswith("vehiclemor: ") for o in others):
            wrong.append(f"it says {others}")
        deadline = time.monotonic() + ENDED
        while left := session(self.process.pid):
            if time.monotonic() > deadline:
                wrong.append(f"processes are left: {left}")
                break
            time.sleep(0.1)
        return wrong


def session(leader: int) -> dict[int, str]:
    """Processes of a session, and their command lines."""
    found = {}
    for place in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            command = (place / "cmdline").read_text().replace("\0", " ")
            if os.getsid(int(place.name)) == leader and command:
                found[int(place.name)] = command
    return found


def started(subject: Subject, out: Path, options: list[str]) -> Run:
    """A run of a study on the command line."""
    command = [sys.executable, "-m", "vehiclemor", "run", str(subject.path), "--out", str(out)]
    text = subject.path.with_name(f"{time.monotonic_ns()}.txt")
    with text.open("w") as file:
        process = subprocess.Popen(  # noqa: S603 - this package
            [*command, *options], stdout=subprocess.DEVNULL, stderr=file, start_new_session=True
        )
    return Run(process, text, (f"{subject.path.stem}: ", "scheduler ", str(out)))


def finished(out: Path) -> dict[Path, int]:
    """Files of finished cells, and when they were written."""
    return {path: path.stat().st_mtime_ns for path in (out / "cells").glob("??/*")}


def same(one: xr.Dataset, other: xr.Dataset) -> bool:
    """Whether two datasets are the same bit by bit, but for seconds."""

    def content(dataset: xr.Dataset) -> dict[str, object]:
        values = {str(n): v for n, v in dataset.variables.items() if n not in SECONDS}
        # Tables of text are text; numbers are what lies in memory.
        return {
            name: (
                v.dims,
                v.attrs,
                v.values.tolist() if v.dtype.kind in "OU" else v.values.tobytes(),
            )
            for name, v in values.items()
        }

    return content(one) == content(other) and set(one.variables) == set(other.variables)


def resumed(subject: Subject, out: Path) -> list[str]:
    """What is wrong with what is stored, and with what the next run makes of it."""
    before = finished(out)
    (status,) = status_of(str(subject.path), out).values()
    wrong = [] if status.done == len(before) else [f"{status.done} told, {len(before)} stored"]
    (found,) = run_studies(str(subject.path), out).values()
    after = finished(out)
    if not before.items() <= after.items():
        wrong.append("a finished cell was computed again")
    return wrong + result(subject, out, found)


def result(subject: Subject, out: Path, found: xr.Dataset | None = None) -> list[str]:
    """What is wrong with the result of a run that was not disturbed any more."""
    if found is None:
        (found,) = run_studies(str(subject.path), out).values()
    wrong = [] if same(subject.expected, found) else ["another dataset"]
    if len(finished(out)) != subject.cells:
        wrong.append(f"{len(finished(out))} cells, not {subject.cells}")
    wrong += [f"left: {path}" for path in out.rglob(f"{TEMPORARY}*")]
    return wrong
