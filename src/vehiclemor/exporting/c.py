"""C99 source of a system: no allocation, no state between calls, arrays of the caller."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
from jinja2 import Environment, FileSystemLoader

from vehiclemor.codegen.operations import COMPARISONS, uses
from vehiclemor.exporting.ros2 import solve_function
from vehiclemor.exporting.straight_line import FUNCTIONS, SIGNATURES, StraightLine
from vehiclemor.exporting.systems import TANGENTS, TOOL, CSettings, ExportedSystem

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
SIGNATURES_IN_C = SIGNATURES | TANGENTS | {"solve": ("x", "r", "k")}


def c_files(system: ExportedSystem, settings: CSettings) -> dict[str, str]:
    """Name -> text of the files of a system."""
    sources = {STEPPER: f"vehiclemor_step_{settings.integrator}.c", DRIVER: DRIVER}
    shipped = {name: (SOURCES / file).read_text("utf-8") for name, file in sources.items()}
    suffix = TYPES[settings.precision][1]
    values = [_array("parameters", system.values, suffix)]
    values += [_array(f"start_{name}", state, suffix) for name, state in system.starts.items()]
    functions = dict(system.functions)
    if settings.integrator == "ros2":
        functions["solve"] = solve_function(system, settings.step)
    tangents = {f"{name}_tangent": function for name, function in system.tangents().items()}
    return {
        HEADER: _header(system, settings),
        MODEL: _source(system, "its functions", values, functions, suffix),
        TANGENT: _source(system, "derivatives of its functions", [], tangents, suffix),
    } | shipped


def write_folder(texts: Mapping[str, str], folder: Path) -> None:
    """Write files into a new folder."""
    folder.mkdir()
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")


def written(template: str, **values: object) -> str:
    """Text of a file by its template."""
    environment = Environment(  # noqa: S701  (what is written is no HTML)
        loader=FileSystemLoader(SOURCES),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["quoted"] = quoteattr
    return environment.get_template(f"{template}.jinja").render(tool=TOOL, **values)


def _header(system: ExportedSystem, settings: CSettings) -> str:
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
    listed = {"States x": system.states, "Inputs u": system.inputs}
    listed |= {"Outputs y": system.outputs, "Parameters p": parameters}
    arrays = [_declared("parameters", sizes["p"])]
    arrays += [_declared(f"start_{name}", sizes["x"]) for name in system.starts]
    return written(
        HEADER,
        system=system,
        settings=settings,
        type=TYPES[settings.precision][0],
        integrator=summary,
        listed=listed,
        counts=counts,
        arrays=arrays,
        functions=map(_signature, SIGNATURES),
        tangents=map(_signature, TANGENTS),
        solve=_signature("solve") if settings.integrator == "ros2" else "",
    )


def _declared(name: str, size: int) -> str:
    return f"const vehiclemor_real vehiclemor_{name}[{max(size, 1)}]"


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
