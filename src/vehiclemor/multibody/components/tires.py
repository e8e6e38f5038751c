"""Wheels on the road as symbolic expressions: contact, vertical load, tire forces.

Fiala: E. Fiala, Seitenkraefte am rollenden Luftreifen, VDI-Zeitschrift 96 (1954), in the form of
MSC Adams/Tire and of the MapleSim Tire Library: friction falls with the combined slip.

Magic Formula in the form of PAC2002 without shifts, inclination and residual torque: H. B. Pacejka,
Tire and Vehicle Dynamics (3rd ed., Butterworth-Heinemann 2012), chapter 4; MSC Adams/Tire manual,
PAC2002.  Signs are those of ISO 8855 with a slip angle that is positive when the contact point
slides to the left.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import sympy as sp

from vehiclemor.multibody.components.body import WheelInputs
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic.geometry import Vector
from vehiclemor.symbolic.mechanics import ZERO, Body, kane
from vehiclemor.symbolic.tape import Tape

# Keeps 0/0 from a wheel without load and slip; nothing else notices it.
NOTHING = sp.Float(1e-300)
# Speed in m/s below which slips are damped, and that damping at standstill in s/m.
LOW_SPEED, LOW_SPEED_DAMPING = sp.Integer(2), sp.Rational(1, 50)


@dataclass(frozen=True)
class Slip:
    """Slips of a tire."""

    ratio: sp.Expr  # kappa
    tangent: sp.Expr  # Of the slip angle; sliding to the left is positive.
    rates: tuple[sp.Expr, ...] = ()  # Rates of the states that the slips follow from.


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


@dataclass(frozen=True)
class TireForces:
    """Longitudinal and lateral force (N) and aligning moment (N m) on the wheel."""

    longitudinal: sp.Expr
    lateral: sp.Expr
    aligning: sp.Expr


@dataclass(frozen=True)
class WheelMotion:
    """A wheel and how it moves, chassis components."""

    height: sp.Expr  # Of its centre above the plane z = 0 in m.
    axle: Vector  # Unit spin axis.
    velocity: Vector  # Of its centre.
    rotation: Vector  # Angular velocity.


@dataclass(frozen=True)
class WheelOnRoad:
    """What the road does to a wheel, chassis components."""

    tire: TireForces
    load: sp.Expr  # Vertical force in N, not negative.
    slip: Slip
    # Force on the wheel in N and its moment about the wheel centre in N m.
    force: Vector
    moment: Vector


@dataclass(frozen=True)
class Corner:
    """Bodies of a corner with what acts on them."""

    bodies: tuple[Body, ...]
    spring: sp.Expr  # Generalised force of the spring-damper on the coordinate that it acts on.
    wheel: WheelOnRoad
    shaft: Vector = ZERO  # Torque of a half shaft on the wheel in N m, the chassis bears it.


def kane_with_corners(
    tape: Tape, chassis: Body, corners: Sequence[Corner], springs: Sequence[int], speeds: int
) -> tuple[list[list[sp.Expr]], list[sp.Expr]]:
    """Mass matrix and forces of all bodies; springs act on the coordinates of these numbers."""
    for corner in corners:
        chassis = replace(chassis, moment=chassis.moment - corner.shaft)
    bodies = [chassis, *(part for corner in corners for part in corner.bodies)]
    mass, force = kane(tape, speeds, bodies)
    for number, corner in zip(springs, corners, strict=True):
        force[number] = tape.let(force[number] + corner.spring)
    return mass, force


def tire_outputs(tape: Tape, corners: Sequence[Corner]) -> list[sp.Expr]:
    """Outputs of the tires: forces, loads, moments, slip ratios and slip angles."""
    wheels = [corner.wheel for corner in corners]
    return [
        *(wheel.tire.longitudinal for wheel in wheels),
        *(wheel.tire.lateral for wheel in wheels),
        *(wheel.load for wheel in wheels),
        *(wheel.tire.aligning for wheel in wheels),
        *(wheel.slip.ratio for wheel in wheels),
        *(tape.let(sp.atan(wheel.slip.tangent)) for wheel in wheels),
    ]


def magic_formula(
    tape: Tape,
    # Coefficients, dimensionless, by their published names; `tire_radius`, unloaded, in m.
    c: Mapping[str, sp.Expr],
    # Vertical force and F_z0 in N.
    load: sp.Expr,
    reference_load: sp.Expr,
    # kappa, alpha in rad, and cos alpha.
    slip_ratio: sp.Expr,
    slip_angle: sp.Expr,
    cos_slip_angle: sp.Expr,
    friction: sp.Expr,  # Factor, not 0.
) -> TireForces:
    """Forces at combined slip; zero where the load is zero.

    Friction m acts by similarity (Pacejka, section 4.2): F = m F_1(kappa / m, alpha / m).
    If it scaled the peaks alone, combined slip would use 1.29 of the friction ellipse at m = 0.3.
    """
    let = tape.let
    d = let((load - reference_load) / reference_load)
    kappa, alpha = let(slip_ratio / friction), let(slip_angle / friction)
    grip = let(load * friction)

    # Longitudinal.  Stiffness and peak are per load, so that their quotient has no 0/0.
    peak = let(c["PDX1"] + c["PDX2"] * d)
    stiffness = let((c["PKX1"] + c["PKX2"] * d) * let(sp.exp(c["PKX3"] * d)))
    curvature = let(c["PEX1"] + d * (c["PEX2"] + c["PEX3"] * d))
    b = let(stiffness / (c["PCX1"] * peak))
    bent = let(c["PCX1"] * _arc(tape, let(b * kappa), curvature))
    longitudinal = let(let(grip * peak) * let(sp.sin(bent)))

    # Lateral: sin(2 arctan x) = 2 x / (1 + x^2).
    peak = let(c["PDY1"] + c["PDY2"] * d)
    curvature = let(c["PEY1"] + c["PEY2"] * d)
    x = let(load / (c["PKY2"] * reference_load))
    # K_y / F_z, finite at zero load.
    stiffness = let(2 * c["PKY1"] / (c["PKY2"] * (1 + x * x)))
    b = let(stiffness / (c["PCY1"] * peak))
    bent = let(c["PCY1"] * _arc(tape, let(b * alpha), curvature))
    lateral = let(let(grip * peak) * let(sp.sin(bent)))

    # Weights of combined slip: cos(arctan x) = 1 / sqrt(1 + x^2).
    b = let(c["RBX1"] / sp.sqrt(let(1 + (c["RBX2"] * kappa) ** 2)))
    bent = let(c["RCX1"] * _arc(tape, let(b * alpha), c["REX1"]))
    longitudinal = let(longitudinal * sp.cos(bent))
    b = let(c["RBY1"] / sp.sqrt(let(1 + (c["RBY2"] * alpha) ** 2)))
    bent = let(c["RCY1"] * _arc(tape, let(b * kappa), c["REY1"]))
    lateral = let(lateral * sp.cos(bent))

    # Pneumatic trail.
    b = let(c["QBZ1"] + d * (c["QBZ2"] + c["QBZ3"] * d))
    curvature = let(c["QEZ1"] + d * (c["QEZ2"] + c["QEZ3"] * d))
    longest = let(load * (c["tire_radius"] / reference_load) * (c["QDZ1"] + c["QDZ2"] * d))
    bent = let(c["QCZ1"] * _arc(tape, let(b * alpha), curvature))
    trail = let(longest * let(sp.cos(bent)) * cos_slip_angle)
    return TireForces(longitudinal, lateral, let(-trail * lateral))


def _arc(tape: Tape, x: sp.Expr, curvature: sp.Expr) -> sp.Expr:
    """Inner part of every formula: arctan(x - E (x - arctan x))."""
    inner = tape.let(x - curvature * (x - sp.atan(x)))
    return tape.let(sp.atan(inner))


def fiala(
    tape: Tape,
    c: Mapping[str, sp.Expr],  # Coefficients `FIALA`.
    load: sp.Expr,  # Vertical force in N.
    slip: Slip,
) -> TireForces:
    """Forces of the Fiala model; zero where the load is zero.

    Each force grows with its slip until the contact slides; the slips act on each other through
    the friction coefficient alone.
    """
    let = tape.let
    limit = _friction_force(tape, c, load, slip)

    # With w = kappa / max(|kappa|, kappa*) both cases of the law are one expression.
    critical = let(limit / (2 * c["longitudinal_slip_stiffness"]))
    inverse = let(1 / (maximum(tape, let(sp.Abs(slip.ratio)), critical) + NOTHING))
    longitudinal = let(let(limit * let(slip.ratio * inverse)) * let(1 - critical * inverse / 2))

    # With y = C tan(alpha) / max(3 U, C |tan(alpha)|) as well; H = 1 - |y|.
    drive, most = let(c["cornering_stiffness"] * slip.tangent), let(3 * limit)
    y = let(drive / (maximum(tape, most, let(sp.Abs(drive))) + NOTHING))
    size = let(sp.Abs(y))
    share, left = let(limit * y), let(1 - size)
    lateral = let(-share * let(3 - 3 * size + size * size))
    aligning = let(share * c["tire_width"] * let(left * left * left))
    return TireForces(longitudinal, lateral, aligning)


def brush(
    tape: Tape,
    c: Mapping[str, sp.Expr],  # Coefficients `FIALA`.
    load: sp.Expr,  # Vertical force in N.
    slip: Slip,
    friction: sp.Expr,  # Factor, not 0.
) -> TireForces:
    """Fiala's forces at combined slip: one force, along what the bristles are deflected.

    The brush model (Pacejka, section 3.2) with two stiffnesses.  Without longitudinal slip it is
    `fiala`, with both slips the friction is used once.
    """
    let = tape.let
    limit = let(friction * _friction_force(tape, c, load, slip))
    along = let(c["longitudinal_slip_stiffness"] * slip.ratio)
    across = let(c["cornering_stiffness"] * slip.tangent)
    # With s = |(X, Y)| and y = min(s / 3 L, 1), F = L (3 y - 3 y^2 + y^3) along (X, Y) / s: what
    # divides by s is written without it.
    size, most = let(sp.sqrt(let(along**2 + across**2))), let(3 * limit)
    inverse = let(1 / (maximum(tape, most, size) + NOTHING))
    y = let(size * inverse)
    share = let(limit * inverse)
    per_deflection, left = let(share * let(3 - 3 * y + y * y)), let(1 - y)
    arm = let(c["tire_width"] * let(left * left * left))
    return TireForces(
        let(along * per_deflection), let(-across * per_deflection), let(across * share * arm)
    )


def _friction_force(tape: Tape, c: Mapping[str, sp.Expr], load: sp.Expr, slip: Slip) -> sp.Expr:
    """Largest force in N of Fiala's tire, which falls with the combined slip."""
    let = tape.let
    combined = let(sp.sqrt(let(slip.ratio**2 + slip.tangent**2)))
    sliding = let(minimum(tape, combined, sp.Integer(1)))
    fall = let(c["largest_friction"] - c["smallest_friction"])
    return let(load * let(c["largest_friction"] - fall * sliding))


