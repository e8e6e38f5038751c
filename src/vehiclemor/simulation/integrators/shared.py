"""Functions of integrators that don't define them otherwise.

Steps of any size; dense output of order 3, the cubic through states and slopes at both ends.
"""

# Powers of the part of a step that has passed, in the cubic.
POWERS = 3
INLINED = ("longest_step", "prepare_curve", "interpolate")


def longest_step(h, method, control, work):
    """Any step size will do."""
    return h


def prepare_curve(h, method, work):
    """Coefficients of the cubic in the part of the step that has passed."""
    y, new, f, f_new, curve = work.y, work.new, work.f, work.f_new, work.curve
    for i in range(len(y)):
        rise, before, after = new[i] - y[i], h * f[i], h * f_new[i]
        curve[0, i] = before
        curve[1, i] = 3.0 * rise - 2.0 * before - after
        curve[2, i] = before + after - 2.0 * rise


def interpolate(part, h, work):
    """State where a part of the step has passed, into `middle`."""
    y, curve = work.y, work.curve
    for i in range(len(y)):
        work.middle[i] = y[i] + part * (curve[0, i] + part * (curve[1, i] + part * curve[2, i]))
