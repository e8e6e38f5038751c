"""Laws that give the slips of a tire from the sliding of its contact point."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import sympy as sp

from vehiclemor.symbolic.tape import Tape

# Speed in m/s below which slips are damped, and that damping at standstill in s/m.
LOW_SPEED, LOW_SPEED_DAMPING = sp.Integer(2), sp.Rational(1, 50)


@dataclass(frozen=True)
class Slip:
    """Slips of a tire: kappa, the tangent of the slip angle, and rates of states behind them."""

    ratio: sp.Expr
    tangent: sp.Expr
    rates: tuple[sp.Expr, ...] = ()


# Tape, parameters, speed of the wheel along its heading, velocity of the contact point along the
# heading and to the left (m/s) -> slips.
SlipLaw = Callable[[Tape, Mapping[str, sp.Expr], sp.Expr, sp.Expr, sp.Expr], Slip]


def static_slip(
    tape: Tape,
    p: Mapping[str, sp.Expr],
    forward: sp.Expr,
    sliding_forward: sp.Expr,
    sliding_left: sp.Expr,
) -> Slip:
    """Slips that follow the sliding without delay."""
    speed = tape.let(sp.sqrt(tape.let(forward**2 + p["slip_speed"] ** 2)))
    return Slip(tape.let(-sliding_forward / speed), tape.let(sliding_left / speed))


def relaxed_slip(
    tape: Tape,
    p: Mapping[str, sp.Expr],
    forward: sp.Expr,
    sliding_forward: sp.Expr,
    sliding_left: sp.Expr,
    *,
    deflections: tuple[sp.Expr, sp.Expr],  # Of the contact, along the heading and to the left, m.
) -> Slip:
    """Slips by deflections of the contact, which relax over a distance.

    H. B. Pacejka, Tire and Vehicle Dynamics (3rd ed., 2012), chapters 7 and 8: a single contact
    point, with damping at low speed.  The distance is that of rolling and, at low speed, of
    sliding too: else a wheel that spins at standstill would wind its contact up without limit.
    """
    let = tape.let
    along, left = deflections
    ratio = let(along / p["longitudinal_relaxation"])
    tangent = let(left / p["lateral_relaxation"])
    slow = let(1 / (1 + let(forward / LOW_SPEED) ** 2))
    damping = let(LOW_SPEED_DAMPING * slow)
    slid = let(slow * let(sliding_forward**2 + sliding_left**2))
    speed = let(sp.sqrt(let(forward**2 + p["slip_speed"] ** 2 + slid)))
    rates = let(-sliding_forward - speed * ratio), let(sliding_left - speed * tangent)
    return Slip(
        let(ratio - damping * sliding_forward), let(tangent + damping * sliding_left), rates
    )
