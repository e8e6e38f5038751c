"""Kills, full disks and damaged files: whether studies resume to the identical dataset.

Usage: python paper/faults.py [--results DIR] [--rounds 1] [--seed 16]

Writes DIR/faults.nc, how often each was done and how often it held, which `paper/facts.py` writes
into the texts, and prints each with its moment.  It holds if the run ends as the handbook says, in
one line, leaves no process, and the next run gives, bit by bit but for seconds, the dataset of an
undisturbed run, with every cell once, finished ones untouched, and no part of a file.  Full disks
and folders that can't be written need the right to mount, else they are left out.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from disturbed_runs import Subject, finished, result, resumed, session, started
from named_values import Values, measured_values

from vehiclemor.files import TEMPORARY
from vehiclemor.study import cell_file
from vehiclemor.study.run import run_studies
from vehiclemor.study.store import ASIDE

if TYPE_CHECKING:
    import xarray as xr

FILE, TITLE = "faults.nc", "Kills, full disks and damaged files"
STUDY = """
title = "for kills and damage"
model = "{model}"
training = "nominal"
keep = "metrics"

[grid]
frequency_factor = {{ first = 0.8, last = 1.2, count = {frequencies} }}
amplitude_factor = {{ first = 0.8, last = 1.1, count = 10 }}
rank = {ranks}

[[methods]]
method = "full_order"

