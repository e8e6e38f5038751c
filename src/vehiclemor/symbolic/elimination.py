"""Straight-line Gaussian elimination on a tape, with pivots chosen beforehand.

A sparse linear solve whose pivots are fixed turns into a list of scalar assignments: no loops, no
searches, and structural zeros cost nothing.  The price is that the pivots must stay away from zero
over the whole range of motion, which a test has to prove for every model that uses it.
"""

from collections.abc import Sequence

import sympy as sp

from vehiclemor.symbolic.tape import Tape

# (Row, column) in order of elimination.
Pivots = tuple[tuple[int, int], ...]


def eliminate(
    tape: Tape,
    matrix: Sequence[Sequence[sp.Expr]],
    right_sides: Sequence[Sequence[sp.Expr]],
    pivots: Pivots,
) -> list[list[sp.Expr]]:
    """Solve matrix x = right_side for several right sides by elimination with the given pivots."""
    a = [list(map(sp.sympify, row)) for row in matrix]
    b = [list(map(sp.sympify, right_side)) for right_side in right_sides]
    rows, columns = list(range(len(a))), list(range(len(a)))
    inverses: dict[int, sp.Expr] = {}
    for row, column in pivots:
        rows.remove(row)
        columns.remove(column)
        inverse = tape.let(1 / a[row][column])
        inverses[row] = inverse
        for other in rows:
            if a[other][column] == 0:
                continue
            factor = tape.let(a[other][column] * inverse)
            for k in columns:
                if a[row][k] != 0:
                    a[other][k] = tape.let(a[other][k] - factor * a[row][k])
            for right in b:
                right[other] = tape.let(right[other] - factor * right[row])
    solutions: list[list[sp.Expr]] = []
    for right in b:
        solution: dict[int, sp.Expr] = {}
        for row, column in reversed(pivots):
            known = sp.Add(*[a[row][k] * x for k, x in solution.items() if a[row][k] != 0])
            solution[column] = tape.let(tape.let(right[row] - known) * inverses[row])
        solutions.append([solution[column] for column in range(len(a))])
    return solutions


def eliminate_symmetric(
    tape: Tape,
    matrix: Sequence[Sequence[sp.Expr]],
    right_side: Sequence[sp.Expr],
    order: Sequence[int],
) -> dict[int, sp.Expr]:
    """Solve matrix x = right_side for a symmetric positive definite matrix by sparse L D L^T.

    Rows and columns that the order of elimination leaves out take no part.

    In the order of elimination unknowns that couple to few others come first: eliminating them
    leaves the Schur complement of the rest.  No pivot can vanish, whatever the order: Golub and Van
    Loan, *Matrix Computations* (4th ed., Johns Hopkins 2013), section 4.2.
    """
    a = {
        (j, k): sp.sympify(matrix[j][k])
        for rank, j in enumerate(order)
        for k in order[: rank + 1]
        if matrix[j][k] != 0
    }
    b = [sp.sympify(e) for e in right_side]
    factors: dict[int, dict[int, sp.Expr]] = {}
    inverses: dict[int, sp.Expr] = {}
    for rank, pivot in enumerate(order):
        inverse = inverses[pivot] = tape.let(1 / a[pivot, pivot])
        below = [j for j in order[rank + 1 :] if (j, pivot) in a]
        factors[pivot] = {j: tape.let(a[j, pivot] * inverse) for j in below}
        for index, j in enumerate(below):
            for k in below[: index + 1]:
                change = factors[pivot][j] * a[k, pivot]
                a[j, k] = tape.let(a.get((j, k), sp.Integer(0)) - change)
            b[j] = tape.let(b[j] - factors[pivot][j] * b[pivot])
    solution: dict[int, sp.Expr] = {}
    for pivot in reversed(order):
        known = sp.Add(*[factor * solution[j] for j, factor in factors[pivot].items()])
        solution[pivot] = tape.let(b[pivot] * inverses[pivot] - known)
    return solution
