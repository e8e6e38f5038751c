"""Evaluation of tapes and generated sources, and random straight-line programs to try them on."""

from collections.abc import Callable, Mapping, Sequence

import mpmath as mp
import numpy as np
import sympy as sp

from vehiclemor.symbolic.program import Function, Program
from vehiclemor.symbolic.tape import Tape, dependencies

DIGITS = 30


def precise(expressions: Sequence[sp.Expr], values: Mapping[sp.Symbol, float]) -> np.ndarray:
    """Expressions without names of a tape, evaluated at 30 digits and rounded once."""
    with mp.workdps(DIGITS):
        function = sp.lambdify(list(values), list(expressions), "mpmath")
        return np.array([float(v) for v in function(*[mp.mpf(v) for v in values.values()])])


def function_of(
    tape: Tape, symbols: Sequence, results: Sequence, modules: str | list = "numpy"
) -> Callable:
    """Function of the symbols (nested as the results are) that evaluates results of a tape.

    `modules` as in `sympy.lambdify`: numbers, arrays, complex or of many digits.
    """
    definitions = tape.definitions

    def on_tape(expressions: Sequence) -> tuple[list, Sequence]:
        flat = [sp.sympify(e) for e in sp.flatten(expressions)]
        return [(s, definitions[s]) for s in dependencies(flat, definitions)], expressions

    return sp.lambdify(symbols, results, modules, cse=on_tape)


def run(program: Program, name: str, values: Mapping[sp.Symbol, float]) -> np.ndarray:
    """Result of one function of a program, in plain Python."""
    constants = _computed(program.constants, {p: values[p] for p in program.parameters})
    known = dict(zip(program.constants.results, constants, strict=True))
    given = {s: values[s] for symbols in program.arguments.values() for s in symbols}
    function = program.functions[name]
    return _computed(function, given | known).reshape(function.shape)


def _computed(function: Function, values: Mapping[sp.Symbol, float]) -> np.ndarray:
    lines = list(function.assignments), list(function.results)
    computed = sp.lambdify(list(values), lines[1], "math", cse=lambda _: lines)
    return np.array(computed(*values.values()), dtype=float)
