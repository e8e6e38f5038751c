"""C99 source of a system: no allocation, no state between calls, arrays of the caller."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vehiclemor.codegen.operations import COMPARISONS, uses
from vehiclemor.exporting.ros2 import solve_function
from vehiclemor.exporting.straight_line import FUNCTIONS, StraightLine
from vehiclemor.exporting.systems import SIGNATURES, TANGENTS, TOOL, ExportedSystem

SOURCES = Path(__file__).parent / "c_sources"
SELECT = """\
static vehiclemor_real select(int test, vehiclemor_real then, vehiclemor_real otherwise)
{
    return test ? then : otherwise;
}"""
ENTRY = """\
static vehiclemor_real entry(vehiclemor_real row, int place)
{
    return vehiclemor_table[(long)row + place];
}"""
# Kind of operation -> how C writes it.
FORMS = {
    **{sign: f"({{}} {sign} {{}})" for sign in COMPARISONS},
    "add": "({} + {})",
    "subtract": "({} - {})",
    "multiply": "({} * {})",
    "divide": "({} / {})",
    "negate": "(-{})",
    "select": "select({}, {}, {})",
    "table": "entry({}, {})",
}
# Function -> its name in C, in double precision.
MATH = {name: name for name in FUNCTIONS}
MATH |= {"abs": "fabs", "max": "fmax", "min": "fmin", "power": "pow"}
# Expressions that are written are less deep; of a longer one the inside gets a name.
SHALLOW = 12
# Of parameters on which no function depends; all are listed.
START_ALONE = "of the start alone, no effect here"
HEADER, MODEL, TANGENT = "vehiclemor_model.h", "vehiclemor_model.c", "vehiclemor_tangent.c"
STEPPER, DRIVER = "vehiclemor_step.c", "vehiclemor_driver.c"
# Precision -> type in C, and what follows a number and the name of a function.
TYPES = {"double": ("double", ""), "single": ("float", "f")}
# Name -> its summary, and how many vectors of states and of inputs a step holds.
INTEGRATORS = {
    "rk4": ("explicit Runge-Kutta method of order 4", 5, 1),
    "ros2": ("linearly implicit method of order 2, with the Jacobian at the first start", 4, 0),
}
# Of `ros2`: the solution of the linear system of a stage.
SIGNATURES_IN_C = SIGNATURES | TANGENTS | {"solve": ("x", "r", "k")}


class CSettings(NamedTuple):
    """How a system is written: step size of its integrator in s, integrator and precision."""

    step: float
    integrator: str = "rk4"
    precision: str = "double"


def c_files(system: ExportedSystem, settings: CSettings) -> dict[str, str]:
    """Name -> text of the files of a system."""
    sources = {STEPPER: f"vehiclemor_step_{settings.integrator}.c", DRIVER: DRIVER}
    shipped = {name: (SOURCES / file).read_text("utf-8") for name, file in sources.items()}
    suffix = TYPES[settings.precision][1]
    values = [_array("parameters", system.values, suffix)]
    values += [_array(_start(name), state, suffix) for name, state in system.starts.items()]
    functions = dict(system.functions)
    if settings.integrator == "ros2":
        functions["solve"] = solve_function(system, settings.step)
    tangents = {f"{name}_tangent": function for name, function in system.tangents().items()}
    return {
        HEADER: _header(system, settings),
        MODEL: _source(system, "its functions", values, functions, suffix),
        TANGENT: _source(system, "derivatives of its functions", [], tangents, suffix),
    } | shipped


def _header(system: ExportedSystem, settings: CSettings) -> str:
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
    summary, of_states, of_inputs = INTEGRATORS[settings.integrator]
    counts = {
        "STATES": sizes["x"],
        "INPUTS": sizes["u"],
        "OUTPUTS": len(system.outputs),
        "PARAMETERS": sizes["p"],
        "CONSTANTS": sizes["c"],
        "SCRATCH": of_states * max(sizes["x"], 1) + of_inputs * max(sizes["u"], 1),
    }
    of_integrator = []
    if settings.integrator == "ros2":
        of_integrator = ["", "/* Solve the linear system of a step. */", f"{_signature('solve')};"]
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
        f"/* Numbers are in {settings.precision} precision. */",
        f"typedef {TYPES[settings.precision][0]} vehiclemor_real;",
        "",
        "/* Sizes; an array in C holds one number at least.  Scratch are the numbers that a step",
        "   holds on the stack, beside what the functions have there. */",
        *(f"#define VEHICLEMOR_{name} {count}" for name, count in counts.items()),
        "#define VEHICLEMOR_FLOATS(count) ((count) > 0 ? (count) : 1)",
        "",
        f"/* Integrator: {summary}.",
        "   Step size in s that it is exported for, the longest one to use. */",
        f'#define VEHICLEMOR_INTEGRATOR "{settings.integrator}"',
        f"#define VEHICLEMOR_STEP {settings.step!r}",
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
        "void vehiclemor_step(vehiclemor_real *x, const vehiclemor_real *u,",
        "                     const vehiclemor_real *u_end, const vehiclemor_real *c,",
        "                     vehiclemor_real h);",
        *of_integrator,
        "",
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def _declared(name: str, size: int) -> str:
    return f"const vehiclemor_real vehiclemor_{name}[{max(size, 1)}]"


def _start(name: str) -> str:
    return f"start_{name}"


def _signature(name: str) -> str:
    *given, result = SIGNATURES_IN_C[name]
    arguments = ", ".join(f"const vehiclemor_real *{argument}" for argument in given)
    return f"void vehiclemor_{name}({arguments}, vehiclemor_real *{result})"


def _source(
    system: ExportedSystem,
    what: str,
    parts: Sequence[str],
    functions: Mapping[str, StraightLine],
    suffix: str,
) -> str:
    """Text of a file of functions, after other parts; a suffix ends names and numbers."""
    texts = [_function(name, function, suffix) for name, function in functions.items()]
    called = "\n".join(texts)
    helpers = [SELECT] if "select(" in called else []
    if "entry(" in called:
        helpers += [f"static {_array('table', system.table, suffix)}", ENTRY]
    head = f"/* {system.name}: {what}, written by {TOOL}. */"
    included = f'#include <math.h>\n\n#include "{HEADER}"'
    return "\n\n".join([head, included, *parts, *helpers, *texts]) + "\n"


def _number(value: float, suffix: str) -> str:
    return f"{np.float32(value)!s}f" if suffix else repr(value)


def _array(name: str, values: np.ndarray, suffix: str) -> str:
    numbers = [_number(value, suffix) for value in values.tolist()] or ["0"]
    rows = [", ".join(numbers[i : i + 4]) for i in range(0, len(numbers), 4)]
    body = ",\n    ".join(rows)
    return f"{_declared(name, len(values))} = {{\n    {body}\n}};"


def _function(name: str, function: StraightLine, suffix: str) -> str:
    """Definition of a function."""
    *given, result = SIGNATURES_IN_C[name]
    operations, counts = function.operations, uses(function.operations)
    texts: dict[int, str] = {}
    depths: dict[int, int] = {}
    lines = [_signature(name), "{"]
    for number in function.needed:
        kind, numbers, detail = operations[number]
        depth = 1 + max((depths[n] for n in numbers), default=-1)
        if kind == "number":
            text = _number(detail, suffix)
            text = text if detail >= 0.0 else f"({text})"
        elif kind == "entry":
            text = f"{detail[0]}[{detail[1]}]"
        else:
            values = [texts[n] for n in numbers]
            if kind in MATH:
                text = f"{MATH[kind]}{suffix}({', '.join(values)})"
            else:
                text = FORMS[kind].format(*values, detail)
            # What is used more than once has a name.
            if counts[number] > 1 or depth > SHALLOW:
                lines.append(f"    const vehiclemor_real v{number} = {text};")
                text, depth = f"v{number}", 0
        texts[number], depths[number] = text, depth
    lines += [f"    {result}[{i}] = {texts[n]};" for i, n in enumerate(function.results)]
    text = "\n".join(lines)
    # What is not read is said so, for compilers that ask.
    unread = [a for a in (*given, result) if f" {a}[" not in text and f"({a}[" not in text]
    return "\n".join([text, *(f"    (void){argument};" for argument in unread), "}"])
