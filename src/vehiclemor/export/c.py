"""C99 source of a system: no allocation, no state between calls, arrays of the caller."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vehiclemor import __version__
from vehiclemor.export.straight_line import StraightLine
from vehiclemor.export.system import ExportedSystem

SOURCES = Path(__file__).parent / "c_sources"
# Function -> names of its arguments, in order, and of its result.
SIGNATURES = {"constants": ("p", "c"), "derivative": ("x", "u", "c", "dx")}
SIGNATURES["outputs"] = ("x", "u", "c", "y")
STEPPER, DRIVER = "vehiclemor_step.c", "vehiclemor_driver.c"


def c_files(system: ExportedSystem, step: float) -> dict[str, str]:
    """Name -> text of the files of a system.

    Parameters
    ----------
    step
        Step size in s that the header names.
    """
    shipped = {name: (SOURCES / name).read_text(encoding="utf-8") for name in (STEPPER, DRIVER)}
    return {"vehiclemor_model.h": _header(system, step), "vehiclemor_model.c": _model(system)} | (
        shipped
    )


def _header(system: ExportedSystem, step: float) -> str:
    def listed(title: str, quantities: Sequence) -> list[str]:
        rows = [f"     {i:3d}  {q.name} ({q.unit}): {q.long_name}" for i, q in enumerate(quantities)]
        return [f"   {title}:", *rows]

    sizes = system.sizes
    counts = {
        "STATES": sizes["x"],
        "INPUTS": sizes["u"],
        "OUTPUTS": len(system.outputs),
        "PARAMETERS": sizes["p"],
        "CONSTANTS": sizes["c"],
    }
    starts = list(system.starts)
    states = [_declared(_start(name), sizes["x"]) for name in starts]
    lines = [
        f"/* {system.name}: {system.summary}.",
        f"   Written by vehiclemor {__version__}.",
        "",
        *listed("States x", system.states),
        *listed("Inputs u", system.inputs),
        *listed("Outputs y", system.outputs),
        *listed("Parameters p", system.parameters),
        f"   Starts: {', '.join(starts)} */",
        "",
        "#ifndef VEHICLEMOR_MODEL_H",
        "#define VEHICLEMOR_MODEL_H",
        "",
        "/* Sizes; an array in C holds one number at least. */",
        *(f"#define VEHICLEMOR_{name} {count}" for name, count in counts.items()),
        "#define VEHICLEMOR_FLOATS(count) ((count) > 0 ? (count) : 1)",
        "",
        "/* Step size in s at which vehiclemor_step is stable and accurate. */",
        f"#define VEHICLEMOR_STEP {step!r}",
        "",
        *(f"extern {declared};" for declared in (_declared("parameters", sizes["p"]), *states)),
        f"#define vehiclemor_start vehiclemor_{_start(starts[0])}",
        "",
        "/* Constants c that follow from the parameters p: call it once, and whenever p changes. */",
        *(f"void vehiclemor_{name}({_arguments(name)});" for name in SIGNATURES),
        "",
        "/* Take x over a step of h seconds; inputs are linear from u to u_end, which may be u. */",
        "void vehiclemor_step(double *x, const double *u, const double *u_end, const double *c,",
        "                     double h);",
        "",
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def _declared(name: str, size: int) -> str:
    return f"const double vehiclemor_{name}[{max(size, 1)}]"


def _start(name: str) -> str:
    return f"start_{name}"


def _arguments(name: str) -> str:
    *given, result = SIGNATURES[name]
    return ", ".join([*(f"const double *{argument}" for argument in given), f"double *{result}"])


def _model(system: ExportedSystem) -> str:
    parts = [
        f"/* {system.name}: straight-line functions, written by vehiclemor {__version__}. */",
        '#include <math.h>\n\n#include "vehiclemor_model.h"',
        _array("parameters", system.values),
        *(_array(_start(name), state) for name, state in system.starts.items()),
    ]
    functions = {name: c_function(name, system.functions[name]) for name in SIGNATURES}
    if any("select(" in text for text in functions.values()):
        parts.append(
            "static double select(int test, double then, double otherwise)\n"
            "{\n    return test ? then : otherwise;\n}"
        )
    return "\n\n".join([*parts, *functions.values()]) + "\n"


def _array(name: str, values: np.ndarray) -> str:
    numbers = [repr(value) for value in values.tolist()] or ["0.0"]
    rows = [", ".join(numbers[i : i + 4]) for i in range(0, len(numbers), 4)]
    body = ",\n    ".join(rows)
    return f"{_declared(name, len(values))} = {{\n    {body}\n}};"


def c_function(name: str, function: StraightLine) -> str:
    """Definition of a function; arithmetic is written alike in C and Python."""
    *given, result = SIGNATURES[name]
    lines = [f"void vehiclemor_{name}({_arguments(name)})", "{"]
    lines += [
        f"    const double {name} = {ast.unparse(expression)};"
        for name, expression in function.assignments.items()
    ]
    lines += [
        f"    {result}[{i}] = {ast.unparse(expression)};"
        for i, expression in enumerate(function.results)
    ]
    text = "\n".join(lines)
    # What is not read is said so, for compilers that ask.
    unread = [a for a in (*given, result) if f"{a}[" not in text]
    return "\n".join([text, *(f"    (void){argument};" for argument in unread), "}"])
