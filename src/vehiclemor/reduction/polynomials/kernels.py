"""Compiled polynomials: loops with sizes that the compiler knows, one module for each size."""

from functools import cache
from itertools import combinations_with_replacement
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from vehiclemor.codegen.cache import load_module
from vehiclemor.codegen.link import linked_source
from vehiclemor.errors import InputError
from vehiclemor.maneuvers import Maneuver
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.checks import check_inputs, loop_array

# Names that the loops find in the linked module; see codegen/stubs.py.
DEGREE = 0


def terms(x: NDArray, load: NDArray, coefficients: NDArray, result: NDArray) -> None:
    """Polynomials at x (N,), less a load (N,), into result (N,)."""
    raise NotImplementedError("runs only in a linked module")


def slopes(x: NDArray, derivatives: NDArray, result: NDArray) -> None:
    """Jacobian of the polynomials at x (N,) into result[:, :N]; result is (N, N + 1)."""
    raise NotImplementedError("runs only in a linked module")


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


def polynomial_source(rank: int, degree: int) -> str:
    """Source text of `terms` and `slopes` for `rank` polynomials in as many variables.

    All monomials stand in one nested sum, by Horner's scheme; results are stored at the end, since
    a store could change what is still to be read.
    """
    every = range(rank)
    variables = [f"    x{j} = x[{j}]" for j in every]
    lines = ["def terms(x, load, coefficients, result):", *variables]
    lines += [f"    g{k} = {_nested('coefficients[', k, rank, degree)} - load[{k}]" for k in every]
    lines += [f"    result[{k}] = g{k}" for k in every]
    lines += ["", "def slopes(x, derivatives, result):", *variables]
    pairs = [(k, j) for k in every for j in every]
    lines += [
        f"    s{k}_{j} = {_nested(f'derivatives[{j}, ', k, rank, degree - 1)}" for k, j in pairs
    ]
    lines += [f"    result[{k}, {j}] = s{k}_{j}" for k, j in pairs]
    return "\n".join(lines) + "\n"


def _nested(array: str, row: int, rank: int, degree: int) -> str:
    places = {term: place for place, term in enumerate(monomials(rank, degree))}

    def part(term: tuple[int, ...]) -> str:
        text = f"{array}{places[term]}, {row}]"
        if len(term) < degree:
            # The first variable's part takes longest: it is added last.
            for j in reversed(range(term[-1] if term else 0, rank)):
                text = f"({text} + x{j} * {part((*term, j))})"
        return text

    return part(())


@cache
def map_module(states: int, degree: int) -> ModuleType:
    """Compiled loop of `states` polynomials of that degree in one variable."""
    from vehiclemor.reduction.polynomials import map_loops

    sizes = {"N": states, "DEGREE": degree}
    return load_module("map_loops", linked_source("", [map_loops], sizes, "the path map"))


@cache
def residual_module(inputs: int, rank: int, degree: int) -> ModuleType:
    """Compiled loops of `rank` polynomial equations with so many inputs."""
    from vehiclemor.reduction.polynomials import residual_loops as polynomial_residual_loops
    from vehiclemor.simulation import newton_loops

    # The shared small solve is one of N equations: here these are the reduced ones.
    sizes = {"N": rank, "INPUTS": inputs}
    loops = [newton_loops, polynomial_residual_loops]
    source = linked_source(polynomial_source(rank, degree), loops, sizes, "polynomial residuals")
    return load_module("polynomial_residual_loops", source)


def checked_inputs(model: AlgebraicModel, maneuver: Maneuver) -> np.ndarray:
    """Inputs (samples, inputs) of a maneuver at its output times, as the loops want them.

    Raises
    ------
    InputError
        If the maneuver's inputs are not the model's, or one isn't finite.
    """
    check_inputs(maneuver, model.name, model.inputs)
    times = maneuver.times
    inputs = loop_array(maneuver.at(times))
    bad = np.argwhere(~np.isfinite(inputs))
    if len(bad):
        sample, column = bad[0]
        raise InputError(f"input {model.inputs[column]} is not finite at t = {times[sample]:.6g} s")
    return inputs
