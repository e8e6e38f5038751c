"""Equations of the 14-DOF vehicle: Kane's equations of its five bodies and four spinning wheels."""

import sympy as sp

from vehiclemor.models.components import body
from vehiclemor.models.components.tire_coefficients import MAGIC_FORMULA
from vehiclemor.models.components.tires import TireForces, magic_formula
from vehiclemor.models.equations import DynamicEquations
from vehiclemor.models.independent_suspension.equilibrium import derived
from vehiclemor.models.independent_suspension.quantities import (
    COORDINATES,
    FRONT,
    INPUTS,
    LEFT,
    OUTPUTS,
    PARAMETERS,
    SPEEDS,
)
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import joints, mechanics
from vehiclemor.symbolic.elimination import eliminate_symmetric
from vehiclemor.symbolic.program import assemble
from vehiclemor.symbolic.tape import Tape


def derive() -> DynamicEquations:
    """Derive state derivatives, outputs and the second-order form; parameters stay symbols."""
    tape = Tape()
    q = body.symbols(COORDINATES)
    nu = body.symbols(SPEEDS)
    (delta,) = body.symbols(INPUTS)
    p = {name: sp.Symbol(f"p_{name}", real=True) for name in PARAMETERS}
    attitude = body.attitude(tape, q)
    bodies, springs, outputs = _bodies(tape, q, nu, delta, p, attitude)
    mass, force = mechanics.kane(tape, len(SPEEDS), bodies)
    for wheel, spring in enumerate(springs):
        force[6 + wheel] = tape.let(force[6 + wheel] - spring)
    # Spins and travels couple to the chassis alone: what is left of it is 6 x 6.
    order = [*range(10, 14), *range(6, 10), *range(6)]
    accelerations = eliminate_symmetric(tape, mass, force, order)
    rates = [*body.rates(tape, attitude, nu), *nu[6:]]
    second_order = body.in_coordinates(tape, attitude, nu, mass, force)
    n = len(COORDINATES)
    program = assemble(
        tape,
        {"x": [*q, *nu], "u": [delta]},
        list(p.values()),
        {
            "derivative": ([*rates, *accelerations], (2 * n,)),
            "outputs": (outputs, (len(OUTPUTS),)),
            "second_order": (second_order, (n, n + 1)),
            "speeds": ([*body.speeds(tape, attitude, nu), *nu[6:]], (n,)),
        },
    )
    return DynamicEquations(COORDINATES, SPEEDS, INPUTS, OUTPUTS, program)


def _bodies(
    tape: Tape,
    q: list[sp.Symbol],
    nu: list[sp.Symbol],
    delta: sp.Symbol,
    p: dict[str, sp.Symbol],
    attitude: body.Attitude,
) -> tuple[list[mechanics.Body], list[sp.Expr], list[sp.Expr]]:
    """Sprung body and wheels with their loads, spring forces, outputs."""
    d, up = derived(p), attitude.road_normal
    frame = mechanics.MovingFrame(g.vector(nu[:3]), g.vector(nu[3:6]), first=0)

    def named_pair(values: tuple[sp.Expr, sp.Expr]) -> tuple[sp.Expr, sp.Expr]:
        return tape.let(values[0]), tape.let(values[1])

    distance, depth, preload = map(named_pair, (d.sprung_distance, d.depth, d.preload))
    xz = -p["product_of_inertia"]
    inertia = (
        g.vector((p["roll_inertia"], 0, xz)),
        g.vector((0, p["pitch_inertia"], 0)),
        g.vector((xz, 0, tape.let(d.yaw_inertia))),
    )
    weight = g.scale(-p["gravity"], up)
    bodies = [
        mechanics.Body(
            p["sprung_mass"],
            frame.origin(tape),
            g.scale(p["sprung_mass"], weight),
            frame.rotation(tape, inertia),
            inertia,
        )
    ]
    springs, forces, loads, slips = [], [], [], []
    for wheel, (front, left) in enumerate(zip(FRONT, LEFT, strict=True)):
        end = 0 if front else 1
        track = p["front_track"] if front else p["rear_track"]
        travel, rate, spin = q[6 + wheel], nu[6 + wheel], nu[10 + wheel]
        place = g.vector(
            (
                distance[0] if front else -distance[1],
                tape.let(track / 2 if left else -track / 2),
                tape.let(travel - depth[end]),
            )
        )
        steer = (tape.let(sp.sin(delta)), tape.let(sp.cos(delta)))
        axle = g.vector((-steer[0], steer[1], 0) if front else (0, 1, 0))
        centre = frame.point(
            tape, place, joints.along(joints.free_rate(6 + wheel, rate), mechanics.UNIT[2])
        )
        about = mechanics.axisymmetric_inertia(p["spin_inertia"], p["diametral_inertia"], axle)
        rotation = frame.rotation(tape, about, spin=(10 + wheel, spin, axle))
        contact = body.contact(
            tape, attitude, q[2], place, axle, centre.value, rotation.value, p["slip_speed"]
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
        force, moment = _loads(tape, contact, up, load, tire)
        bodies.append(
            mechanics.Body(
                p["unsprung_mass"],
                centre,
                g.named(tape, g.add(force, g.scale(p["unsprung_mass"], weight))),
                rotation,
                about,
                moment,
            )
        )
        side = "front" if front else "rear"
        springs.append(
            tape.let(preload[end] + p[f"{side}_stiffness"] * travel + p[f"{side}_damping"] * rate)
        )
        forces.append(tire)
        loads.append(load)
        slips.append((contact.slip_ratio, contact.slip_angle))
    outputs = [
        *body.outputs(q, nu),
        *(tire.longitudinal for tire in forces),
        *(tire.lateral for tire in forces),
        *loads,
        *(tire.aligning for tire in forces),
        *(slip for slip, _ in slips),
        *(angle for _, angle in slips),
    ]
    return bodies, springs, outputs


def _loads(
    tape: Tape, contact: body.Contact, up: g.Vector, load: sp.Expr, tire: TireForces
) -> tuple[g.Vector, g.Vector]:
    """Force on a wheel and its moment about the wheel centre; the vertical load has no arm."""
    shear = g.named(
        tape,
        g.add(g.scale(tire.longitudinal, contact.heading), g.scale(tire.lateral, contact.leftward)),
    )
    arm = g.named(tape, g.scale(-contact.height, up))
    moment = g.add(g.cross(arm, shear), g.scale(tire.aligning, up))
    return g.named(tape, g.add(shear, g.scale(load, up))), g.named(tape, moment)
