"""Law of the ports: progressive springs with stops, degressive dampers, tires that can't pull.

A spring or damper of compression w presses its axle down and the frame up: the force along w is
the opposite of its force.  A tire lifts its axle.  Springs, dampers and stops are those of the MAN
5 t truck of Project Chrono (`MAN_5t_Solid3LinkAxle.cpp`).
"""

import sympy as sp

from vehiclemor.multibody.components import body
from vehiclemor.multibody.flexible_truck.definition import DECLARED, ENDS
from vehiclemor.symbolic.program import Program, assemble
from vehiclemor.symbolic.tape import Tape

Parameters = dict[str, sp.Symbol]
# Excess beyond shortest or longest length, in mm, at which the stops' force is a parameter.
STOP_TABLE = (10, 20, 30, 40, 50)


def derive() -> Program:
    """Derive the forces (12, 3) of the ports with their derivatives; parameters stay symbols."""
    tape = Tape()
    w = body.symbols(DECLARED["ports"])
    rates = [sp.Symbol(f"{symbol.name}_rate", real=True) for symbol in w]
    u = body.symbols(DECLARED["inputs"])
    p = body.parameters(DECLARED["parameters"])
    forces = [-_spring(tape, p, ENDS[k // 2], w[k]) for k in range(4)]
    forces += [-_damper(tape, p, rates[4 + k]) for k in range(4)]
    forces += [_tire(tape, p, u[k] - w[8 + k], u[4 + k] - rates[8 + k]) for k in range(4)]
    slopes = tape.jacobian(forces, [*w, *rates])
    table = [x for k, f in enumerate(forces) for x in (f, slopes[k][k], slopes[k][len(w) + k])]
    return assemble(
        tape, {"x": [*w, *rates], "u": u}, list(p.values()), {"port_forces": (table, (len(w), 3))}
    )


def _step(tape: Tape, condition: sp.Basic) -> sp.Expr:
    """1 where a condition holds, 0 elsewhere."""
    return tape.let(sp.Piecewise((1, condition), (0, True)))


def _spring(tape: Tape, p: Parameters, end: str, w: sp.Symbol) -> sp.Expr:
    """A spring: k w + k2 w abs(w) and its two stops; `w` is zero at the free length."""
    size = tape.let((2 * _step(tape, w > 0) - 1) * w)
    free = p[f"{end}_free_length"]
    bump = _stop(tape, p, tape.let(w - (free - p["shortest_length"])))
    rebound = _stop(tape, p, tape.let((free - p["longest_length"]) - w))
    spring = p[f"{end}_spring_stiffness"] * w + p[f"{end}_spring_progression"] * w * size
    return tape.let(spring + bump - rebound)


def _stop(tape: Tape, p: Parameters, excess: sp.Expr) -> sp.Expr:
    """Force of a stop: linear between the table's points, and beyond."""
    force = slope = last = reached = sp.Integer(0)
    for point in STOP_TABLE:
        here, level = sp.Rational(point, 1000), p[f"stop_force_{point}_mm"]
        steeper = tape.let((level - reached) / (here - last) - slope)
        force += steeper * _step(tape, excess > last) * (excess - last)
        slope, last, reached = tape.let(slope + steeper), here, level
    return tape.let(force)


def _damper(tape: Tape, p: Parameters, v: sp.Symbol) -> sp.Expr:
    """A damper: c v / (1 + d abs(v)); bump is compression."""
    bump = _step(tape, v > 0)
    damping = tape.let(bump * p["bump_damping"] + (1 - bump) * p["rebound_damping"])
    degression = tape.let(bump * p["bump_degression"] + (1 - bump) * p["rebound_degression"])
    return tape.let(damping * v / (1 + degression * (2 * bump - 1) * v))


def _tire(tape: Tape, p: Parameters, deflection: sp.Expr, rate: sp.Expr) -> sp.Expr:
    """A tire: max(0, k d + c v) in contact, d > 0, else 0."""
    d, v = tape.let(deflection), tape.let(rate)
    pressed = tape.let(p["tire_stiffness"] * d + p["tire_damping"] * v)
    return tape.let(_step(tape, d > 0) * _step(tape, pressed > 0) * pressed)
