"""A plug-in as an installer registers it: neither a network nor a build is needed."""

import os
import sys
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from vehiclemor import registry

ENTRIES = 'project.entry-points."vehiclemor.methods"'


def package(folder: Path, **methods: str) -> Path:
    """A folder, now also of a plug-in with these methods: name -> `module:attribute`."""
    entries = "".join(f'{name} = "{value}"\n' for name, value in methods.items())
    text = f'[project]\nname = "example"\nversion = "1"\n[{ENTRIES}]\n{entries}'
    (folder / "pyproject.toml").write_text(text)
    return folder


@contextmanager
def registered(kind: str, name: str, value: str) -> Iterator[None]:
    """One more component of a kind in this process, by its entry point `module:attribute`."""
    entries, added = registry._entries, EntryPoint(name, value, registry.GROUPS[kind])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            registry, "_entries", lambda of: entries(of) | ({name: added} if of == kind else {})
        )
        yield


@contextmanager
def installed(source: Path) -> Iterator[None]:
    """The package in a folder as `pip install -e` would register it, for new processes too."""
    project = tomllib.loads((source / "pyproject.toml").read_text())["project"]
    distribution, version = project["name"].replace("-", "_"), project["version"]
    site = source / "site"
    written = site / f"{distribution}-{version}.dist-info"
    written.mkdir(parents=True)
    (written / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {version}\n"
    )
    lines, packages = [], set()
    for group, entries in project["entry-points"].items():
        lines += [f"[{group}]", *(f"{key} = {value}" for key, value in entries.items())]
        packages |= {value.partition(".")[0] for value in entries.values()}
    (written / "entry_points.txt").write_text("\n".join(lines))
    with pytest.MonkeyPatch.context() as patch:
        for folder in (source, site):
            patch.syspath_prepend(folder)
        patch.setenv("PYTHONPATH", os.pathsep.join([str(source), str(site)]))
        registry._entries.cache_clear()
        yield
    registry._entries.cache_clear()
    # The next one of that name stands in another folder.
    for module in [name for name in sys.modules if name.partition(".")[0] in packages]:
        del sys.modules[module]
