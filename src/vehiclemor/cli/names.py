"""Registered names, their declarations, citations, and a template of a plug-in."""

import json
import os
import re
from importlib.util import find_spec
from keyword import iskeyword
from pathlib import Path
from typing import Any, Literal

from vehiclemor import api
from vehiclemor.cli.options import All, Json
from vehiclemor.exceptions import FileError, InputError
from vehiclemor.files import data_folder, data_names, write_whole
from vehiclemor.registry import GROUPS, names
from vehiclemor.report.printing import Table, wrapped

KINDS = ("models", "methods", "maneuvers", "studies")
# A longer name has its text right behind it.
LONGEST = 30
# Rows of a table that are printed without --all, where it has some more.
FEW, SOME = 4, 6
# Columns of nothing else are left out.
EMPTY = ("", None, [], {})


def list_components(
    what: Literal["models", "methods", "maneuvers", "studies"] | None = None,
    *,
    json_output: Json = False,
) -> None:
    """List what is registered.

    Parameters
    ----------
    what
        One kind; all by default.
    """
    listed = {kind: getattr(api, kind)() for kind in KINDS if what in (None, kind)}
    if json_output:
        print(json.dumps(listed if what is None else listed[what], indent=2))
        return
    # A table of rich would take a tenth of the time of this command.
    for kind, entries in listed.items():
        print(f"{kind}:")
        column = min(max(map(len, entries)), LONGEST)
        for name, summary in entries.items():
            print(wrapped(f"{name.ljust(column)}  {summary}", 2, column + 4))
        print()
    print(wrapped("vehiclemor show NAME says more, show study-schema how to write a study", 0, 2))


def show(name: str, *, every: All = False, json_output: Json = False) -> None:
    """Show what a name declares: parameters, settings, inputs, outputs, grid.

    Parameters
    ----------
    name
        A model, method, maneuver or study, a study's TOML file, or study-schema,
        parameter-schema: the keys of such a file.
    every
        Print all rows of long tables of a model, not only the first ones.
    """
    described = api.describe(name)
    if json_output:
        print(json.dumps(described, indent=2))
        return
    few = name in api.models() and not every
    cut = sum([_print(key, content, few) for key, content in described.items()])
    if cut:
        print(f"\n{cut} more rows: vehiclemor show {name} --all")


def _print(key: str, content: Any, few: bool, indent: str = "") -> int:
    """Print a table of rows, lines below a heading, or a line; how many rows are left out."""
    if isinstance(content, dict):
        print(f"\n{key}:")
        return sum([_print(name, part, few, "  ") for name, part in content.items()])
    if not (isinstance(content, list) and content and isinstance(content[0], dict)):
        if content:
            text = ", ".join(map(str, content)) if isinstance(content, list) else content
            print(wrapped(f"{key}: {text}", len(indent), len(indent) + 2))
        return 0
    shown = content[:FEW] if few and len(content) > SOME else content
    cut = len(content) - len(shown)
    for heading, rows in _by_source(key, shown).items():
        columns = [name for name in rows[0] if any(row[name] not in EMPTY for row in rows)]
        more = f" ({len(shown)} of {len(content)})" if cut else ""
        print(f"\n{wrapped(f'{heading}{more}:', 0, 2)}\n{Table(rows, columns, explain=False)}")
    return cut


def _by_source(key: str, rows: list[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Heading -> rows: a source stands in the heading of its rows, since columns would not fit."""
    by_heading: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        heading, columns = key, dict(row)
        if "status" in row:
            heading = f"{key}, {columns.pop('status')} ({columns.pop('source')})"
        by_heading.setdefault(heading, []).append(columns)
    return by_heading


def cite() -> None:
    """Print how to cite this suite, the paper, and the methods that have a reference."""
    from vehiclemor.report.published import citations

    print(citations())


# A package that works as it stands: its name is replaced by the new one wherever it is written.
TEMPLATE = "quarter_car"
NAME = re.compile(r"[a-z]([a-z0-9_]{0,38}[a-z0-9])?")


def new_plugin(name: str, *, out: Path | None = None) -> None:
    """Write a plug-in to begin with: a model, a maneuver, a method, studies, tests.

    Parameters
    ----------
    name
        Of the package and its model; its maneuver is NAME_road, its method NAME_modes.
    out
        New folder; NAME_plugin here by default.
    """
    if not NAME.fullmatch(name) or iskeyword(name):
        raise InputError(
            f"{name!r} can't name a Python package: at most 40 small letters, digits and "
            "underscores, a letter first, no word of Python"
        )
    # Without an origin it is any folder that happens to be here.
    package = getattr(find_spec(name), "origin", None) is not None
    known = {kind: set(names(kind)) for kind in GROUPS}
    known |= {"study": set(data_names("studies")), "Python package": {name} if package else set()}
    for kind, taken in known.items():
        for double in {name, f"{name}_road", f"{name}_modes"} & taken:
            raise InputError(f"{name}: there is a {kind} {double} already")
    folder = Path(f"{name}_plugin") if out is None else out
    if os.path.lexists(folder):
        raise FileError(f"{folder} exists: it is not replaced")
    if not folder.absolute().parent.is_dir():
        raise FileError(f"{folder}: the folder {folder.parent} does not exist")
    write_whole(folder, lambda temporary: _write(temporary, name))
    print(f"written: {folder}, a package that works as it stands; to install and try it:\n")
    print(f"  pip install -e {folder} pytest")
    print(f"  pytest {folder}")
    print(f"  vehiclemor simulate {name} --method {name}_modes --frequency 1.2\n")
    print("Further steps: vehiclemor show parameter-schema, vehiclemor show study-schema")


def _write(folder: Path, name: str) -> None:
    template = data_folder() / "plugin_template"
    for path in template.rglob("*"):
        if path.suffix in (".py", ".toml"):
            text = path.read_text(encoding="utf-8")
            text = text.replace(TEMPLATE.replace("_", "-"), name.replace("_", "-"))
            file = folder / path.relative_to(template).as_posix().replace(TEMPLATE, name)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text.replace(TEMPLATE, name), encoding="utf-8")
