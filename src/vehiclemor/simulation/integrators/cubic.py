"""Cubic between the ends of a step, by values and slopes: dense output of order 3."""

INLINED = ("prepare_curve", "interpolate")


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
