"""Numbers of README, pages and paper by name, from stored results: `paper/numbers.json`.

Usage: python paper/measured_numbers.py [--results DIR] [--texts] [--list PATTERN]

A name is an address in a table: `predictive.double_wishbone.path_map.misses`.  The file holds the
numbers that texts ask for; `--list` shows all names that stored results offer.  Nothing is computed
anew.  Numbers whose file the results folder lacks stay as they are, and the script says which.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Callable, Iterator, Sequence, Set
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import typst
import xarray as xr
from number_tables import (
    Entry,
    comparison,
    named_values,
    operations,
    peers,
    published,
    sizes,
    steps,
    studies,
)
from numbers_by_name import FILE, load, names_in, render

from vehiclemor.files import write_text
from vehiclemor.registry import component, names
from vehiclemor.report.published import TIMING

ROOT = FILE.parents[1]
# Last part of a name -> its unit; an error has that of its output.
UNITS = {"us": "us", "offline_us": "us", "worst_m": "m", "worst_deg": "deg"}
UNITS |= {"growth_rate": "1/s", "growth_largest": "1/s"}
ERRORS = ("rms_error", "smallest", "largest", "natural")


@cache
def output_units() -> dict[str, str]:
    """Unit of every output of every model."""
    return {q.name: q.unit for name in names("model") for q in component("model", name).outputs}


def unit(name: str) -> str:
    """Unit of a number by the last parts of its name."""
    *_, output, last = ["", *re.sub(r"worst_(rms|max|relative)_", "", name).split(".")]
    if last.endswith("seconds"):
        return "s"
    return output_units().get(output if last in ERRORS else last, UNITS.get(last, "1"))


def sources(results: Path) -> Iterator[tuple[str, str, Callable[[], Iterator[Entry]]]]:
    """Source, command that writes it, numbers of it."""

    def of_file(make: Callable[[Any], Iterator[Entry]], file: str) -> Iterator[Entry]:
        if file.endswith(".json"):
            return make(json.loads((results / file).read_text(encoding="utf-8")))
        return make(xr.open_dataset(results / file).load())

    yield "data/published/masoudi2015.toml", "", published
    yield "src", "", operations
    yield "studies", "vehiclemor compare paper", partial(comparison, results)
    for name in ("in_use", "other_steering", "control"):
        file = f"{name}.nc"
        yield file, f"python paper/{name}.py", partial(of_file, partial(named_values, name), file)
    yield "mesh_sizes.nc", "python paper/mesh_sizes.py", partial(of_file, sizes, "mesh_sizes.nc")
    yield "peers.json", "tox -e peers", partial(of_file, peers, "peers.json")
    yield "steps.json", "python benchmarks/steps.py", partial(of_file, steps, "steps.json")
    for name, make in studies():
        command = "compare paper" if name in TIMING.values() else f"run {name}"
        # Its file is that of who has the logs.
        command += ".toml" if name.startswith("logs-") else ""
        file = f"studies/{name}.nc"
        yield file, f"vehiclemor {command}", partial(of_file, make, file)


def offered(results: Path) -> Iterator[tuple[str, str, Sequence[Entry]]]:
    """Source, command and numbers of what the results folder holds; says what it lacks."""
    for source, command, make in sources(results):
        try:
            yield source, command, list(make())
        except FileNotFoundError as error:
            print(f"{error.filename}: missing; its numbers stay as they are", file=sys.stderr)


def measured(results: Path, names: Set[str], known: dict[str, Any]) -> dict[str, Any]:
    """Numbers of these names; those whose file is missing as they are `known`."""
    numbers: dict[str, Any] = {}
    read: set[str] = set()
    for source, command, entries in offered(results):
        read.add(source)
        for name, value, *units in entries:
            if name in names and np.isfinite(value):
                rounded = float(f"{float(value):.6g}")
                head = {"value": rounded, "unit": units[0] if units else unit(name)}
                numbers[name] = head | {"source": source, "command": command}
    for name in names & known.keys():
        if known[name]["source"] not in read:
            numbers[name] = known[name]
    return dict(sorted(numbers.items()))


def asked(root: Path) -> set[str]:
    """Names that the pages and the paper ask for."""
    names: set[str] = set()
    for source in (root / "docs").glob("*.md.in"):
        names |= names_in(source.read_text(encoding="utf-8"))
    paper, how = root / "paper" / "paper.typ", {"names": ""}
    found = typst.query(paper, "<number>", field="value", root=root, sys_inputs=how)
    return names.union(json.loads(found))


def texts(root: Path, numbers: dict[str, Any]) -> Iterator[tuple[Path, str]]:
    """Each text with numbers, as it should be: from `docs/NAME.md.in`; README stands above."""
    for source in sorted((root / "docs").glob("*.md.in")):
        folder = root if source.stem == "README.md" else source.parent
        text = source.read_text(encoding="utf-8")
        yield folder / source.stem, render(text, numbers, source.name)


def main() -> None:
    """Write the numbers and the texts with numbers, or list names."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--results", type=Path, default=Path("results"), help="results folder")
    parser.add_argument("--texts", action="store_true", help="only put numbers into the texts")
    parser.add_argument("--list", metavar="PATTERN", help="only list names that match")
    wanted = parser.parse_args()
    if wanted.list is not None:
        for _, _, entries in offered(wanted.results):
            for name, *_ in entries:
                if re.search(wanted.list, name):
                    print(name)
        return
    known = load() if FILE.exists() else {}
    if not wanted.texts:
        known = measured(wanted.results, asked(ROOT), known)
        rows = (f"{json.dumps(name)}: {json.dumps(entry)}" for name, entry in known.items())
        write_text(FILE, "{\n" + ",\n".join(rows) + "\n}\n")
    for path, text in texts(ROOT, known):
        write_text(path, text)


if __name__ == "__main__":
    main()
