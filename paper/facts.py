"""Numbers in README and handbook: measured from stored results and written into the texts.

Usage: python paper/facts.py [--results DIR] [--jobs N] [--stored]

`paper/numbers.toml` gives each number as an expression over results.  This script runs the studies
that the results folder lacks, keeps the values in `paper/facts.json`, and writes them into the
texts.  With --stored it takes only what the folder holds; other numbers stay, and it says which.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import in_use
from fragments import (
    ROOT,
    manifest,
    printed_numbers,
    rendered,
    rewritten,
)

from vehiclemor import VehiclemorError
from vehiclemor.files import write_text

if TYPE_CHECKING:
    import xarray as xr

FACTS = ROOT / "paper" / "facts.json"
# Kinds of sources that one file of the results folder holds; and those of a script each.
SCRIPTS = {"in_use": in_use}
FILES = {"benchmark": "benchmark.json"} | {kind: script.FILE for kind, script in SCRIPTS.items()}
# The truck's protocol takes a quarter of an hour: it is no part of its collection.
PROTOCOLS = {
    "predictive": ("predictive", "predictive-flexible_truck"),
    "contenders": ("contenders",),
}
# [source: variable; label; label; ...]
QUERY = re.compile(r"\[([^:\[\]]+):([^\[\]]+)\]")
# What an expression may call; everything else is arithmetic.
FUNCTIONS: dict[str, Callable] = {
    "largest": lambda array: array.max(),
    "smallest": lambda array: array.min(),
    "mean": lambda array: array.mean(),
    "count": lambda array: array.sum(),
}


def sources_of(expression: str) -> list[str]:
    """Short names of the sources of an expression."""
    return [query[1].strip() for query in QUERY.finditer(expression)]


def evaluate(expression: str, datasets: dict[str, xr.Dataset]) -> tuple[float, str]:
    """Value of an expression over results, and its unit if it is a single number of them."""
    operands: dict[str, Any] = {}

    def operand(query: re.Match[str]) -> str:
        operands[name := f"_{len(operands)}"] = selected(datasets[query[1].strip()], query[2])
        return name

    formula = QUERY.sub(operand, expression)
    names = {"__builtins__": {}} | FUNCTIONS | operands
    value = eval(formula, names)  # noqa: S307 - the manifest is source of this repository
    try:
        unit = str(value.attrs.get("units", "")) if formula == "_0" else ""
        return float(value), unit
    except (AttributeError, TypeError, ValueError):
        raise VehiclemorError(f"{expression}: {getattr(value, 'dims', value)}, no number") from None


def selected(dataset: xr.Dataset, query: str) -> xr.DataArray:
    """A variable at labels, each a `label` of one dimension or `dimension=number`."""
    import numpy as np

    variable, *labels = [part.strip() for part in query.split(";")]
    array = dataset[variable]
    for label in labels:
        name, _, value = label.rpartition("=")
        if name in array.dims:
            place = {name: np.isclose(array[name].values.astype(float), float(value), rtol=1e-9)}
        else:
            place = {str(d): array[d].values.astype(str) == label for d in array.dims}
            place = {dim: found for dim, found in place.items() if found.any()}
        if [int(found.sum()) for found in place.values()] != [1]:
            raise VehiclemorError(f"{query}: {label!r} is not one label, but {list(place)}")
        array = array.isel({dim: int(found.argmax()) for dim, found in place.items()})
    if "output_unit" in array.coords and not array["output_unit"].dims:
        array = array.assign_attrs(units=str(array["output_unit"].item()))
    return array.squeeze(drop=True).reset_coords(drop=True)


def load(source: str, folder: Path, jobs: int) -> xr.Dataset:
    """A study, or a table of the report; what the folder lacks is run first."""
    import pandas as pd
    from regenerate import operation_table

    from vehiclemor.report.comparison import cost_table, study_comparison
    from vehiclemor.report.published import load_published
    from vehiclemor.study.run import run_studies

    kind, _, model = source.partition(" ")
    if kind == "costs":
        return cost_table(model, folder).set_index(["start", "case"]).to_xarray()
    if kind == "operations":
        return operation_table(model).set_index("kernel").to_xarray()
    if kind == "benchmark":
        path = folder / FILES[kind]
        if not path.exists():
            raise VehiclemorError(f"{path}: no such file; `tox -e bench` makes it")
        rows = json.loads(path.read_text(encoding="utf-8"))["benchmarks"]
        values = {_benchmark(row["fullname"]): row["stats"] | row["extra_info"] for row in rows}
        return pd.DataFrame.from_dict(values, "index").rename_axis("name").to_xarray()
    if kind in SCRIPTS:
        return SCRIPTS[kind].measured(folder)
    if kind == "published":
        values = {key: number.value for key, number in load_published().numbers.items()}
        return pd.DataFrame({"value": values}).rename_axis("id").to_xarray()
    if kind in PROTOCOLS:
        parts = [study_comparison(study, folder, jobs) for study in PROTOCOLS[kind]]
        rows = pd.concat(parts, ignore_index=True)
        rows = rows[rows["kind"] == "method"].dropna(axis=1, how="all")
        return rows.set_index(["model", "label"]).to_xarray()
    if kind == "sizes":
        rows = study_comparison(model, folder, jobs)
        return rows.set_index(["mesh", "label"]).to_xarray()
    return run_studies(source, folder, jobs)[source]


def _benchmark(name: str) -> str:
    """`benchmarks/test_MODEL.py::test_WHAT[CASE]` as `MODEL WHAT CASE`."""
    return " ".join(re.split(r"/test_|\.py::test_|[\[\]]", name)[1:]).strip()


def stored_files(source: str, folder: Path) -> list[Path]:
    """Files that a source is read from; none for what the package itself tells."""
    from vehiclemor.registry import names

    kind, _, model = source.partition(" ")
    if kind in ("operations", "published"):
        return []
    if kind in FILES:
        return [folder / FILES[kind]]
    studies = [source]
    if kind == "costs":
        studies = [f"timing-{model}"]
    elif kind == "sizes":
        studies = [model]
    elif kind in PROTOCOLS:
        studies = [f"{kind}-{name}" for name in names("model")]
    return [folder / "studies" / f"{study}.nc" for study in studies]


def origin(source: str, dataset: xr.Dataset, files: list[Path]) -> dict[str, str]:
    """What gave the numbers of a source, and when."""
    from vehiclemor.provenance import machine, versions

    kind = source.partition(" ")[0]
    commands = {"costs": "vehiclemor compare", "benchmark": "tox -e bench", "published": ""}
    commands |= {
        "operations": "python paper/regenerate.py",
        "predictive": "vehiclemor compare predictive",
        "contenders": "vehiclemor compare contenders",
        "sizes": "vehiclemor compare size",
    }
    commands |= {kind: f"python paper/{kind}.py" for kind in SCRIPTS}
    written = max((path.stat().st_mtime for path in files), default=None)
    when = datetime.now(UTC) if written is None else datetime.fromtimestamp(written, UTC)
    return {
        "results": source,
        "command": commands.get(kind, f"vehiclemor run {source}"),
        "date": when.date().isoformat(),
        "commit": _commit(),
        "kernels": str(dataset.attrs.get("kernel_hash", "")),
        "versions": str(dataset.attrs.get("versions", versions())),
        "machine": str(dataset.attrs.get("machine", machine())),
    }


def _commit() -> str:
    """Last commit that changed the source, marked if there are changes beyond it."""
    git = shutil.which("git")
    if git is None:
        return ""

    def answer(*arguments: str) -> str:
        command = [git, "-C", str(ROOT), *arguments, "--", "src", "data"]
        run = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - fixed words
        return run.stdout.strip()

    return answer("log", "-1", "--format=%h") + ("+" if answer("status", "--porcelain") else "")


def stored_facts() -> dict[str, dict[str, dict[str, Any]]]:
    """What `facts.json` holds: `sources` and `facts`."""
    if not FACTS.exists():
        return {"sources": {}, "facts": {}}
    return json.loads(FACTS.read_text(encoding="utf-8"))


def measure(folder: Path, jobs: int, stored_only: bool) -> list[str]:
    """Measure what the texts state, keep it, write it into the texts; what stays as it was."""
    declared, known = manifest(), stored_facts()
    numbers = list(printed_numbers(declared))
    datasets: dict[str, xr.Dataset] = {}
    origins: dict[str, dict[str, str]] = {}
    stale: list[str] = []
    for name in dict.fromkeys(s for number in numbers for s in sources_of(number.expression)):
        source = declared.sources[name]
        files = stored_files(source, folder)
        if stored_only and not all(path.exists() for path in files):
            old = known["sources"].get(name, {})
            stale.append(f"{source}: not in {folder}; of {old.get('date')}, {old.get('commit')}")
            origins |= {name: old} if old else {}
            continue
        datasets[name] = load(source, folder, jobs)
        origins[name] = origin(source, datasets[name], files)
    facts: dict[str, dict[str, Any]] = {}
    for number in numbers:
        if set(sources_of(number.expression)) <= set(datasets):
            value, unit = evaluate(number.expression, datasets)
            facts[number.expression] = {"value": float(f"{value:.6g}"), "unit": unit}
        elif number.expression in known["facts"]:
            facts[number.expression] = known["facts"][number.expression]
    for file in dict.fromkeys(number.file for number in numbers):
        new = [
            (number, rendered(facts[number.expression]["value"], number.form))
            for number in numbers
            if number.file == file and number.expression in facts
        ]
        text = (ROOT / file).read_text(encoding="utf-8")
        write_text(ROOT / file, rewritten(text, new))
    write_text(FACTS, _lines({"sources": origins, "facts": facts}))
    return stale


def _lines(content: dict[str, dict[str, Any]]) -> str:
    """JSON with a line for each entry, so that a difference shows what has changed."""
    parts = []
    for name, entries in content.items():
        lines = [f"  {json.dumps(key)}: {json.dumps(entries[key])}" for key in sorted(entries)]
        parts.append(f"{json.dumps(name)}: {{\n" + ",\n".join(lines) + "\n}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


def main() -> int:
    """Measure and write; wrong input is one line and exit status 2."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--results", type=Path, default=Path("results"), help="results folder")
    parser.add_argument("--jobs", type=int, default=1, help="processes for missing studies")
    parser.add_argument("--stored", action="store_true", help="run nothing that is missing")
    arguments = parser.parse_args()
    try:
        for line in measure(arguments.results, arguments.jobs, arguments.stored):
            print("stale:", line)
    except VehiclemorError as error:
        print(f"facts: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