[[methods]]
method = "pod"
"""
# Model -> frequencies and ranks: 200 and 60 cells.
STUDIES = {"double_wishbone": (5, [2, 3, 4]), "independent_suspension_vehicle": (3, [3])}
JOINED = {"joblib": ["--jobs", "2"], "dask local": ["--jobs", "2", "--scheduler", "local"]}
# What is killed, how, under which engine; and the exit status of the driver.
KILLS = [
    ("driver", signal.SIGKILL, "joblib", -signal.SIGKILL),
    ("driver", signal.SIGKILL, "dask local", -signal.SIGKILL),
    ("driver", signal.SIGINT, "joblib", 128 + signal.SIGINT),
    ("driver", signal.SIGINT, "dask local", 128 + signal.SIGINT),
    ("driver", signal.SIGTERM, "joblib", 128 + signal.SIGTERM),
    ("driver", signal.SIGTERM, "dask local", 128 + signal.SIGTERM),
    ("worker", signal.SIGKILL, "joblib", 0),
    ("worker", signal.SIGKILL, "dask local", 0),
    ("worker", signal.SIGKILL, "dask", 0),
    ("scheduler", signal.SIGKILL, "dask", 1),
]
# How command lines of processes of workers tell that they are some.
WORKER = ("popen_loky_posix", "spawn_main")


class Fault(NamedTuple):
    """What is done to a study in a new folder; gives when, and what does not hold then."""

    name: str
    do: Callable[[Subject, Path, random.Random], tuple[str, list[str]]]


# Kills


@contextmanager
def cluster(folder: Path) -> Iterator[tuple[int, int, list[str]]]:
    """A scheduler, and what keeps two workers: leaders of their sessions, and options of a run."""
    file = folder / f"{time.monotonic_ns()}.json"

    def dask(kind: str, *further: str) -> subprocess.Popen:
        words = [f"distributed.cli.dask_{kind}", "--scheduler-file", str(file), "--no-dashboard"]
        return subprocess.Popen(  # noqa: S603 - fixed words
            [sys.executable, "-m", *words, *further],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    scheduler = dask("scheduler", "--host", "127.0.0.1", "--port", "0")
    keeper = dask("worker", "--nworkers", "2", "--nthreads", "1")
    try:
        while not file.exists():
            time.sleep(0.05)
        address = json.loads(file.read_text())["address"]
        yield scheduler.pid, keeper.pid, ["--scheduler", address]
    finally:
        for process in (keeper, scheduler):
            for number in session(process.pid):
                with suppress(ProcessLookupError):
                    os.kill(number, signal.SIGKILL)
            process.wait()


def killed(
    subject: Subject,
    out: Path,
    chance: random.Random,
    *,
    victim: str,
    number: int,
    engine: str,
    status: int,
) -> tuple[str, list[str]]:
    """Kill something when so many cells are stored, and resume."""
    with ExitStack() as stack:
        local = nullcontext((0, 0, JOINED.get(engine, [])))
        scheduler, keeper, options = stack.enter_context(
            local if engine in JOINED else cluster(subject.path.parent)
        )
        run = started(subject, out, options)
        at = chance.randint(1, int(0.8 * subject.cells))
        while len(finished(out)) < at:
            if run.process.poll() is not None:
                return f"at {at}", [f"it ends too early: {run.text.read_text()}"]
            time.sleep(0.005)
        time.sleep(chance.uniform(0.0, 0.02))
        targets = {"driver": run.process.pid, "scheduler": scheduler}
        if victim == "worker":
            those = session(keeper or run.process.pid).items()
            workers = [p for p, command in those if any(word in command for word in WORKER)]
            targets["worker"] = chance.choice(sorted(workers))
        stored = len(finished(out))
        # Ctrl-C reaches all processes of a terminal.
        (os.killpg if number == signal.SIGINT else os.kill)(targets[victim], number)
        wrong = run.ended(status)
    return f"at {stored} of {subject.cells} cells", wrong + resumed(subject, out)


def two_drivers(subject: Subject, out: Path, chance: random.Random) -> tuple[str, list[str]]:
    """Run a study twice at once."""
    one = started(subject, out, JOINED["joblib"])
    delay = chance.uniform(0.0, 2.0)
    time.sleep(delay)
    engine = chance.choice([[], *JOINED.values()])
    other = started(subject, out, engine)
    wrong = [line for run in (one, other) for line in run.ended(0)]
    return f"{delay:.2f} s later, {engine}", wrong + result(subject, out)


# The disk


@contextmanager
def disk(place: Path, size: int) -> Iterator[Callable[..., None]]:
    """A disk of so many bytes; gives what sets its size and whether it can be written."""
    place.mkdir()

    def mount(options: str) -> None:
        command = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(place)]
        subprocess.run(command, check=True)  # noqa: S603 - fixed words

    mount(f"size={size}")
    try:
        yield lambda options: mount(f"remount,{options}")
    finally:
        subprocess.run(["umount", str(place)], check=True)  # noqa: S603, S607


def full_disk(subject: Subject, out: Path, chance: random.Random) -> tuple[str, list[str]]:
    """Let the disk be full at some moment, enlarge it, and resume."""
    share = chance.uniform(0.05, 0.9)
    need = sum(path.stat().st_blocks * 512 for path in subject.done.rglob("*"))
    with disk(out, int(share * need)) as remount:
        engine = chance.choice([[], *JOINED.values()])
        wrong = started(subject, out / "results", engine).ended(1)
        wrong += [f"left: {path}" for path in out.rglob(f"{TEMPORARY}*")]
        remount("size=100%")
        wrong += resumed(subject, out / "results")
    return f"at {share:.0%}, {engine}", wrong


def read_only(subject: Subject, out: Path, chance: random.Random) -> tuple[str, list[str]]:
    """Let the disk be read-only when the study is half done, and when it is done."""
    with disk(out, 1 << 26) as remount:
        results = shutil.copytree(subject.done, out / "results")
        lost = chance.sample(sorted(finished(results)), chance.randint(1, subject.cells))
        for path in lost:
            path.unlink()
        remount("ro")
        wrong = started(subject, results, chance.choice([[], *JOINED.values()])).ended(2)
        remount("rw")
        wrong += resumed(subject, results)
        remount("ro")
        wrong += started(subject, results, []).ended(0) + result(subject, results)
    return f"{len(lost)} cells missing", wrong


# Damage

Damage = Callable[[Path, Path, random.Random], object]


def flipped(path: Path, _: Path, chance: random.Random) -> None:
    """Flip a bit."""
    content = bytearray(path.read_bytes())
    content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    path.write_bytes(content)


def folder(path: Path, *_: object) -> None:
    """Put a folder in the place."""
    path.unlink()
    path.mkdir()
    (path / "notes.txt").write_text("mine")


def other_version(path: Path, *_: object) -> None:
    """What another version of the layout has written, soundly."""
    content = path.read_bytes()
    digest = cell_file.check(content, path.stem)["sha256"].encode()
    changed = content.replace(cell_file.SCHEMA.encode(), b"vehiclemor cell 0", 1)
    zeros = changed.replace(digest, cell_file.ZEROS.encode(), 1)
    path.write_bytes(changed.replace(digest, hashlib.sha256(zeros).hexdigest().encode(), 1))


def foreign(path: Path, *_: object) -> None:
    """A netCDF file of somebody else."""
    import xarray as xr

    xr.Dataset({"mine": ("x", [1.0, 2.0])}).to_netcdf(path)


DAMAGES: dict[str, Damage] = {
    "truncated": lambda p, _, c: p.write_bytes(p.read_bytes()[: c.randrange(p.stat().st_size)]),
    "flipped bit": flipped,
    "swapped": lambda p, other, _: p.write_bytes(other.read_bytes()),
    "empty": lambda p, *_: p.write_bytes(b""),
    "folder": folder,
    "foreign": foreign,
    "other version": other_version,
}


def damaged(
    subject: Subject, out: Path, chance: random.Random, *, kind: str
) -> tuple[str, list[str]]:
    """Damage some cells, or the combined dataset, and run again."""
    shutil.copytree(subject.done, out)
    combined = kind.startswith("combined ")
    do = DAMAGES[kind.removeprefix("combined ")]
    cells = sorted(finished(out))
    paths = list((out / "studies").glob("*.nc")) if combined else chance.sample(cells, 5)
    for path in paths:
        do(path, chance.choice([cell for cell in cells if cell not in paths]), chance)
    # In a process of its own: libraries may crash on what is damaged.
    wrong = started(subject, out, []).ended(0) + result(subject, out)
    aside = len(list(out.glob(f"*/{ASIDE}/*")))
    if aside != len(paths):
        wrong.append(f"{aside} of {len(paths)} set aside")
    return f"{len(paths)} files", wrong


def faults() -> list[Fault]:
    """All of them, each once."""
    found = [
        Fault(
            f"{victim} {number.name} {engine}",
            partial(killed, victim=victim, number=number, engine=engine, status=status),
        )
        for victim, number, engine, status in KILLS
    ]
    found.append(Fault("two drivers", two_drivers))
    if can_mount():
        found += [Fault("full disk", full_disk), Fault("read-only", read_only)]
    kinds = [*DAMAGES, *(f"combined {kind}" for kind in DAMAGES if kind != "other version")]
    return found + [Fault(kind, partial(damaged, kind=kind)) for kind in kinds]


def can_mount() -> bool:
    """Whether this process may mount a disk."""
    try:
        with tempfile.TemporaryDirectory() as place, disk(Path(place) / "disk", 1 << 20):
            return True
    except (OSError, subprocess.CalledProcessError):
        return False


def subjects(folder: Path) -> Iterator[Subject]:
    """The studies, each run by one process that nothing disturbs."""
    for model, (frequencies, ranks) in STUDIES.items():
        path, done = folder / f"{model}.toml", folder / f"{model} done"
        path.write_text(STUDY.format(model=model, frequencies=frequencies, ranks=ranks))
        (expected,) = run_studies(str(path), done).values()
        yield Subject(path, expected, len(finished(done)), done)


def all_faults(rounds: int, seed: int, only: str) -> Values:
    """Do each fault to each study so often."""
    values: Values = {}
    with tempfile.TemporaryDirectory() as scratch:
        for subject in subjects(Path(scratch)):
            for fault in faults():
                for turn in range(rounds if fault.name.startswith(only) else 0):
                    own = f"{seed} {subject.path.stem} {fault.name} {turn}"
                    out = Path(scratch) / own
                    when, wrong = fault.do(subject, out, random.Random(own))  # noqa: S311
                    shutil.rmtree(out, ignore_errors=True)
                    print(f"[{own}] {when}: {'; '.join(wrong) or 'holds'}", flush=True)
                    for name, more in (("done", 1), ("held", not wrong)):
                        key = f"{fault.name} {name}, 1"
                        values[key] = values.get(key, 0) + more
    return values


def measured(
    folder: Path, anew: bool = False, rounds: int = 1, seed: int = 16, only: str = ""
) -> xr.Dataset:
    """What the results folder holds; done where it lacks it, or once more."""
    return measured_values(folder / FILE, TITLE, [partial(all_faults, rounds, seed, only)], anew)


def main() -> int:
    """Do all, write, print; exit status 1 if something does not hold."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--results", type=Path, default=Path("results"), help="results folder")
    parser.add_argument("--rounds", type=int, default=1, help="of each fault and study")
    parser.add_argument("--seed", type=int, default=16, help="of the moments and places")
    parser.add_argument("--only", default="", help="faults whose names begin so")
    chosen = parser.parse_args()
    found = measured(chosen.results, True, chosen.rounds, chosen.seed, chosen.only)
    count = dict(zip(found["name"].values, found["value"].values.astype(int), strict=True))
    names = [name.removesuffix(" done") for name in count if name.endswith(" done")]
    for name in names:
        print(f"{name:28}{count[f'{name} held']:3} of {count[f'{name} done']}")
    return int(any(count[f"{name} held"] < count[f"{name} done"] for name in names))


if __name__ == "__main__":
    sys.exit(main())