def maximum(tape: Tape, a: sp.Expr, b: sp.Expr) -> sp.Expr:
    """The larger of two values, without a branch."""
    return tape.let((a + b + sp.Abs(tape.let(a - b))) / 2)


def minimum(tape: Tape, a: sp.Expr, b: sp.Expr) -> sp.Expr:
    """The smaller of two values, without a branch."""
    return tape.let((a + b - sp.Abs(tape.let(a - b))) / 2)


def upright_wheel(
    tape: Tape,
    up: Vector,  # Road normal.
    wheel: WheelMotion,  # Its rotation is that of the rim, with the spin.
    p: Mapping[str, sp.Expr],  # Parameters of the vehicle.
    inputs: WheelInputs,
    slip_law: SlipLaw,
) -> WheelOnRoad:
    """A wheel whose effective radius is the height of its centre, with the Magic Formula.

    The vertical load has no arm.
    """
    let = tape.let
    above = let(wheel.height - inputs.road)
    along = g.named(tape, wheel.axle.cross(up))
    inverse = let(1 / g.length(tape, along))
    heading = g.named(tape, along * inverse)
    leftward = g.named(tape, up.cross(heading))
    arm = g.named(tape, up * -above)
    sliding = g.named(tape, wheel.velocity + wheel.rotation.cross(arm))
    forward = let(heading @ wheel.velocity)
    slip = slip_law(tape, p, forward, let(heading @ sliding), let(leftward @ sliding))
    rise = let(let(up @ wheel.velocity) - inputs.road_rate)
    cos_angle = let(1 / sp.sqrt(let(1 + slip.tangent**2)))
    slips = slip.ratio, let(sp.atan(slip.tangent)), cos_angle

    pressed = let(p["tire_stiffness"] * (p["tire_radius"] - above) - p["tire_damping"] * rise)
    load = let((pressed + sp.Abs(pressed)) / 2)
    reference_load = let(p["nominal_load"] * p["load_scale"])
    tire = magic_formula(tape, p, load, reference_load, *slips, inputs.friction)
    shear = g.named(tape, heading * tire.longitudinal + leftward * tire.lateral)
    moment = arm.cross(shear) + up * tire.aligning
    force = g.named(tape, shear + up * load)
    moment = g.named(tape, moment)
    return WheelOnRoad(tire, load, slip, force, moment)


