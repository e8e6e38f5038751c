"""Compiled polynomials: loops with sizes that the compiler knows, one module for each size."""

from functools import cache
from itertools import combinations_with_replacement

from vehiclemor.codegen.loops import Loop, loops

# Where small solves are.
NEWTON = ("simulation.newton_loops",)


def monomials(rank: int, degree: int) -> tuple[tuple[int, ...], ...]:
    """Monomials up to a total degree in `rank` variables, each as its variables in order.

    The constant, (), comes first, then (0,), (1,) and so on, then (0, 0), (0, 1) and so on.
    """
    orders = range(degree + 1)
    return tuple(c for n in orders for c in combinations_with_replacement(range(rank), n))


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
