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

from vehiclemor.exceptions import InputError
from vehiclemor.exporting.c import DRIVER, SOURCES, c_files
from vehiclemor.exporting.model_description import COMPILED, UNIT, model_description
from vehiclemor.exporting.system import ExportedSystem

_LOG = logging.getLogger("vehiclemor")
# Platform -> folder of its binaries, and ending of its shared libraries.
BINARIES = {
    "Linux": ("linux64", ".so"),
    "Darwin": ("darwin64", ".dylib"),
    "Windows": ("win64", ".dll"),
}
OPTIMISED = ("-std=c99", "-O2", "-ffp-contract=off")
# Files in an archive are equal if their content is.
LONG_AGO = (1980, 1, 1, 0, 0, 0)


def fmu_files(system: ExportedSystem, step: float) -> dict[str, bytes]:
    """Path in the archive -> content, with the integrator's step in s; a binary if it compiles."""
    texts = {name: text for name, text in c_files(system, step).items() if name != DRIVER}
    texts[UNIT] = (SOURCES / UNIT).read_text(encoding="utf-8")
    token = hashlib.sha256("".join(texts.values()).encode()).hexdigest()[:32]
    texts["vehiclemor_token.h"] = f'#define VEHICLEMOR_TOKEN "{token}"\n'
    files = {f"sources/{name}": text.encode() for name, text in texts.items()}
    files["modelDescription.xml"] = model_description(system, token)
    binary = shared_library(texts)
    if binary is not None:
        kind = platform.system()
        folder, ending = BINARIES.get(kind, (f"{kind.lower()}64", ".so"))
        files[f"binaries/{folder}/{system.name}{ending}"] = binary
    return files


def write_archive(files: dict[str, bytes], path: Path) -> None:
    """Write an archive, the model description first."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(files, key=lambda name: (name != "modelDescription.xml", name)):
            archive.writestr(zipfile.ZipInfo(name, LONG_AGO), files[name], zipfile.ZIP_DEFLATED)


def shared_library(texts: dict[str, str]) -> bytes | None:
    """Machine code of C sources, none without a compiler; `InputError` if the compiler fails."""
    command = shutil.which(os.environ.get("CC", "cc"))
    if command is None:
        _LOG.warning("no C compiler (cc, or the variable CC): the unit has sources, but no binary")
        return None
    with tempfile.TemporaryDirectory() as folder:
        for name, text in texts.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        options = [*OPTIMISED, "-fPIC", "-shared", "-fvisibility=hidden", "-o", "library"]
        command_line = [command, *options, *COMPILED, "-lm"]
        done = subprocess.run(  # noqa: S603  (what the user calls the compiler)
            command_line, cwd=folder, capture_output=True, text=True, check=False
        )
        if done.returncode:
            lines = [line for line in done.stderr.splitlines() if "error" in line]
            first = next(iter(lines), f"status {done.returncode}")
            raise InputError(f"{command} can't compile the model: {first}")
        return (Path(folder) / "library").read_bytes()
