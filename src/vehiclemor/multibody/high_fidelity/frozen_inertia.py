"""The high-fidelity vehicle with its inertia frozen at the design position: 14 coordinates.

What makes the exact equations long is the inertia of sixteen bodies.  Here the mass matrix over the
speeds of the chassis, in its own axes, and of the arms is constant; gravity and inertial forces of
the moving parts are corrected to first order in the arms' angles.  Exact are the tires, the wheels
in space for given places on the chassis, and the wheels' own spin: with the spin in space as speed
its moment of inertia drops out of the mass matrix.  Places and axles of the front wheels are cubic
polynomials in the angle of the lower arm and the displacement of the rack (to its square), the
springs' lengths polynomials of degree 4 in their arm's angle; all coefficients are constants of the
kernels, see `reduction/vehicle/frozen_constants.py`.
"""

from collections.abc import Mapping, Sequence

import sympy as sp

from vehiclemor.multibody.components import body
from vehiclemor.multibody.high_fidelity import frozen_quantities as frozen
from vehiclemor.multibody.high_fidelity import frozen_wheels, independent, parts, quantities
from vehiclemor.multibody.quantities import WHEELS
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic.geometry import Vector
from vehiclemor.symbolic.mechanics import ZERO
from vehiclemor.symbolic.program import Program, assemble
from vehiclemor.symbolic.tape import Tape


def derive() -> Program:
    """Derive the derivatives and the full vehicle's state; parameters and constants are symbols."""
    tape = Tape()
    q, nu = body.symbols(frozen.COORDINATES), body.symbols(frozen.SPEEDS)
    rack = body.symbols(quantities.INPUTS)
    p, flat = parts.parameters()
    c = {name: sp.Symbol(f"c_{name}", real=True) for name in frozen.CONSTANTS}
    attitude = body.attitude(tape, q)
    chassis = body.rates(tape, attitude, nu)
    wheels, angles = [], []
    for k, name in enumerate(WHEELS):
        side = parts.SIDES[k]
        mirrored = side if name in WHEELS[:2] else 1
        angle, rate = mirrored * q[6 + k], mirrored * nu[6 + k]
        angles.append((angle, rate))
        make = frozen_wheels.front_place if k < 2 else frozen_wheels.rear_place
        place = make(tape, c, angle, rate, rack, side)
        end = frozen.ENDS[k // 2]
        wheels.append(
            frozen_wheels.wheel_on_road(
                tape, place, attitude.road_normal, q[2], nu, nu[10 + k], p, end
            )
        )
    changes = _changes(tape, c, p, nu, wheels, angles, attitude.road_normal)
    own = [tape.let(nu[10 + k] - wheel.turn) for k, wheel in enumerate(wheels)]
    derivative = [*chassis, *nu[6:10], *own, *changes, *(wheel.spin for wheel in wheels)]
    return assemble(
        tape,
        {"x": [*q, *nu], "u": rack},
        [*flat, *c.values()],
        {
            "derivative": (derivative, (2 * frozen.N,)),
            "full_state": (
                _full_state(tape, q, nu, chassis, rack, p),
                (2 * len(quantities.COORDINATES),),
            ),
        },
    )


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
    corners, motions = independent.closed_corners(tape, q, nu, rack, points)
    turns = independent.carrier_turns(g.vector(nu[3:6]), corners, motions, nu)
    spins = [tape.let(nu[10 + k] - turn) for k, turn in enumerate(turns)]
    rates = [*chassis, *nu[6:10], *spins]
    return independent.full_state(tape, q, rates, corners, motions)


def _changes(
    tape: Tape,
    c: Mapping[str, sp.Expr],
    p: Mapping[str, sp.Expr],
    nu: Sequence[sp.Expr],
    wheels: Sequence[frozen_wheels.Wheel],
    angles: Sequence[tuple[sp.Expr, sp.Expr]],
    up: Vector,
) -> list[sp.Expr]:
    """Derivatives of the speeds of chassis and arms."""
    let = tape.let
    turning = g.vector(nu[3:6])
    force = g.named(tape, [sp.Add(*[wheel.force[i] for wheel in wheels]) for i in range(3)])
    moment = [sp.Add(*[wheel.moment[i] for wheel in wheels]) for i in range(3)]
    # The acceleration that everything has, beside which the others are small.
    common = g.named(tape, force * let(1 / c["total_mass"]))

    arms = []
    moved = ZERO
    for k, (wheel, (angle, rate)) in enumerate(zip(wheels, angles, strict=True)):
        end, side = frozen.ENDS[k // 2], parts.SIDES[k]
        first, second = (
            Vector(c[f"{end}_{order}_x"], side * c[f"{end}_{order}_y"], c[f"{end}_{order}_z"])
            for order in ("first", "second")
        )
        moved = moved + first * angle
        pull = _spring(tape, c, p, end, angle, rate)
        arms.append(let(wheel.arm + pull - angle * let(second @ common)))
    moved = g.named(tape, moved)

    # Inertial forces of the rigid vehicle.
    offset = g.vector((c["offset_x"], 0, c["offset_z"]))
    swept = g.named(tape, turning.cross(offset))
    tensor = (
        g.vector((c["tensor_xx"], 0, c["tensor_xz"])),
        g.vector((0, c["tensor_yy"], 0)),
        g.vector((c["tensor_xz"], 0, c["tensor_zz"])),
    )
    momentum = g.named(tape, [row @ turning for row in tensor])
    loads = [
        *force - turning.cross(swept),
        *g.vector(moment) - (turning.cross(momentum) + moved.cross(common)),
    ]
    loads = [let(load) for load in loads]
    result: dict[int, sp.Expr] = {}
    halves = []
    for family, places, sign in zip(frozen.FAMILIES, frozen.FAMILY_CHASSIS, (1, -1), strict=True):
        right = [*(loads[i] for i in places)]
        right += [let(arms[2 * e] + sign * arms[2 * e + 1]) for e in range(2)]
        rows = [
            let(sp.Add(*[c[f"{family}_{max(i, j)}{min(i, j)}"] * right[j] for j in range(5)]))
            for i in range(5)
        ]
        result |= dict(zip(places, rows[:3], strict=True))
        halves.append(rows[3:])
    # Gravity and the turning axes accelerate the chassis' speeds alike.
    falling = turning.cross(g.vector(nu[:3])) + up * p["gravity"]
    linear = g.vector([result[i] for i in range(3)]) - falling
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
    coefficients = [c[f"{end}_spring_{i}"] for i in range(frozen.SPRING_DEGREE + 1)]
    length = frozen_wheels.horner(tape, coefficients, angle)
    lever = frozen_wheels.horner(tape, frozen_wheels.slope(coefficients), angle)
    damping = tape.let(p[f"{end}_damping"] * tape.let(lever * rate))
    compression = tape.let(p[f"{end}_free_length"] - length)
    return tape.let(tape.let(p[f"{end}_stiffness"] * compression - damping) * lever)
