"""Equations of the 14-DOF vehicle: Kane's equations of its five bodies and four spinning wheels."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import sympy as sp

from vehiclemor.multibody.components import body
from vehiclemor.multibody.components.tire_coefficients import MAGIC_FORMULA
from vehiclemor.multibody.components.tires import TireForces, magic_formula, tire_outputs
from vehiclemor.multibody.independent_suspension.equilibrium import Derived, derived
from vehiclemor.multibody.quantities import declared
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import joints, mechanics
from vehiclemor.symbolic.elimination import eliminate_symmetric
from vehiclemor.symbolic.program import Program, assemble
from vehiclemor.symbolic.tape import Tape

DECLARED = declared("independent_suspension_vehicle")


def derive() -> Program:
    """Derive state derivatives, outputs and the second-order form; parameters stay symbols."""
    tape = Tape()
    q = body.symbols(DECLARED["coordinates"])
    nu = body.symbols(DECLARED["speeds"])
    (delta,) = body.symbols(DECLARED["inputs"])
    p = {name: sp.Symbol(f"p_{name}", real=True) for name in DECLARED["parameters"]}
    attitude = body.attitude(tape, q)
    vehicle = _vehicle(tape, q, nu, delta, p, attitude)
    sprung = _sprung_body(tape, vehicle)
    wheels = [_wheel(tape, vehicle, number) for number in range(4)]
    mass, force = mechanics.kane(
        tape, len(DECLARED["speeds"]), [sprung, *(wheel.rigid for wheel in wheels)]
    )
    for number, wheel in enumerate(wheels):
        force[6 + number] = tape.let(force[6 + number] - wheel.spring)
    # Spins and travels couple to the chassis alone: what is left of it is 6 x 6.
    order = [*range(10, 14), *range(6, 10), *range(6)]
    accelerations = eliminate_symmetric(tape, mass, force, order)
    rates = [*body.rates(tape, attitude, nu), *nu[6:]]
    second_order = body.in_coordinates(tape, attitude, nu, mass, force)
    outputs = [
        *body.outputs(q, nu),
        *tire_outputs(
            [wheel.tire for wheel in wheels],
            [wheel.load for wheel in wheels],
            [wheel.contact.slip_ratio for wheel in wheels],
            [wheel.contact.slip_angle for wheel in wheels],
        ),
    ]
    n = len(DECLARED["coordinates"])
    return assemble(
        tape,
        {"x": [*q, *nu], "u": [delta]},
        list(p.values()),
        {
            "derivative": ([*rates, *accelerations], (2 * n,)),
            "outputs": (outputs, (len(DECLARED["outputs"]),)),
            "second_order": (second_order, (n, n + 1)),
            "speeds": ([*body.speeds(tape, attitude, nu), *nu[6:]], (n,)),
        },
    )


@dataclass(frozen=True)
class _Vehicle:
    """The sprung body on the road, with what its wheels need of it."""

    frame: mechanics.MovingFrame
    attitude: body.Attitude
    weight: g.Vector  # Acceleration of gravity, chassis components.
    q: list[sp.Symbol]
    nu: list[sp.Symbol]
    delta: sp.Symbol
    p: dict[str, sp.Symbol]
    # What follows from the parameters; distances, depths and preloads stand on the tape.
    named: Derived


class _Wheel(NamedTuple):
    """A wheel with what acts on it, and the force of its spring."""

    rigid: mechanics.Body
    spring: sp.Expr
    contact: body.Contact
    load: sp.Expr
    tire: TireForces


def _vehicle(
    tape: Tape,
    q: list[sp.Symbol],
    nu: list[sp.Symbol],
    delta: sp.Symbol,
    p: dict[str, sp.Symbol],
    attitude: body.Attitude,
) -> _Vehicle:
    """The sprung body on the road."""
    d = derived(p)
    frame = mechanics.MovingFrame(g.vector(nu[:3]), g.vector(nu[3:6]), first=0)

    def pair(values: tuple[sp.Expr, sp.Expr]) -> tuple[sp.Expr, sp.Expr]:
        return tape.let(values[0]), tape.let(values[1])

    named = replace(
        d, sprung_distance=pair(d.sprung_distance), depth=pair(d.depth), preload=pair(d.preload)
    )
    weight = attitude.road_normal * -p["gravity"]
    return _Vehicle(frame, attitude, weight, q, nu, delta, p, named)


def _sprung_body(tape: Tape, v: _Vehicle) -> mechanics.Body:
    xz = -v.p["product_of_inertia"]
    inertia = (
        g.vector((v.p["roll_inertia"], 0, xz)),
        g.vector((0, v.p["pitch_inertia"], 0)),
        g.vector((xz, 0, tape.let(v.named.yaw_inertia))),
    )
    mass = v.p["sprung_mass"]
    origin = v.frame.origin(tape)
    rotation = v.frame.rotation(tape, inertia)
    return mechanics.Body(mass, origin, v.weight * mass, rotation, inertia)


def _wheel(tape: Tape, v: _Vehicle, wheel: int) -> _Wheel:
    """A wheel of number 0 to 3 with its load, tire and spring."""
    p, d, frame, front = v.p, v.named, v.frame, wheel < 2
    end, side = (0, "front") if front else (1, "rear")
    travel, rate, spin = v.q[6 + wheel], v.nu[6 + wheel], v.nu[10 + wheel]
    track = p[f"{side}_track"]
    place = g.vector(
        (
            d.sprung_distance[0] if front else -d.sprung_distance[1],
            tape.let(track / 2 if wheel % 2 == 0 else -track / 2),
            tape.let(travel - d.depth[end]),
        )
    )
    steer = (tape.let(sp.sin(v.delta)), tape.let(sp.cos(v.delta)))
    axle = g.vector((-steer[0], steer[1], 0) if front else (0, 1, 0))
    upwards = joints.along(joints.free_rate(6 + wheel, rate), mechanics.UNIT[2])
    centre = frame.point(tape, place, upwards)
    about = mechanics.axisymmetric_inertia(p["spin_inertia"], p["diametral_inertia"], axle)
    rotation = frame.rotation(tape, about, spin=(10 + wheel, spin, axle))
    contact = body.contact(
        tape, v.attitude, v.q[2], place, axle, centre.value, rotation.value, p["slip_speed"]
    )
    deflection = p["tire_stiffness"] * (p["tire_radius"] - contact.height)
    pressed = tape.let(deflection - p["tire_damping"] * contact.rise)
    load = tape.let((pressed + sp.Abs(pressed)) / 2)
    tire = magic_formula(
        tape,
        {name: p[name] for name in MAGIC_FORMULA},
        load,
        tape.let(d.reference_load),
        p["tire_radius"],
        contact.slip_ratio,
        contact.slip_angle,
        contact.cos_slip_angle,
    )
    force, moment = _loads(tape, contact, v.attitude.road_normal, load, tire)
    mass = p["unsprung_mass"]
    whole = g.named(tape, force + v.weight * mass)
    spring = d.preload[end] + p[f"{side}_stiffness"] * travel + p[f"{side}_damping"] * rate
    return _Wheel(
        mechanics.Body(mass, centre, whole, rotation, about, moment),
        tape.let(spring),
        contact,
        load,
        tire,
    )


def _loads(
    tape: Tape, contact: body.Contact, up: g.Vector, load: sp.Expr, tire: TireForces
) -> tuple[g.Vector, g.Vector]:
    """Force on a wheel and its moment about the wheel centre; the vertical load has no arm."""
    shear = g.named(tape, contact.heading * tire.longitudinal + contact.leftward * tire.lateral)
    arm = g.named(tape, up * -contact.height)
    moment = arm.cross(shear) + up * tire.aligning
    return g.named(tape, shear + up * load), g.named(tape, moment)
