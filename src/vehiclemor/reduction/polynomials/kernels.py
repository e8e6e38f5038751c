"""Compiled polynomials: loops with sizes that the compiler knows, one module for each size."""

from functools import cache
from itertools import combinations_with_replacement

import numpy as np

from vehiclemor.codegen.loops import Loop, loops

# Where small solves are.
NEWTON = ("simulation.newton_loops",)


def monomials(rank: int, degree: int) -> tuple[tuple[int, ...], ...]:
    """Monomials up to a total degree in `rank` variables, each as its variables in order.

    The constant, (), comes first, then (0,), (1,) and so on, then (0, 0), (0, 1) and so on.
    """
    orders = range(degree + 1)
    return tuple(c for n in orders for c in combinations_with_replacement(range(rank), n))


def derivatives(coefficients: np.ndarray, rank: int, degree: int) -> np.ndarray:
    """Coefficients (rank, monomials of one degree less, rank) of the derivatives by variable."""
    places = {term: place for place, term in enumerate(monomials(rank, degree))}
    lower = monomials(rank, degree - 1)
    result = np.empty((rank, len(lower), rank))
    for j in range(rank):
        for place, term in enumerate(lower):
            # The derivative of x_j^p m is p x_j^(p - 1) m.
            higher = tuple(sorted((*term, j)))
            result[j, place] = higher.count(j) * coefficients[places[higher]]
    return result


def polynomial_kernels(rank: int, degree: int) -> dict[str, str]:
    """Text of the kernels `terms` and `slopes` for `rank` polynomials in as many variables.

    All monomials stand in one nested sum, by Horner's scheme; results are stored at the end, since
    a store could change what is still to be read.
    """
    every = range(rank)
    variables = [f"x{j} = _x[{j}]" for j in every]
    values = [f"g{k} = {_nested('_coefficients', 0, k, rank, degree)} - _load[{k}]" for k in every]
    stored = [f"_result[{k}] = g{k}" for k in every]
    slopes, entries = [], []
    count = len(monomials(rank, degree - 1))
    for k in every:
        for j in every:
            nested = _nested("_derivatives", j * count, k, rank, degree - 1)
            slopes.append(f"s{k}_{j} = {nested}")
            # Rows are one longer than the Jacobian's: the load's column is the loop's.
            entries.append(f"_result[{k * (rank + 1) + j}] = s{k}_{j}")
    heads = {
        "terms": "def terms(_x, _load, _coefficients, _result):",
        "slopes": "def slopes(_x, _derivatives, _result):",
    }
    bodies = {"terms": [*variables, *values, *stored], "slopes": [*variables, *slopes, *entries]}
    return {name: "\n    ".join([heads[name], *bodies[name]]) + "\n" for name in heads}


def _nested(array: str, first: int, row: int, rank: int, degree: int) -> str:
    places = {term: place for place, term in enumerate(monomials(rank, degree))}

    def part(term: tuple[int, ...]) -> str:
        text = f"{array}[{(first + places[term]) * rank + row}]"
        if len(term) < degree:
            # The first variable's part takes longest: it is added last.
            for j in reversed(range(term[-1] if term else 0, rank)):
                text = f"({text} + x{j} * {part((*term, j))})"
        return text

    return part(())


def map_kernel(moving: tuple[int, ...], degree: int, columns: tuple[int, ...]) -> str:
    """Text of the kernel `polynomials`: each monomial is one of a degree less times a variable.

    Parameters
    ----------
    moving
        Numbers of the inputs that are variables.
    columns
        Column of the coefficients for each result; several may share one.
    """
    every = monomials(len(moving), degree)
    places = {term: place for place, term in enumerate(every)}
    lines = [f"x{j} = _x[{i}]" for j, i in enumerate(moving)]
    lines.append("m0 = 1.0")
    lines += [f"m{places[term]} = m{places[term[:-1]]} * x{term[-1]}" for term in every[1:]]
    values = ", ".join(f"v{i}" for i in range(max(columns) + 1))
    powers = ", ".join(f"m{place}" for place in range(len(every)))
    lines.append(f"({values},) = weighted_sums(_coefficients, 0, ({powers},))")
    lines += [f"_result[{i}] = v{column}" for i, column in enumerate(columns)]
    return "\n    ".join(["def polynomials(_x, _coefficients, _result):", *lines]) + "\n"


@cache
def map_loop(inputs: int, moving: tuple[int, ...], degree: int, columns: tuple[int, ...]) -> Loop:
    """Compiled loop of polynomials of that total degree in those of the inputs that move."""
    sizes = {"INPUTS": inputs, "QUANTITIES": len(columns)}
    modules = (*NEWTON, "reduction.polynomials.map_loops")
    kernels = {"polynomials": map_kernel(moving, degree, columns)}
    return loops(modules, ("map_path",), kernels, sizes)["map_path"]


@cache
def residual_loop(name: str, inputs: int, rank: int, degree: int) -> Loop:
    """Compiled loop of `rank` polynomial equations with so many inputs."""
    # The shared small solve is one of N equations: here these are the reduced ones.
    sizes = {"N": rank, "INPUTS": inputs}
    modules = (*NEWTON, "reduction.polynomials.residual_loops")
    return loops(modules, (name,), polynomial_kernels(rank, degree), sizes)[name]
