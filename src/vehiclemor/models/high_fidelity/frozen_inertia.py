"""The high-fidelity vehicle with its inertia frozen at the design position: 14 coordinates.

What makes the exact equations long is the inertia of sixteen bodies.  Here the mass matrix over the
speeds of the chassis, in its own axes, and of the arms is constant; gravity and inertial forces of
the moving parts are corrected to first order in the arms' angles.  Exact are the tires, the wheels
in space for given places on the chassis, and the wheels' own spin: with the spin in space as speed
its moment of inertia drops out of the mass matrix.  Places and axles of the front wheels are cubic
polynomials in the angle of the lower arm and the displacement of the rack (to its square), the
springs' lengths polynomials of degree 4 in their arm's angle; all coefficients are constants of the
kernels, see `simulation/frozen_inertia.py`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from vehiclemor.models.components import body, tilted_wheel
from vehiclemor.models.components.tires import fiala, maximum
from vehiclemor.models.equations import DynamicEquations
from vehiclemor.models.high_fidelity import closed_corner, independent, parts
from vehiclemor.models.high_fidelity.quantities import COORDINATES as ALL_COORDINATES
from vehiclemor.models.high_fidelity.quantities import INPUTS
from vehiclemor.models.quantities import CHASSIS_SPEEDS, WHEELS, per_wheel
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic.geometry import Vector
from vehiclemor.symbolic.mechanics import UNIT, ZERO
from vehiclemor.symbolic.program import assemble
from vehiclemor.symbolic.tape import Tape

COORDINATES = independent.COORDINATES
SPEEDS = (
    *CHASSIS_SPEEDS,
    *independent.SPEEDS[6:10],
    *per_wheel("spin", "rad/s", "angular velocity of the {} wheel in space about its axle"),
)
N = len(COORDINATES)
DEGREE = 3
SPRING_DEGREE = 4
# Exponents (of the arm's angle, of the rack's displacement).
RACK_DEGREE = 2
MONOMIALS = tuple(
    (i, j) for i in range(DEGREE + 1) for j in range(min(RACK_DEGREE, DEGREE - i) + 1)
)
# The axle is a unit vector: two components give the third.
FRONT_MAPS = (*(f"front_centre_{axis}" for axis in "xyz"), "front_axle_x", "front_axle_z")
REAR_MAPS = ("rear_centre_x", "rear_centre_z")
SPRING_MAPS = ("front_spring", "rear_spring")
ENDS = ("front", "rear")
# Unknowns of motions that are their own mirror image, then of those that reverse: three chassis
# speeds and the mean, or half the difference, of both front and of both rear arms.
FAMILIES = ("even", "odd")
FAMILY_CHASSIS = ((0, 2, 4), (1, 3, 5))


def _names() -> list[str]:
    """Names of the constants that `frozen_constants` gives, in order."""
    names = [f"{name}_{i}_{j}" for name in FRONT_MAPS for i, j in MONOMIALS]
    names += [f"{name}_{i}" for name in REAR_MAPS for i in range(DEGREE + 1)]
    names += [f"{name}_{i}" for name in SPRING_MAPS for i in range(SPRING_DEGREE + 1)]
    names += ["rear_centre_y", "turn_by_arm", "turn_by_rack", "total_mass"]
    names += ["offset_x", "offset_z", "tensor_xx", "tensor_yy", "tensor_zz", "tensor_xz"]
    names += [f"{end}_first_{axis}" for end in ENDS for axis in "xyz"]
    names += [f"{end}_second_{axis}" for end in ENDS for axis in "xyz"]
    names += [f"{f}_{i}{j}" for f in FAMILIES for i in range(5) for j in range(i + 1)]
    return names


CONSTANTS = tuple(_names())


@dataclass(frozen=True)
class _Wheel:
    """A wheel with what it does to the chassis and to its arm.

    Attributes
    ----------
    force, moment
        On the chassis, the moment about its origin.
    arm
        Generalised force on the arm, of the mirrored angle on the right side.
    spin
        Derivative of the spin in space.
    turn
        Angular velocity of the carrier or arm about the axle.
    """

    force: Vector
    moment: Vector
    arm: sp.Expr
    spin: sp.Expr
    turn: sp.Expr


@dataclass(frozen=True)
class _Place:
    """Wheel centre and axle on the chassis, their derivatives by the arm's angle, their rates."""

    centre: Vector
    axle: Vector
    centre_by_arm: Vector
    axle_by_arm: Vector
    centre_rate: Vector
    axle_rate: Vector
    turn: sp.Expr


