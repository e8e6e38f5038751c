"""C99 source of a system: no allocation, no state between calls, arrays of the caller."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from vehiclemor.codegen.operations import COMPARISONS, uses
from vehiclemor.exporting.straight_line import FUNCTIONS, StraightLine
from vehiclemor.exporting.systems import SIGNATURES, TANGENTS, TOOL, ExportedSystem

SOURCES = Path(__file__).parent / "c_sources"
SELECT = """\
static double select(int test, double then, double otherwise)
{
    return test ? then : otherwise;
}"""
ENTRY = """\
static double entry(double row, int place)
{
    return vehiclemor_table[(long)row + place];
}"""
# Kind of operation -> how C writes it.
FORMS = {
    **{kind: f"{kind}({{}})" for kind in FUNCTIONS},
    **{sign: f"({{}} {sign} {{}})" for sign in COMPARISONS},
    "add": "({} + {})",
    "subtract": "({} - {})",
    "multiply": "({} * {})",
    "divide": "({} / {})",
    "negate": "(-{})",
    "abs": "fabs({})",
    "atan2": "atan2({}, {})",
    "max": "fmax({}, {})",
    "min": "fmin({}, {})",
    "power": "pow({}, {})",
    "select": "select({}, {}, {})",
    "table": "entry({}, {})",
}
# Expressions that are written are less deep; of a longer one the inside gets a name.
SHALLOW = 12
# Of parameters on which no function depends; all are listed.
START_ALONE = "of the start alone, no effect here"
HEADER, MODEL, TANGENT = "vehiclemor_model.h", "vehiclemor_model.c", "vehiclemor_tangent.c"
STEPPER, DRIVER = "vehiclemor_step.c", "vehiclemor_driver.c"


def c_files(system: ExportedSystem, step: float) -> dict[str, str]:
    """Name -> text of the files of a system; the header names a step size in s."""
    shipped = {name: (SOURCES / name).read_text(encoding="utf-8") for name in (STEPPER, DRIVER)}
    values = [_array("parameters", system.values)]
    values += [_array(_start(name), state) for name, state in system.starts.items()]
    tangents = {f"{name}_tangent": function for name, function in system.tangents().items()}
    return {
        HEADER: _header(system, step),
        MODEL: _source(system, "its functions", values, system.functions),
        TANGENT: _source(system, "derivatives of its functions", [], tangents),
    } | shipped


def _header(system: ExportedSystem, step: float) -> str:
    def listed(title: str, quantities: Sequence) -> list[str]:
        rows = [
            f"     {i:3d}  {q.name} ({q.unit}): {q.long_name}" for i, q in enumerate(quantities)
        ]
        return [f"   {title}:", *rows]

    sizes = system.sizes
    parameters = [
        q if i in system.acting else replace(q, long_name=f"{q.long_name}; {START_ALONE}")
        for i, q in enumerate(system.parameters)
    ]
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
        f"   Written by {TOOL}.",
        "",
        *listed("States x", system.states),
        *listed("Inputs u", system.inputs),
        *listed("Outputs y", system.outputs),
        *listed("Parameters p", parameters),
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
        "/* Constants c follow from the parameters p: needed once, and whenever p changes. */",
        *(f"{_signature(name)};" for name in SIGNATURES),
        "",
        "/* What their results change by where the arguments change by seeds. */",
        *(f"{_signature(name)};" for name in TANGENTS),
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


def _signature(name: str) -> str:
    *given, result = (SIGNATURES | TANGENTS)[name]
    arguments = ", ".join(f"const double *{argument}" for argument in given)
    return f"void vehiclemor_{name}({arguments}, double *{result})"


def _source(
    system: ExportedSystem,
    what: str,
    parts: Sequence[str],
    functions: Mapping[str, StraightLine],
) -> str:
    """Text of a file of functions, after other parts."""
    texts = [_function(name, function) for name, function in functions.items()]
    called = "\n".join(texts)
    helpers = [SELECT] if "select(" in called else []
    if "entry(" in called:
        helpers += [f"static {_array('table', system.table)}", ENTRY]
    head = f"/* {system.name}: {what}, written by {TOOL}. */"
    included = f'#include <math.h>\n\n#include "{HEADER}"'
    return "\n\n".join([head, included, *parts, *helpers, *texts]) + "\n"


def _array(name: str, values: np.ndarray) -> str:
    numbers = [repr(value) for value in values.tolist()] or ["0.0"]
    rows = [", ".join(numbers[i : i + 4]) for i in range(0, len(numbers), 4)]
    body = ",\n    ".join(rows)
    return f"{_declared(name, len(values))} = {{\n    {body}\n}};"


def _function(name: str, function: StraightLine) -> str:
    """Definition of a function."""
    *given, result = (SIGNATURES | TANGENTS)[name]
    operations, counts = function.operations, uses(function.operations)
    texts: dict[int, str] = {}
    depths: dict[int, int] = {}
    lines = [_signature(name), "{"]
    for number in function.needed:
        kind, numbers, detail = operations[number]
        depth = 1 + max((depths[n] for n in numbers), default=-1)
        if kind == "number":
            text = repr(detail) if detail >= 0.0 else f"({detail!r})"
        elif kind == "entry":
            text = f"{detail[0]}[{detail[1]}]"
        else:
            text = FORMS[kind].format(*(texts[n] for n in numbers), detail)
            # What is used more than once has a name.
            if counts[number] > 1 or depth > SHALLOW:
                lines.append(f"    const double v{number} = {text};")
                text, depth = f"v{number}", 0
        texts[number], depths[number] = text, depth
    lines += [f"    {result}[{i}] = {texts[n]};" for i, n in enumerate(function.results)]
    text = "\n".join(lines)
    # What is not read is said so, for compilers that ask.
    unread = [a for a in (*given, result) if f" {a}[" not in text and f"({a}[" not in text]
    return "\n".join([text, *(f"    (void){argument};" for argument in unread), "}"])
