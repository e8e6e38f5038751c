"""How far a study is: read from what is stored, without computing anything."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from vehiclemor.arguments import count
from vehiclemor.errors import FileError, InputError
from vehiclemor.simulation.trajectory import FINISHED
from vehiclemor.study.plans.grid import Grid, expand
from vehiclemor.study.plans.loading import content_hash, studies_and_files
from vehiclemor.study.plans.protocol import load_protocol
from vehiclemor.study.plans.study_file import MOST_SEED
from vehiclemor.study.store import read_cell, result_path

LATER = "then the chosen ones are tested"
# What differs from run to run of one reason.
NUMBER = re.compile(r"-?\d[\d.e+-]*")


@dataclass
class StudyStatus:
    """How far a study is.

    Attributes
    ----------
    cells, done
        Of the study, and those that are finished; a failure of the equations is a finished cell.
    seconds_left
        Estimated, of one process; NaN where nothing is finished.
    ends
        (status, message) -> runs of the finished cells; of a bug, whose cell is tried again, too.
        Messages that differ in numbers are one.
    result
        File of the combined dataset, if there is one.
    later
        What a protocol does after these cells, which depends on how they end.
    """

    cells: int
    done: int = 0
    seconds_left: float = 0.0
    ends: Counter[tuple[str, str]] = field(default_factory=Counter)
    result: Path | None = None
    later: str = ""

    @property
    def to_do(self) -> int:
        """Cells that the next run computes."""
        return self.cells - self.done

    @property
    def failed(self) -> Counter[tuple[str, str]]:
        """(status, message) -> runs that have failed."""
        return Counter({end: n for end, n in self.ends.items() if end[0] not in FINISHED})


def status_of(study: str, folder: Path, seed: int | None = None) -> dict[str, StudyStatus]:
    """How far a study, or every one of a collection, is.

    Parameters
    ----------
    study
        Name of a study or collection, or path of a TOML file.
    folder
        Results folder.
    seed
        Of the drawn test runs of protocols, for an audit; by default that of their files.

    Returns
    -------
    dict
        Study name -> status; of a protocol, whose later cells follow from the first, that of its
        validation.

    Raises
    ------
    FileError
        If the results folder is a file.
    InputError
        If there is a seed and no test runs are drawn.
    """
    if folder.exists() and not folder.is_dir():
        raise FileError(f"{folder}: not a folder")
    if seed is not None:
        count("seed", seed, least=0, most=MOST_SEED)
    files = studies_and_files(study)
    if seed is not None and not any(definition.drawn for _, definition in files.values()):
        raise InputError(f"seed: {study} draws no test runs")
    found: dict[str, StudyStatus] = {}
    for name, (path, definition) in files.items():
        later = LATER if definition.bounds else ""
        if definition.bounds:
            protocol = load_protocol(str(path), seed if definition.drawn else None, name)
            name = protocol.study  # noqa: PLW2901  (an audit has a name of its own)
            validation = protocol.sets["validation"]
            groups = [e.experiments(protocol.model, validation) for e in protocol.entries]
            cells = {e.key: e.method for group in groups for e in group}
        else:
            cells = _methods(expand(name, definition))
        result = result_path(folder, name, content_hash(definition))
        found[name] = _status(cells, result, folder, later)
    return found


def _methods(grid: Grid) -> dict[str, str]:
    """Key of each cell -> label of its method."""
    labels = grid.dimensions["label"]
    keys = [np.unique(grid.keys[..., place]).astype(str).tolist() for place in range(len(labels))]
    return {key: label for label, own in zip(labels, keys, strict=True) for key in own}


def _status(
    cells: Mapping[str, str], result: Path | None, folder: Path, later: str = ""
) -> StudyStatus:
    """Of cells with their methods."""
    status = StudyStatus(len(cells), result=result, later=later)
    examples: dict[tuple[str, str], tuple[str, str]] = {}
    seconds: dict[str, list[float]] = defaultdict(list)
    missing: Counter[str] = Counter()
    for key, method in cells.items():
        try:
            cell = read_cell(folder, key)
        except FileError:
            # Missing, or set aside by the next run.
            missing[method] += 1
            continue
        for (name, message), runs in cell.ends.items():
            alike = name, NUMBER.sub("#", message)
            status.ends[examples.setdefault(alike, (name, message))] += runs
        if cell.broken:
            missing[method] += 1
        else:
            status.done += 1
            seconds[method].append(cell.seconds)
    status.seconds_left = _seconds_left(missing, seconds)
    return status


def _seconds_left(missing: Counter[str], seconds: Mapping[str, Iterable[float]]) -> float:
    """What cells still take, by the mean of those of their method, else of all."""
    means = {method: _mean(found) for method, found in seconds.items()}
    every = _mean([s for found in seconds.values() for s in found])
    return float(sum(n * means.get(method, every) for method, n in missing.items()))


def _mean(seconds: Iterable[float]) -> float:
    """The longest is left out: it has compiled what the others have used."""
    known = sorted(s for s in seconds if np.isfinite(s))
    return float(np.mean(known[:-1] or known or [np.nan]))
