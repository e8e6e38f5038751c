"""Functional mock-up units: model description, sources, and a binary for this platform."""

from __future__ import annotations

import hashlib
import logging
import os
import platform
import shutil
import subprocess
import tempfile
import zipfile
from pathlib import Path
from xml.etree import ElementTree

from vehiclemor.errors import InputError
from vehiclemor.exporting.c import DRIVER, SOURCES, c_files
from vehiclemor.exporting.model_description import identifier, model_description, sources
from vehiclemor.exporting.system import ExportedSystem

_LOG = logging.getLogger("vehiclemor")
# The system's name of a compiler -> ending of its shared libraries.
ENDINGS = {"Linux": ".so", "Darwin": ".dylib", "Windows": ".dll"}
MACHINES = {"AMD64": "x86_64", "arm64": "aarch64"}
OPTIMISED = ("-std=c99", "-O2", "-ffp-contract=off")
# Files in an archive are equal if their content is.
LONG_AGO = (1980, 1, 1, 0, 0, 0)


def fmu_files(system: ExportedSystem, step: float, fmi: int) -> dict[str, bytes]:
    """Path in the archive -> content; without a binary where there is no compiler.

    Parameters
    ----------
    step
        Of the integrator inside, in s.
    fmi
        2 or 3.
    """
    texts = {name: text for name, text in c_files(system, step).items() if name != DRIVER}
    for name in ("vehiclemor_fmu.h", f"vehiclemor_fmi{fmi}.c"):
        texts[name] = (SOURCES / name).read_text(encoding="utf-8")
    token = hashlib.sha256("".join(texts.values()).encode()).hexdigest()[:32]
    texts["vehiclemor_token.h"] = f'#define VEHICLEMOR_TOKEN "{token}"\n'
    files = {f"sources/{name}": text.encode() for name, text in texts.items()}
    files["modelDescription.xml"] = model_description(system, token, step, fmi)
    if fmi == 3:
        files["sources/buildDescription.xml"] = _build_description(system)
    binary = shared_library(texts, sources(fmi))
    if binary is not None:
        files[binary_path(system, fmi)] = binary
    return files


def write_archive(files: dict[str, bytes], path: Path) -> None:
    """Write an archive, the model description first."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(files, key=lambda name: (name != "modelDescription.xml", name)):
            archive.writestr(zipfile.ZipInfo(name, LONG_AGO), files[name], zipfile.ZIP_DEFLATED)


def binary_path(system: ExportedSystem, fmi: int) -> str:
    """Where the binary for this platform stands in the archive."""
    kind, machine = platform.system(), platform.machine()
    machine = MACHINES.get(machine, machine)
    folder = f"{machine}-{kind.lower()}"
    if fmi == 2:
        folder = {"Linux": "linux", "Darwin": "darwin", "Windows": "win"}.get(kind, kind) + "64"
    return f"binaries/{folder}/{identifier(system)}{ENDINGS.get(kind, '.so')}"


def compiler() -> str | None:
    """The system's C compiler, or that of the variable CC; none if there is none."""
    return shutil.which(os.environ.get("CC", "cc"))


def shared_library(texts: dict[str, str], compiled: tuple[str, ...]) -> bytes | None:
    """Machine code of C sources; none where there is no compiler.

    Raises
    ------
    InputError
        If the compiler fails.
    """
    command = compiler()
    if command is None:
        _LOG.warning("no C compiler (cc, or the variable CC): the unit has sources, but no binary")
        return None
    with tempfile.TemporaryDirectory() as folder:
        for name, text in texts.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        options = [*OPTIMISED, "-fPIC", "-shared", "-fvisibility=hidden", "-o", "library"]
        command_line = [command, *options, *compiled, "-lm"]
        done = subprocess.run(  # noqa: S603  (what the user calls the compiler)
            command_line, cwd=folder, capture_output=True, text=True, check=False
        )
        if done.returncode:
            lines = [line for line in done.stderr.splitlines() if "error" in line]
            first = next(iter(lines), f"status {done.returncode}")
            raise InputError(f"{command} can't compile the model: {first}")
        return (Path(folder) / "library").read_bytes()


def _build_description(system: ExportedSystem) -> bytes:
    root = ElementTree.Element("fmiBuildDescription", fmiVersion="3.0")
    build = ElementTree.SubElement(root, "BuildConfiguration", modelIdentifier=identifier(system))
    files = ElementTree.SubElement(build, "SourceFileSet", language="C99")
    for name in sources(3):
        ElementTree.SubElement(files, "SourceFile", name=name)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)
