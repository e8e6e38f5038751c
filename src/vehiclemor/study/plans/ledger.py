"""The ledger: every sealed draw that was ever evaluated, the bad ones too.

One line of JSON for each, `data/draws/<protocol>.jsonl`: a checkout adds to its own, which is
committed; what an installed package draws stands in the results folder alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vehiclemor.codegen.cache import locked
from vehiclemor.errors import FileError
from vehiclemor.files import write_text
from vehiclemor.resources import checkout_data, data_folder
from vehiclemor.toml_files import FileSchema, read_toml

if TYPE_CHECKING:
    from pydantic import TypeAdapter

FOLDER = "draws"


@dataclass(frozen=True)
class Shown:
    """What a draw has shown of one reduced model: its misses, and its worst errors by output."""

    method: str
    settings: dict[str, int | float | str]
    winner: bool
    misses: int
    silent: int
    flagged: int
    worst: dict[str, float]


@dataclass(frozen=True)
class Drawn:
    """A sealed draw.

    Attributes
    ----------
    date, version
        When it was opened, and with which versions.
    digest, rules
        Seal of the draw; hash of its bounds, boxes and rule of sensitive runs.
    runs, apart
        Runs that are judged, and those on which the full order is sensitive; none of a draw that
        was opened and never evaluated.
    rows
        Label -> what it has shown.
    """

    date: str
    version: str
    model: str
    digest: str
    rules: str
    runs: int
    apart: int
    rows: dict[str, Shown]

    @property
    def result(self) -> tuple:
        """What two evaluations of one draw must agree in."""
        counts = {name: (r.misses, r.silent, r.flagged) for name, r in self.rows.items()}
        return self.digest, self.runs, self.apart, counts


class Ledger:
    """The files of a protocol's ledger.

    Parameters
    ----------
    name
        Of the protocol.
    folder
        Results folder.
    own
        Whether the protocol is one of the package's.
    """

    def __init__(self, name: str, folder: Path, own: bool) -> None:
        self._written = _files(name, folder, checkout_data() if own else None)
        self._read = _files(name, folder, data_folder() if own else None)

    def entries(self) -> list[Drawn]:
        """All draws, oldest first."""
        found: list[Drawn] = []
        for path in self._read:
            known = [entry.result for entry in found]
            found += [entry for entry in _entries(path) if entry.result not in known]
        same = same_rules()
        found = [replace(entry, rules=same.get(entry.rules, entry.rules)) for entry in found]
        return sorted(found, key=lambda entry: entry.date)

    def open(self, entry: Drawn) -> None:
        """Say that a draw is about to be evaluated, before anything of it is."""
        self._add(replace(entry, runs=0, apart=0, rows={}))

    def record(self, entry: Drawn) -> None:
        """Add what a draw has shown; another result of the same draw stands beside the first."""
        self._add(entry)

    def _add(self, entry: Drawn) -> None:
        for path in self._written:
            with locked(path):
                known = _entries(path)
                same = [other for other in known if other.digest == entry.digest]
                if entry.result in [other.result for other in same] or (same and not entry.rows):
                    continue
                # What was opened is completed.
                kept = [other for other in known if other not in same or other.rows]
                lines = [_adapter().dump_json(e).decode() for e in (*kept, entry)]
                write_text(path, "\n".join(lines) + "\n")


class RulesFile(FileSchema):
    """Schema of `data/draws/same_rules.toml`."""

    rules: dict[str, str]


@cache
def same_rules() -> dict[str, str]:
    """Hash of the rules of earlier draws -> hash that the same rules have now."""
    return read_toml(data_folder() / FOLDER / "same_rules.toml", RulesFile).rules


def pooled(entries: Iterable[Drawn], rules: str, row: str | None = None) -> tuple[int, int, int]:
    """Misses, silent misses and runs in all draws under the same rules.

    Parameters
    ----------
    row
        Label of a row; by default what each draw had chosen, whatever its label.

    Notes
    -----
    A draw counts once, with the worst of its results.
    """
    worst: dict[str, tuple[int, int, int]] = {}
    for entry in entries:
        for label, shown in entry.rows.items():
            if entry.rules == rules and (shown.winner if row is None else label == row):
                result = shown.misses, shown.silent, entry.runs
                worst[entry.digest] = max(result, worst.get(entry.digest, result))
    misses, silent, runs = (
        np.array([*worst.values()], dtype=int).reshape(-1, 3).sum(axis=0).tolist()
    )
    return misses, silent, runs


def _files(name: str, folder: Path, data: Path | None) -> Sequence[Path]:
    return [place / FOLDER / f"{name}.jsonl" for place in (folder, data) if place is not None]


@cache
def _adapter() -> TypeAdapter[Drawn]:
    from pydantic import TypeAdapter

    return TypeAdapter(Drawn)


def _entries(path: Path) -> list[Drawn]:
    if not path.is_file():
        return []
    try:
        lines = path.read_text().splitlines()
        return [_adapter().validate_json(line, strict=True) for line in lines if line]
    except (ValueError, OSError) as error:
        told = str(error).splitlines()[0]
        raise FileError(f"{path}: not a ledger of draws ({told})") from None
