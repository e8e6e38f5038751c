"""What integrators have in common, and functions of those that don't define them otherwise.

Steps of any size; a cubic by values and slopes at the ends of a step, dense output of order 3; step
sizes for which operators are stored, their products, vectors turned to heading zero.
"""

import math

INLINED = (
    *("longest_step", "prepare_curve", "interpolate"),
    *("index_above", "index_below", "nearest_index", "heading_of"),
)


def longest_step(h, method, control, work):
    """Any step size will do."""
    return h


def prepare_curve(h, work):
    """Coefficients of the cubic in the part of the step that has passed."""
    y, new, f, f_new, curve = work.y, work.new, work.f, work.f_new, work.curve
    for i in range(len(y)):
        rise, before, after = new[i] - y[i], h * f[i], h * f_new[i]
        curve[0, i] = before
        curve[1, i] = 3.0 * rise - 2.0 * before - after
        curve[2, i] = before + after - 2.0 * rise


def interpolate(z, h, work):
    """State at the part z of the step that has passed, into `middle`."""
    y, curve = work.y, work.curve
    for i in range(len(y)):
        work.middle[i] = y[i] + z * (curve[0, i] + z * (curve[1, i] + z * curve[2, i]))


def index_above(grid, index, h):
    """Number of the shortest step of the grid that is not below h, from the last one on."""
    while index > 0 and grid[index - 1] >= 0.999 * h:
        index -= 1
    while index < len(grid) - 1 and grid[index] < 0.999 * h:
        index += 1
    return index


def index_below(grid, index, h):
    """Number of the longest step of the grid that is not above h, from the last one on."""
    while index > 0 and grid[index] > 1.0001 * h:
        index -= 1
    while index < len(grid) - 1 and grid[index + 1] <= 1.0001 * h:
        index += 1
    return index


def nearest_index(grid, index, h):
    """Number of the step of the grid that is nearest to h, from the last one on."""
    while index > 0 and grid[index - 1] * grid[index] > h * h:
        index -= 1
    while index < len(grid) - 1 and grid[index + 1] * grid[index] < h * h:
        index += 1
    return index


def heading_of(rotating, y):
    """Cosine and sine of the heading; 1 and 0 where nothing turns with it."""
    if len(rotating) == 0:
        return 1.0, 0.0
    heading = y[rotating[0]]
    return math.cos(heading), math.sin(heading)


def rotate(vector, rotating, cosine, sine):
    """Rotate the pairs of states that turn with the heading, in place."""
    for k in range(1, len(rotating), 2):
        a, b = vector[rotating[k]], vector[rotating[k + 1]]
        vector[rotating[k]] = cosine * a - sine * b
        vector[rotating[k + 1]] = sine * a + cosine * b


def add_rows(rows, first, b, size, result):
    """Add the combination with b of rows, from `first` on, to a vector of that size."""
    # Four rows at a time: the result is loaded and stored a quarter as often.
    j = 0
    while j + 3 < len(b):
        w0, w1, w2, w3 = b[j], b[j + 1], b[j + 2], b[j + 3]
        row = first + j
        for i in range(size):
            result[i] += (rows[row, i] * w0 + rows[row + 1, i] * w1) + (
                rows[row + 2, i] * w2 + rows[row + 3, i] * w3
            )
        j += 4
    while j < len(b):
        w0 = b[j]
        for i in range(size):
            result[i] += rows[first + j, i] * w0
        j += 1
