"""Where a result comes from: versions, machine, and the source that computed it."""

import os
import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from vehiclemor.codegen.sources import plug_in_digest, source_digest
from vehiclemor.registry import component

PACKAGES = ("vehiclemor", "numpy", "scipy", "sympy", "numba", "xarray", "netCDF4")
# Layers whose source determines results; tables, figures and the command line come after them.
LAYERS = ("multibody", "symbolic", "codegen", "inputs", "simulation", "reduction")
FILES = (
    "parameters.py",
    "error_measures.py",
    "study/scenario.py",
    "study/experiment.py",
    "failure.py",
    "study/evaluate.py",
    "study/result.py",
)


@cache
def versions() -> str:
    """Versions of Python and of the packages that take part, as one line."""
    return ", ".join([f"Python {platform.python_version()}", *map(_version, PACKAGES)])


def _version(package: str) -> str:
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        return f"{package} (not installed)"


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


def attributes(title: str, kernel_hash: str, **further: object) -> dict[str, object]:
    """Global attributes of every result file."""
    return {
        "Conventions": "CF-1.11",
        "title": title,
        "source": "vehiclemor",
        "references": "doi:10.1115/1.4029390",
        "kernel_hash": kernel_hash,
        "versions": versions(),
        "machine": machine(),
        **further,
    }


@cache
def _own_source() -> str:
    return source_digest(LAYERS, FILES)


def code_digest(model: str, method: str) -> str:
    """Hash of the source that computes a result: results of other source are never taken for it.

    These are the layers of this package and, for a plug-in, all of its top-level package; and the
    versions of the packages that the method declares.
    """
    used = component("method", method)
    plug_ins = plug_in_digest((component("model", model), used))
    return " ".join([_own_source(), plug_ins, *map(_version, used.packages)])


@cache
def layout_digest() -> str:
    """Hash of the source that combines runs: after a change datasets are combined again."""
    return source_digest((), ("study/plans/results.py", "study/result.py"))
