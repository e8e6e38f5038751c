"""Law of the ports: progressive springs with stops, degressive dampers, tires that can't pull.

A spring or damper of compression w presses its axle down and the frame up: the force along w is
the opposite of its force.  A tire lifts its axle.  Springs, dampers and stops are those of the MAN
5 t truck of Project Chrono (`MAN_5t_Solid3LinkAxle.cpp`).
"""

import sympy as sp

from vehiclemor.multibody.components import body
from vehiclemor.multibody.flexible_truck import quantities
from vehiclemor.symbolic.program import Program, assemble
from vehiclemor.symbolic.tape import Tape

FRONT = (True, True, False, False)
# A force along the deflection, and its derivatives by the deflection and by its rate.
Law = tuple[sp.Expr, sp.Expr, sp.Expr]


def derive() -> Program:
    """Derive the forces (12, 3) of the ports with their derivatives; parameters stay symbols."""
    tape = Tape()
    w = body.symbols(quantities.PORTS)
    rates = [sp.Symbol(f"{symbol.name}_rate", real=True) for symbol in w]
    u = body.symbols(quantities.INPUTS)
    p = {name: sp.Symbol(f"p_{name}", real=True) for name in quantities.PARAMETERS}
    driver = [sp.Symbol(f"p_driver_{axis}", real=True) for axis in "xyz"]
    parameters = [s for name in p for s in (driver if name == "driver" else [p[name]])]
    laws = [_spring(tape, p, front, w[k]) for k, front in enumerate(FRONT)]
    laws += [_damper(tape, p, rates[4 + k]) for k in range(4)]
    laws += [_tire(tape, p, u[k] - w[8 + k], u[4 + k] - rates[8 + k]) for k in range(4)]
    forces = [entry for law in laws for entry in law]
    return assemble(
        tape, {"x": [*w, *rates], "u": u}, parameters, {"port_forces": (forces, (len(w), 3))}
    )


def _step(tape: Tape, condition: sp.Basic) -> sp.Expr:
    """1 where a condition holds, 0 elsewhere."""
    return tape.let(sp.Piecewise((1, condition), (0, True)))


def _spring(tape: Tape, p: dict[str, sp.Symbol], front: bool, w: sp.Symbol) -> Law:
    """A spring: k w + k2 w abs(w) and its two stops; `w` is zero at the free length."""
    end = "front" if front else "rear"
    stiffness, progression = p[f"{end}_spring_stiffness"], p[f"{end}_spring_progression"]
    free = p[f"{end}_free_length"]
    size = tape.let(sp.Abs(w))
    bump, bump_rate = _stop(tape, p, tape.let(w - (free - p["shortest_length"])))
    rebound, rebound_rate = _stop(tape, p, tape.let((free - p["longest_length"]) - w))
    force = tape.let(stiffness * w + progression * w * size + bump - rebound)
    rate = tape.let(stiffness + 2 * progression * size + bump_rate + rebound_rate)
    return -force, -rate, sp.Integer(0)


def _stop(tape: Tape, p: dict[str, sp.Symbol], excess: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Force of a stop and its derivative: linear between the table's points, and beyond."""
    force = rate = slope = place = reached = sp.Integer(0)
    for point in quantities.STOP_TABLE:
        here, level = sp.Rational(point, 1000), p[f"stop_force_{point}_mm"]
        steeper = tape.let((level - reached) / (here - place) - slope)
        beyond = _step(tape, excess > place)
        force += steeper * beyond * (excess - place)
        rate += steeper * beyond
        slope, place, reached = tape.let(slope + steeper), here, level
    return tape.let(force), tape.let(rate)


def _damper(tape: Tape, p: dict[str, sp.Symbol], v: sp.Symbol) -> Law:
    """A damper: c v / (1 + d abs(v)); bump is compression."""
    bump = _step(tape, v > 0)
    damping = tape.let(bump * p["bump_damping"] + (1 - bump) * p["rebound_damping"])
    degression = tape.let(bump * p["bump_degression"] + (1 - bump) * p["rebound_degression"])
    divisor = tape.let(1 + degression * sp.Abs(v))
    rate = tape.let(damping / divisor)
    return -(rate * v), sp.Integer(0), -(rate / divisor)


def _tire(tape: Tape, p: dict[str, sp.Symbol], deflection: sp.Expr, rate: sp.Expr) -> Law:
    """A tire: max(0, k d + c v) in contact, d > 0, else 0."""
    d, v = tape.let(deflection), tape.let(rate)
    stiffness, damping = p["tire_stiffness"], p["tire_damping"]
    pressed = tape.let(stiffness * d + damping * v)
    contact = tape.let(_step(tape, d > 0) * _step(tape, pressed > 0))
    return contact * pressed, -(contact * stiffness), -(contact * damping)
