"""Functional mock-up units: model description, sources, and a binary for this platform.

`modelDescription.xml` is by the schema of FMI 2.0.  Value references count time, states, their
derivatives, inputs, outputs and parameters, as `vehiclemor_fmi2.c` does.
"""

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
from typing import NamedTuple

from vehiclemor.exceptions import InputError
from vehiclemor.exporting.c import (
    DRIVER,
    MODEL,
    SOURCES,
    STEPPER,
    TANGENT,
    c_files,
    written,
)
from vehiclemor.exporting.systems import CSettings, ExportedSystem

_LOG = logging.getLogger("vehiclemor")
# Platform -> folder of its binaries, and ending of its shared libraries.
BINARIES = {
    "Linux": ("linux64", ".so"),
    "Darwin": ("darwin64", ".dylib"),
    "Windows": ("win64", ".dll"),
}
OPTIMISED = ("-std=c99", "-O2", "-ffp-contract=off")
# Files that a binary is compiled of, the interface first.
UNIT = "vehiclemor_fmi2.c"
COMPILED = UNIT, MODEL, TANGENT, STEPPER
# What an importer proposes, in s.
STOP, COMMUNICATION = 10.0, 0.01
# Files in an archive are equal if their content is.
LONG_AGO = (1980, 1, 1, 0, 0, 0)


def fmu_files(system: ExportedSystem, settings: CSettings) -> dict[str, bytes]:
    """Path in the archive -> content; a binary if it compiles."""
    texts = {name: text for name, text in c_files(system, settings).items() if name != DRIVER}
    texts[UNIT] = (SOURCES / UNIT).read_text(encoding="utf-8")
    token = hashlib.sha256("".join(texts.values()).encode()).hexdigest()[:32]
    texts["vehiclemor_token.h"] = f'#define VEHICLEMOR_TOKEN "{token}"\n'
    files = {f"sources/{name}": text.encode() for name, text in texts.items()}
    files["modelDescription.xml"] = model_description(system, token, settings.step)
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


class Variable(NamedTuple):
    """A variable of an FMU; `derivative_of` is the value reference of a derivative's state."""

    name: str
    unit: str
    description: str
    causality: str
    variability: str
    initial: str = ""
    start: float | None = None
    derivative_of: int | None = None


def variables_of(system: ExportedSystem) -> dict[int, Variable]:
    """Variables by value reference, in order; without parameters that nothing depends on."""
    start = next(iter(system.starts.values()))
    of_states = "local", "continuous"
    variables = [Variable("time", "s", "time", "independent", "continuous")]
    for q, value in zip(system.states, start.tolist(), strict=True):
        variables.append(
            Variable(f"state.{q.name}", q.unit, q.long_name, *of_states, "exact", value)
        )
    for reference, q in enumerate(system.states, 1):
        named = f"der(state.{q.name})", f"{q.unit}/s", f"rate of: {q.long_name}"
        variables.append(Variable(*named, *of_states, "calculated", None, reference))
    variables += [
        Variable(q.name, q.unit, q.long_name, "input", "continuous", "", q.default or 0.0)
        for q in system.inputs
    ]
    variables += [
        Variable(q.name, q.unit, q.long_name, "output", "continuous", "calculated")
        for q in system.outputs
    ]
    by_reference, first = dict(enumerate(variables)), len(variables)
    for number in sorted(system.acting):
        q, value = system.parameters[number], float(system.values[number])
        name = f"parameter.{q.name}"
        by_reference[first + number] = Variable(
            name, q.unit, q.long_name, "parameter", "tunable", "exact", value
        )
    return by_reference


def model_description(system: ExportedSystem, token: str, step: float) -> bytes:
    """The file, with the integrator's step in s.

    By the token an importer's file and binary know one another.
    """
    every = variables_of(system)
    outputs = [i for i, v in every.items() if v.causality == "output"]
    rates = [i for i, v in every.items() if v.derivative_of is not None]
    text = written(
        "modelDescription.xml",
        system=system,
        token=token,
        sources=COMPILED,
        stop=STOP,
        exchange=max(COMMUNICATION, step),
        variables=every,
        unknowns={
            "Outputs": outputs,
            "Derivatives": rates,
            "InitialUnknowns": sorted(outputs + rates),
        },
    )
    return text.rstrip().encode()
