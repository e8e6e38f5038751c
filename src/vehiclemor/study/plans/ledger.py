"""The ledger: every sealed draw that was ever evaluated, the bad ones too.

One line of JSON for each, `data/draws/<protocol>.jsonl`: a checkout adds to its own, which is
committed; what an installed package draws stands in the results folder alone.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from vehiclemor.codegen.process_lock import locked
from vehiclemor.errors import FileError
from vehiclemor.files import write_text
from vehiclemor.resources import checkout_data, data_folder

FOLDER = "draws"


@dataclass(frozen=True)
class Drawn:
    """What a sealed draw has shown.

    Attributes
    ----------
    date, version
        When, and with which versions.
    digest
        Seal of the draw.
    runs, apart
        Runs that are judged, and those on which the full order is sensitive.
    rows
        Label of a row -> method, settings, misses, silent ones, runs flagged, worst errors.
    """

    date: str
    version: str
    model: str
    digest: str
    runs: int
    apart: int
    rows: dict[str, dict[str, Any]]


def ledger(name: str, folder: Path, own: bool) -> list[Drawn]:
    """All draws of a protocol, oldest first.

    Parameters
    ----------
    name
        Of the protocol.
    folder
        Results folder.
    own
        Whether the protocol is one of the package's.
    """
    found: dict[str, Drawn] = {}
    for path in _files(name, folder, data_folder() if own else None):
        found |= {entry.digest: entry for entry in _entries(path) if entry.digest not in found}
    return sorted(found.values(), key=lambda entry: entry.date)


def record(entry: Drawn, name: str, folder: Path, own: bool) -> None:
    """Add a draw to the ledgers; one that stands there already is the same draw."""
    for path in _files(name, folder, checkout_data() if own else None):
        with locked(path):
            known = _entries(path)
            if entry.digest in {other.digest for other in known}:
                continue
            lines = [json.dumps(asdict(e), sort_keys=True) for e in (*known, entry)]
            write_text(path, "\n".join(lines) + "\n")


def pooled(entries: Iterable[Drawn], row: str) -> tuple[int, int, int]:
    """Misses, silent misses and runs of a row in all draws together."""
    rows = [(entry.rows[row], entry.runs) for entry in entries if row in entry.rows]
    return (
        sum(found["misses"] for found, _ in rows),
        sum(found["silent"] for found, _ in rows),
        sum(runs for _, runs in rows),
    )


def _files(name: str, folder: Path, data: Path | None) -> Sequence[Path]:
    return [place / FOLDER / f"{name}.jsonl" for place in (folder, data) if place is not None]


def _entries(path: Path) -> list[Drawn]:
    if not path.is_file():
        return []
    try:
        return [Drawn(**json.loads(line)) for line in path.read_text().splitlines() if line]
    except (ValueError, TypeError, OSError) as error:
        raise FileError(f"{path}: not a ledger of draws ({error})") from None
