"""What the time loop calls: seven functions of an integrator, four of a formulation.

None of these is ever run.  Loops import them from here, and are compiled with the functions of the
same name of one integrator and one formulation, see `catalogue.time_loop`.  Functions that several
integrators share stand in `shared`, those of all explicit pairs in `explicit_pair`.

The arguments are bundles, see `loop_arguments`: `problem` is a `Problem`, `method` a `Method`,
`control` a `Control`; `work` is the integrator's scratch space, a named tuple with at least the
vectors `WORK`; `counts` are those of the run, see `RHS_CALLS`.
"""

from vehiclemor.codegen.loop_types import COMPILED_ONLY

# Vectors of every integrator's scratch space: reduced state and right-hand side at the beginning
# of a step, both at its end, its error, and a state within the step.
WORK = ("y", "f", "new", "f_new", "error", "middle")


# --- integrators ----------------------------------------------------------------------------------


def work_space(buffer, first, integers, dim, inputs, method):
    """Scratch space for `dim` states in `buffer`, from number `first` on, and in `integers`."""
    raise NotImplementedError(COMPILED_ONLY)


def begin(problem, t, method, work):
    """Begin a span at time t: right-hand side at `work.y` into `work.f`."""
    raise NotImplementedError(COMPILED_ONLY)


def longest_step(h, method, control, work):
    """The longest step in s that the method can take and that is not above h."""
    raise NotImplementedError(COMPILED_ONLY)


def step(problem, t, h, method, work, counts):
    """Try a step of h s: `work.new` and `work.error`; False if that is impossible."""
    raise NotImplementedError(COMPILED_ONLY)


def accept(problem, t, h, method, work, counts):
    """Finish an accepted step: right-hand side at its end into `work.f_new`."""
    raise NotImplementedError(COMPILED_ONLY)


def prepare_curve(h, method, work):
    """Prepare dense output of an accepted step."""
    raise NotImplementedError(COMPILED_ONLY)


def interpolate(part, h, work):
    """State where a part of the step has passed, into `work.middle`."""
    raise NotImplementedError(COMPILED_ONLY)


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
