"""What integrators have in common, and functions of those that don't define them otherwise.

Steps of any size; a cubic by values and slopes at the ends of a step, dense output of order 3; step
sizes for which operators are stored.
"""

INLINED = ("longest_step", "prepare_curve", "interpolate", "index_below", "nearest_index")


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
