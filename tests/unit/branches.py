"""Plug-in model whose right-hand side and outputs branch in every way that SymPy knows."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import sympy as sp

from tests.unit import standard_problems
from vehiclemor.parameters import Declared
from vehiclemor.symbolic.program import Program, assemble
from vehiclemor.symbolic.tape import Tape

STATES = a, b, c, d = sp.symbols("a b c d", real=True)
INPUTS = u, v, w = sp.symbols("u v w", real=True)
PARAMETERS = p, q, r, s, t = sp.symbols("p q r s t", real=True)
RATES = [
    sp.Max(a, 0),
    sp.Min(a, b, u, p * c),
    sp.Max(-b, 0.1) * sp.Piecewise((a, b > 0), (b**2, True)),
    -sp.Piecewise((a, (b > 0) & (c < u) & (d < 1)), (b, (a > 0) | (c > v)), (c * p, True)),
]
OUTPUTS = [
    sp.Piecewise((a * p, p > q), (b, True)),
    sp.Max(p, q) * a + sp.Min(r, 2 * s) + sp.Piecewise((1, p < q), (p * t, True)),
    sp.Piecewise((c, b > 0), (d, b > -0.5), (a, sp.Ne(a, b)), (1, True)) + sp.Max(b, 0) ** 2,
    sp.Piecewise((a, ~((b > 0) & (c > 0))), (-a, True)),
    sp.sqrt(sp.Max(a * b, c * d, 0.25)),
    sp.Min(sp.Max(a, -0.5), 0.5) / sp.Max(sp.Abs(u), 1e-3),
    sp.Piecewise((a, (b > 0) & (p > q)), (b, sp.Ge(c, d)), (u, sp.true)),
    sp.Max(sp.Piecewise((a, b < c), (d, True)), sp.Min(b, c)),
]


def derive() -> Program:
    tape = Tape()
    rates, outputs = ([tape.let(e) for e in group] for group in (RATES, OUTPUTS))
    functions = {"derivative": (rates, (4,)), "outputs": (outputs, (8,))}
    return assemble(tape, {"x": STATES, "u": INPUTS}, PARAMETERS, functions)


DEFINITION = replace(
    standard_problems.DEFINITION,
    name="branches",
    parameters={symbol.name: Declared("1") for symbol in PARAMETERS},
    parameter_file=Path(__file__).with_suffix(".toml"),
    derive=derive,
    starts=lambda _: {"only": np.array([0.7, -0.2, 0.1, 0.9])},
)