def derive() -> DynamicEquations:
    """Derive the derivatives and the full vehicle's state; parameters and constants are symbols."""
    tape = Tape()
    q, nu = body.symbols(COORDINATES), body.symbols(SPEEDS)
    rack = body.symbols(INPUTS)
    p, flat = parts.parameters()
    c = {name: sp.Symbol(f"c_{name}", real=True) for name in CONSTANTS}
    attitude = body.attitude(tape, q)
    chassis = body.rates(tape, attitude, nu)
    wheels, angles = [], []
    for k, name in enumerate(WHEELS):
        side = parts.SIDES[k]
        mirrored = side if name in WHEELS[:2] else 1
        angle, rate = mirrored * q[6 + k], mirrored * nu[6 + k]
        angles.append((angle, rate))
        make = _front_place if k < 2 else _rear_place
        place = make(tape, c, angle, rate, rack, side)
        end = ENDS[k // 2]
        wheels.append(_wheel(tape, place, attitude.road_normal, q[2], nu, nu[10 + k], p, end))
    changes = _changes(tape, c, p, nu, wheels, angles, attitude.road_normal)
    own = [tape.let(nu[10 + k] - wheel.turn) for k, wheel in enumerate(wheels)]
    derivative = [*chassis, *nu[6:10], *own, *changes, *(wheel.spin for wheel in wheels)]
    program = assemble(
        tape,
        {"x": [*q, *nu], "u": rack},
        [*flat, *c.values()],
        {
            "derivative": (derivative, (2 * N,)),
            "full_state": (
                _full_state(tape, q, nu, chassis, rack, p),
                (2 * len(ALL_COORDINATES),),
            ),
        },
    )
    return DynamicEquations(COORDINATES, SPEEDS, INPUTS, (), program)


def _full_state(
    tape: Tape,
    q: Sequence[sp.Symbol],
    nu: Sequence[sp.Symbol],
    chassis: Sequence[sp.Expr],
    rack: Sequence[sp.Symbol],
    p: Mapping[str, sp.Expr],
) -> list[sp.Expr]:
    """State of the full vehicle with the same independent coordinates and speeds."""
    points = parts.design_points(tape, p)
    turning = g.vector(nu[3:6])
    corners, motions, turns = [], [], []
    for k in range(2):
        corner = closed_corner.closed(tape, q[6 + k], rack[0], points[k], parts.SIDES[k])
        moved = (rack[1], rack[2])
        motion = closed_corner.motions(tape, corner, 6 + k, nu[6 + k], moved, points[k])
        axle = g.vector([row[1] for row in corner.linkage.carrier])
        turns.append(g.dot(axle, g.add(turning, motion.bodies.carrier.value)))
        corners.append(corner)
        motions.append(motion)
    turns += [turning[1] + nu[8], turning[1] + nu[9]]
    spins = [tape.let(nu[10 + k] - turn) for k, turn in enumerate(turns)]
    rates = [*chassis, *nu[6:10], *spins]
    return independent.full_state(tape, q, rates, corners, motions)


def _horner(tape: Tape, coefficients: Sequence[sp.Expr], x: sp.Expr) -> sp.Expr:
    value = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        value = tape.let(coefficient + x * value)
    return value


def _slope(coefficients: Sequence[sp.Expr]) -> list[sp.Expr]:
    """Coefficients of the derivative of a polynomial."""
    return [k * coefficient for k, coefficient in enumerate(coefficients)][1:]


def _front_place(
    tape: Tape,
    c: Mapping[str, sp.Expr],
    angle: sp.Expr,
    rate: sp.Expr,
    rack: Sequence[sp.Expr],
    side: int,
) -> _Place:
    """A front wheel on the chassis; on the right side it is the mirror image of the left one."""
    let = tape.let
    s, s_dot = side * rack[0], side * rack[1]
    values, by_arm, rates = [], [], []
    for name in FRONT_MAPS:
        # Polynomials in the rack's displacement, whose values are coefficients of the angle.
        rows = [
            [c[f"{name}_{i}_{j}"] for power, j in MONOMIALS if power == i]
            for i in range(DEGREE + 1)
        ]
        at_rack = [_horner(tape, row, s) for row in rows]
        values.append(_horner(tape, at_rack, angle))
        by_arm.append(_horner(tape, [let(e) for e in _slope(at_rack)], angle))
        # The rack moves slowly: its share of the rate to first order.
        by_rack = let(rows[0][1] + 2 * rows[0][2] * s + rows[1][1] * angle)
        rates.append(let(by_arm[-1] * rate + by_rack * s_dot))

    def centre(v: Sequence[sp.Expr]) -> Vector:
        return v[0], side * v[1], v[2]

    def axle(x: sp.Expr, y: sp.Expr, z: sp.Expr) -> Vector:
        # It points to the left on both sides.
        return side * x, y, side * z

    # The axle is a unit vector near y: to fourth order of its other components.
    x, z = values[3:]
    small = let(1 - (x**2 + z**2) / 2)
    along = [let(-(x * v[3] + z * v[4])) for v in (by_arm, rates)]
    turn = let(c["turn_by_arm"] * rate + c["turn_by_rack"] * s_dot)
    return _Place(
        centre(values),
        axle(x, small, z),
        centre(by_arm),
        axle(by_arm[3], along[0], by_arm[4]),
        centre(rates),
        axle(rates[3], along[1], rates[4]),
        turn,
    )


def _rear_place(
    tape: Tape,
    c: Mapping[str, sp.Expr],
    angle: sp.Expr,
    rate: sp.Expr,
    rack: Sequence[sp.Expr],
    side: int,
) -> _Place:
    """A rear wheel on the chassis; its axle keeps its direction."""
    del rack
    x, z = ([c[f"{name}_{i}"] for i in range(DEGREE + 1)] for name in REAR_MAPS)
    centre = (_horner(tape, x, angle), side * c["rear_centre_y"], _horner(tape, z, angle))
    by_arm = (
        _horner(tape, _slope(x), angle),
        sp.Integer(0),
        _horner(tape, _slope(z), angle),
    )
    rates = g.named(tape, g.scale(rate, by_arm))
    return _Place(centre, UNIT[1], by_arm, ZERO, rates, ZERO, rate)


def _wheel(
    tape: Tape,
    place: _Place,
    up: Vector,
    height: sp.Expr,
    nu: Sequence[sp.Expr],
    spin: sp.Expr,
    p: Mapping[str, sp.Expr],
    end: str,
) -> _Wheel:
    """Tire forces and the wheel's gyroscopic moment, as they act on chassis, arm and wheel.

    The contact is that of `tilted_wheel`, in the directions of heading, axle and road normal.
    """
    let, axle = tape.let, place.axle
    turning = g.vector(nu[3:6])
    tilt = let(g.dot(axle, up))
    # The axle is a unit vector; the cosine is that of the camber angle.
    cosine = let(sp.sqrt(let(1 - tilt**2)))
    inverse = let(1 / cosine)
    heading = g.named(tape, g.scale(inverse, g.cross(axle, up)))
    radius = let((height + g.dot(up, place.centre)) * inverse)
    velocity = g.named(
        tape, g.add(g.vector(nu[:3]), g.add(g.cross(turning, place.centre), place.centre_rate))
    )
    # The axle's change gives the part of the carrier's rotation across the axle; that about it
    # is in the spin.
    change = g.named(tape, g.add(g.cross(turning, axle), place.axle_rate))
    rise, tilting = let(g.dot(velocity, up)), let(g.dot(change, up))
    turn = let(g.dot(turning, axle) + place.turn)
    ahead = let(g.dot(velocity, heading))
    forward = let(ahead - radius * turn)
    lateral = let((g.dot(velocity, axle) - tilt * rise) * inverse + radius * tilting)
    rate = let(rise + let(radius * tilt) * let(tilting * inverse)) * inverse
    load = tilted_wheel.vertical_load(tape, radius, rate, p)
    per_speed = let(1 / maximum(tape, let(sp.Abs(forward)), p["slip_speed"]))
    slip = let(let(spin * radius - ahead) * per_speed)
    tire = fiala(tape, p, load, slip, let(lateral * per_speed))

    # Force in the directions of heading, axle and normal; the leftward direction is
    # (axle - tilt normal) / cosine.
    sideways = let(tire.lateral * inverse)
    upwards = let(load - sideways * tilt)
    force = g.named(
        tape,
        g.add(
            g.scale(tire.longitudinal, heading),
            g.add(g.scale(sideways, axle), g.scale(upwards, up)),
        ),
    )
    # Moment about the wheel centre, without its part about the axle, which turns the wheel.
    along = let(tire.lateral * cosine + load * tilt)
    rolling, twist = let(radius * along), tire.aligning
    momentum = let(p[f"{end}_wheel_spin_inertia"] * spin)
    free = g.add(g.scale(rolling, heading), g.scale(twist, g.subtract(up, g.scale(tilt, axle))))
    free = g.named(tape, g.subtract(free, g.scale(momentum, change)))
    on_arm = g.dot(force, place.centre_by_arm)
    if place.axle_by_arm != ZERO:
        # The axle turns with its arm about axle x (its derivative).
        on_arm += g.dot(place.axle_by_arm, g.named(tape, g.cross(free, axle)))
    moment = g.add(free, g.cross(place.centre, force))
    driving = let(twist * tilt - radius * tire.longitudinal)
    return _Wheel(
        force,
        g.named(tape, moment),
        let(on_arm),
        let(driving * let(1 / p[f"{end}_wheel_spin_inertia"])),
        turn,
    )


def _changes(
    tape: Tape,
    c: Mapping[str, sp.Expr],
    p: Mapping[str, sp.Expr],
    nu: Sequence[sp.Expr],
    wheels: Sequence[_Wheel],
    angles: Sequence[tuple[sp.Expr, sp.Expr]],
    up: Vector,
) -> list[sp.Expr]:
    """Derivatives of the speeds of chassis and arms."""
    let = tape.let
    turning = g.vector(nu[3:6])
    force = g.named(tape, [sp.Add(*[wheel.force[i] for wheel in wheels]) for i in range(3)])
    moment = [sp.Add(*[wheel.moment[i] for wheel in wheels]) for i in range(3)]
    # The acceleration that everything has, beside which the others are small.
    common = g.named(tape, g.scale(let(1 / c["total_mass"]), force))

    arms = []
    moved = ZERO
    for k, (wheel, (angle, rate)) in enumerate(zip(wheels, angles, strict=True)):
        end, side = ENDS[k // 2], parts.SIDES[k]
        first, second = (
            (
                c[f"{end}_{order}_x"],
                side * c[f"{end}_{order}_y"],
                c[f"{end}_{order}_z"],
            )
            for order in ("first", "second")
        )
        moved = g.add(moved, g.scale(angle, first))
        pull = _spring(tape, c, p, end, angle, rate)
        arms.append(let(wheel.arm + pull - angle * let(g.dot(second, common))))
    moved = g.named(tape, moved)

    # Inertial forces of the rigid vehicle.
    offset = g.vector((c["offset_x"], 0, c["offset_z"]))
    swept = g.named(tape, g.cross(turning, offset))
    tensor = (
        (c["tensor_xx"], sp.Integer(0), c["tensor_xz"]),
        (sp.Integer(0), c["tensor_yy"], sp.Integer(0)),
        (c["tensor_xz"], sp.Integer(0), c["tensor_zz"]),
    )
    momentum = g.named(tape, [g.dot(row, turning) for row in tensor])
    loads = [
        *g.subtract(force, g.cross(turning, swept)),
        *g.subtract(g.vector(moment), g.add(g.cross(turning, momentum), g.cross(moved, common))),
    ]
    loads = [let(load) for load in loads]
    result: dict[int, sp.Expr] = {}
    halves = []
    for family, places, sign in zip(FAMILIES, FAMILY_CHASSIS, (1, -1), strict=True):
        right = [*(loads[i] for i in places)]
        right += [let(arms[2 * e] + sign * arms[2 * e + 1]) for e in range(2)]
        rows = [
            let(sp.Add(*[c[f"{family}_{max(i, j)}{min(i, j)}"] * right[j] for j in range(5)]))
            for i in range(5)
        ]
        result |= dict(zip(places, rows[:3], strict=True))
        halves.append(rows[3:])
    # Gravity and the turning axes accelerate the chassis' speeds alike.
    falling = g.add(g.cross(turning, g.vector(nu[:3])), g.scale(p["gravity"], up))
    linear = g.subtract(g.vector([result[i] for i in range(3)]), falling)
    even, odd = halves
    return [
        *g.named(tape, linear),
        *(result[i] for i in range(3, 6)),
        let(even[0] + odd[0]),
        let(odd[0] - even[0]),
        let(even[1] + odd[1]),
        let(even[1] - odd[1]),
    ]


def _spring(
    tape: Tape,
    c: Mapping[str, sp.Expr],
    p: Mapping[str, sp.Expr],
    end: str,
    angle: sp.Expr,
    rate: sp.Expr,
) -> sp.Expr:
    """Generalised force of a spring-damper on its arm."""
    coefficients = [c[f"{end}_spring_{i}"] for i in range(SPRING_DEGREE + 1)]
    length = _horner(tape, coefficients, angle)
    lever = _horner(tape, _slope(coefficients), angle)
    damping = tape.let(p[f"{end}_damping"] * tape.let(lever * rate))
    compression = tape.let(p[f"{end}_free_length"] - length)
    return tape.let(tape.let(p[f"{end}_stiffness"] * compression - damping) * lever)
