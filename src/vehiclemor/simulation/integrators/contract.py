"""What the time loop calls: seven functions of an integrator, four of a formulation.

Loops import them from here, and are compiled with the functions of the same name of one integrator
and one formulation, see `catalogue.time_loop`.  Five are complete: an integrator that does not
replace them takes steps of any size, and its dense output is the cubic through states and slopes at
both ends of a step.  Functions of all explicit pairs stand in `explicit_pair`.

The arguments are bundles, see `loop_arguments`: `problem` is a `Problem`, `method` a `Method`;
`work` is the integrator's scratch space, a named tuple with at least the vectors y and f (reduced
state and right-hand side at the beginning of a step), new and f_new (both at its end), error, and
middle (a state within the step); `counts` are those of the run, see `RHS_CALLS`.
"""

from vehiclemor.codegen.loop_types import COMPILED_ONLY

# Coefficients of the cubic, by powers of the part of a step that has passed.
POWERS = 3
INLINED = ("accept", "longest_step", "prepare_curve", "interpolate")


# --- integrators ----------------------------------------------------------------------------------


def work_space(buffer, first, integers, dim, inputs, method):
    """Scratch space for `dim` states in `buffer`, from number `first` on, and in `integers`."""
    raise NotImplementedError(COMPILED_ONLY)


def begin(method, work):
    """Begin a span at `work.y`, where `work.f` is the right-hand side."""


def longest_step(h, method, work):
    """The longest step in s that the method can take and that is not above h."""
    return h


def step(problem, t, h, method, work, counts):
    """Try a step of h s: `work.new` and `work.error`; False if that is impossible."""
    raise NotImplementedError(COMPILED_ONLY)


def accept(problem, t, h, method, work, counts):
    """Finish an accepted step: right-hand side at its end into `work.f_new`, if not there yet."""


def prepare_curve(h, method, work):
    """Prepare dense output of an accepted step: coefficients by powers of the part passed."""
    y, new, f, f_new, curve = work.y, work.new, work.f, work.f_new, work.curve
    for i in range(len(y)):
        rise, before, after = new[i] - y[i], h * f[i], h * f_new[i]
        curve[0, i] = before
        curve[1, i] = 3.0 * rise - 2.0 * before - after
        curve[2, i] = before + after - 2.0 * rise


def interpolate(part, h, work):
    """State where a part of the step has passed, into `work.middle`."""
    y, curve = work.y, work.curve
    for i in range(len(y)):
        work.middle[i] = y[i] + part * (curve[0, i] + part * (curve[1, i] + part * curve[2, i]))


# --- formulations ---------------------------------------------------------------------------------


def rhs(problem, t, y, dy):
    """Right-hand side at time t and reduced state y (dim,) into dy (dim,)."""
    raise NotImplementedError(COMPILED_ONLY)


def reconstruct(problem, y, x):
    """State of a reduced state y (dim,) into x (n,)."""
    raise NotImplementedError(COMPILED_ONLY)


def project(problem, t, x, y, counts):
    """Reduced state of a state x (n,) at time t into y (dim,)."""
    raise NotImplementedError(COMPILED_ONLY)


def error_norm(problem, error, y, tolerance):
    """Largest error of a state as a multiple of its tolerance; NaN if y is."""
    raise NotImplementedError(COMPILED_ONLY)