def tilted_wheel(
    tape: Tape,
    up: Vector,  # Road normal.
    wheel: WheelMotion,  # Its rotation is that of the carrier, without the spin.
    spin: sp.Expr,  # Spin of the wheel on its carrier in rad/s.
    p: Mapping[str, sp.Expr],  # Parameters of the vehicle.
    inputs: WheelInputs,
    combined: bool,  # Whether forces are those of `brush`, else of `fiala`.
) -> WheelOnRoad:
    """A wheel with camber and Fiala's tire.

    The contact point is where the wheel's plane, through its centre and across its spin axis, meets
    the road; the loaded radius is also the effective rolling radius.
    """
    let = tape.let
    across = g.named(tape, wheel.axle.cross(up))
    # The length of axle x up is the cosine of the camber angle.
    inverse = let(1 / g.length(tape, across))
    heading = g.named(tape, across * inverse)
    leftward = g.named(tape, up.cross(heading))
    down = g.named(tape, wheel.axle.cross(heading))
    radius = let((wheel.height - inputs.road) * inverse)
    arm = g.named(tape, down * radius)
    sliding = g.named(tape, wheel.velocity + wheel.rotation.cross(arm))
    forward, lateral = let(sliding @ heading), let(sliding @ leftward)
    rise = let(let(sliding @ up) - inputs.road_rate)

    load = vertical_load(tape, radius, rise * inverse, p)
    per_speed = let(1 / maximum(tape, let(sp.Abs(forward)), p["slip_speed"]))
    slip = Slip(let(let(spin * radius - forward) * per_speed), let(lateral * per_speed))
    tire = brush(tape, p, load, slip, inputs.friction) if combined else fiala(tape, p, load, slip)
    force = g.named(tape, heading * tire.longitudinal + leftward * tire.lateral + up * load)
    moment = g.named(tape, arm.cross(force) + up * tire.aligning)
    return WheelOnRoad(tire, load, slip, force, moment)


def vertical_load(tape: Tape, radius: sp.Expr, rate: sp.Expr, p: Mapping[str, sp.Expr]) -> sp.Expr:
    """Vertical force of a wheel that pushes and never pulls, from its loaded radius and rate."""
    let = tape.let
    pressed = let(p["tire_radius"] - radius)
    elastic = let(let(p["tire_stiffness"] / 2) * (pressed + sp.Abs(pressed)))
    damping = let(-p["tire_damping"] * let(rate))
    total = let(elastic + minimum(tape, elastic, damping))
    return let((total + sp.Abs(total)) / 2)
