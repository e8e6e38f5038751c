"""Where a result comes from: versions, machine, and the source that computed it."""

import hashlib
import inspect
import os
import platform
import sys
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import ModuleType

from vehiclemor.registry import component

PACKAGES = ("vehiclemor", "numpy", "scipy", "sympy", "numba", "xarray", "netCDF4")
# Layers whose source determines results; tables, figures and the command line come after them.
LAYERS = ("models", "symbolic", "codegen", "simulation", "reduction")
FILES = ("parameters.py", "maneuvers.py", "metrics.py", "study/execution.py")


@cache
def versions() -> str:
    """Versions of Python and of the packages that take part, as one line."""
    found = [f"Python {platform.python_version()}"]
    for package in PACKAGES:
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            found.append(f"{package} (not installed)")
    return ", ".join(found)


@cache
def machine() -> str:
    """Processor, number of cores and operating system, as one line."""
    name = platform.processor() or platform.machine()
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                name = line.split(":", 1)[1].strip()
                break
    except OSError:
        pass
    return f"{name}, {os.cpu_count()} cores, {platform.system()} {platform.release()}"


@cache
def code_digest(model: str, method: str) -> str:
    """Hash of the source that computes a cell.

    These are the layers of this package and, for a plug-in, all of its top-level package and its
    version.  Results computed by other source are never taken for finished cells.
    """
    package = Path(__file__).resolve().parents[1]
    paths = [path for layer in LAYERS for path in sorted((package / layer).rglob("*.py"))]
    paths += [package / name for name in FILES]
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.relative_to(package).as_posix().encode())
        digest.update(path.read_bytes())
    for kind, name in (("model", model), ("method", method)):
        for text in _plug_in_source(component(kind, name)):
            digest.update(text)
    return digest.hexdigest()[:16]


def _plug_in_source(thing: object) -> list[bytes]:
    """Source texts of the package, or single file, that a component comes from."""
    module = thing if isinstance(thing, ModuleType) else inspect.getmodule(thing)
    if module is None:
        module = inspect.getmodule(type(thing))
    if module is None or module.__file__ is None:
        return [repr(thing).encode()]
    top = module.__name__.split(".")[0]
    if top == "vehiclemor":
        return []
    origin = getattr(sys.modules.get(top), "__file__", None)
    if origin is None or Path(origin).name != "__init__.py":
        return [Path(module.__file__).read_bytes()]
    return [path.read_bytes() for path in sorted(Path(origin).parent.rglob("*.py"))]
