"""Sparse matrices in compiled loops: products by columns, triangular solutions by blocks."""

from typing import NamedTuple

from vehiclemor.codegen.loop_types import IntVector, Vector, matrix


class Columns(NamedTuple):
    """A sparse matrix by columns, each in pieces of consecutive rows.

    First piece of each column and, last, their number (columns + 1,); first row of each piece, then
    the index of its first value (2 (pieces + 1),); entries, piece by piece.
    """

    pieces: IntVector
    rows: IntVector
    values: Vector


class Blocks(NamedTuple):
    """A lower triangular matrix in blocks of neighbouring columns with the same rows below them.

    First column of each block and, last, their number (blocks + 1,); rows below the blocks, and
    the first index of each block's; columns of the blocks, triangle and rows below, and the first
    index of each block's.
    """

    columns: IntVector
    rows: IntVector
    row_offsets: IntVector
    values: Vector
    offsets: IntVector


def add_product(a, x, y):
    """Add a x to y."""
    for j in range(len(a.pieces) - 1):
        factor = x[j]
        if factor != 0.0:
            for piece in range(a.pieces[j], a.pieces[j + 1]):
                row, first = a.rows[2 * piece], a.rows[2 * piece + 1]
                for k in range(a.rows[2 * piece + 3] - first):
                    y[row + k] += a.values[first + k] * factor


def column_product(a, j, x):
    """Column j of a times x."""
    total = 0.0
    for piece in range(a.pieces[j], a.pieces[j + 1]):
        row, first = a.rows[2 * piece], a.rows[2 * piece + 1]
        size = a.rows[2 * piece + 3] - first
        s0 = s1 = s2 = s3 = 0.0
        k = 0
        while k + 3 < size:
            s0 += a.values[first + k] * x[row + k]
            s1 += a.values[first + k + 1] * x[row + k + 1]
            s2 += a.values[first + k + 2] * x[row + k + 2]
            s3 += a.values[first + k + 3] * x[row + k + 3]
            k += 4
        while k < size:
            s0 += a.values[first + k] * x[row + k]
            k += 1
        total += (s0 + s2) + (s1 + s3)
    return total


def solve(low, pivots, x, gathered):
    """Solve L D L' x = b in place; `pivots` are inverse, `gathered` (n,) is scratch space."""
    blocks = len(low.columns) - 1
    for number in range(blocks):
        block, rows, x_block = part(low, number, x)
        width, below = len(x_block), gathered[: len(rows)]
        for k in range(width - 1):
            column, factor = block[k], x_block[k]
            for i in range(k + 1, width):
                x_block[i] -= column[i] * factor
        for i in range(len(rows)):
            below[i] = 0.0
        add_columns(block, width, x_block, below)
        for i in range(len(rows)):
            x[rows[i]] -= below[i]
    for i in range(len(x)):
        x[i] *= pivots[i]
    for number in range(blocks - 1, -1, -1):
        block, rows, x_block = part(low, number, x)
        width, below = len(x_block), gathered[: len(rows)]
        for i in range(len(rows)):
            below[i] = x[rows[i]]
        subtract_products(block, width, below, x_block)
        for k in range(width - 1, -1, -1):
            column, total = block[k], x_block[k]
            for i in range(k + 1, width):
                total -= column[i] * x_block[i]
            x_block[k] = total


def part(low, number, x):
    """Columns of a block, rows below it, and its entries of x."""
    first, end = low.columns[number], low.columns[number + 1]
    rows = low.rows[low.row_offsets[number] : low.row_offsets[number + 1]]
    width, offset = end - first, low.offsets[number]
    return matrix(low.values, offset, width, width + len(rows)), rows, x[first:end]


def add_columns(block, skipped, x, total):
    """Add columns, without their first entries, times entries of x, four at a time."""
    width, height, k = len(block), len(total), 0
    while k + 3 < width:
        a, b, c, d = block[k], block[k + 1], block[k + 2], block[k + 3]
        a, b, c, d = a[skipped:], b[skipped:], c[skipped:], d[skipped:]
        f, g, p, q = x[k], x[k + 1], x[k + 2], x[k + 3]
        for i in range(height):
            total[i] += (a[i] * f + b[i] * g) + (c[i] * p + d[i] * q)
        k += 4
    while k < width:
        a, f = block[k][skipped:], x[k]
        for i in range(height):
            total[i] += a[i] * f
        k += 1


def subtract_products(block, skipped, below, x):
    """Subtract products of such columns with a vector from entries of x, four at a time."""
    width, height, k = len(block), len(below), 0
    while k + 3 < width:
        a, b, c, d = block[k], block[k + 1], block[k + 2], block[k + 3]
        a, b, c, d = a[skipped:], b[skipped:], c[skipped:], d[skipped:]
        f = g = p = q = 0.0
        for i in range(height):
            f += a[i] * below[i]
            g += b[i] * below[i]
            p += c[i] * below[i]
            q += d[i] * below[i]
        x[k] -= f
        x[k + 1] -= g
        x[k + 2] -= p
        x[k + 3] -= q
        k += 4
    while k < width:
        a, f, g = block[k][skipped:], 0.0, 0.0
        for i in range(height // 2):
            f += a[2 * i] * below[2 * i]
            g += a[2 * i + 1] * below[2 * i + 1]
        if height % 2:
            f += a[height - 1] * below[height - 1]
        x[k] -= f + g
        k += 1
