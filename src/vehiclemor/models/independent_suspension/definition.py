"""Vehicle with independent suspension, 14 degrees of freedom, Magic Formula tires (ODE).

Masoudi, Uchida, McPhee (2015), section 3.1 and figure 1; structure after Sayers and Han (1996), A
generic multibody vehicle model for simulating handling and braking, Veh. Syst. Dyn. 25 (sup1),
599-613: a sprung body, four lumped masses on vertical prismatic joints, four spinning wheels.
Axes: ISO 8855.  Steering is quasi-static: the rate of the steering angle appears nowhere.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from vehiclemor.errors import GeometryError
from vehiclemor.models.components import body
from vehiclemor.models.components.tires import MAGIC_FORMULA, TireForces, magic_formula
from vehiclemor.models.equations import DynamicEquations
from vehiclemor.models.quantities import (
    CHASSIS_COORDINATES,
    CHASSIS_OUTPUTS,
    CHASSIS_SPEEDS,
    WHEELS,
    Quantity,
    per_wheel,
)
from vehiclemor.parameters import Declared
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import joints, mechanics
from vehiclemor.symbolic.elimination import eliminate_symmetric
from vehiclemor.symbolic.program import assemble
from vehiclemor.symbolic.tape import Tape

NAME = "independent_suspension_vehicle"
KIND = "ode"
SUMMARY = "vehicle with independent suspension, 14 degrees of freedom, Magic Formula tires (ODE)"
MANEUVER = "lane_change"
FRONT = (True, True, False, False)
LEFT = (True, False, True, False)
# The right-hand side does not depend on them.
PLANAR = ("X", "Y", "psi")
CYCLIC = ("X", "Y", *(f"gamma_{wheel}" for wheel in WHEELS))

COORDINATES = (
    *CHASSIS_COORDINATES,
    *(Quantity(f"z_{w}", "m", f"travel of the {w} wheel, compression positive") for w in WHEELS),
    *(Quantity(f"gamma_{w}", "rad", f"spin angle of the {w} wheel") for w in WHEELS),
)
SPEEDS = (
    *CHASSIS_SPEEDS,
    *(Quantity(f"zdot_{w}", "m/s", f"rate of travel of the {w} wheel") for w in WHEELS),
    *(Quantity(f"omega_{w}", "rad/s", f"spin of the {w} wheel on its carrier") for w in WHEELS),
)
INPUTS = (Quantity("delta", "rad", "steering angle of both front wheels, positive to the left"),)
OUTPUTS = (
    *CHASSIS_OUTPUTS,
    *per_wheel("Fx", "N", "longitudinal force on the {} tire"),
    *per_wheel("Fy", "N", "lateral force on the {} tire"),
    *per_wheel("Fz", "N", "vertical load of the {} tire"),
    *per_wheel("Mz", "N m", "aligning moment on the {} tire"),
    *per_wheel("slip_ratio", "1", "longitudinal slip of the {} tire"),
    *per_wheel("slip_angle", "rad", "slip angle of the {} tire, sliding left positive"),
)
PARAMETERS = {
    "gravity": Declared("m/s^2", above=0.0, at_most=100.0),
    "sprung_mass": Declared("kg", above=0.0, at_most=1e5),
    "unsprung_mass": Declared("kg", above=0.0, at_most=1e4),
    "roll_inertia": Declared("kg m^2", above=0.0, at_most=1e6),
    "pitch_inertia": Declared("kg m^2", above=0.0, at_most=1e6),
    "whole_car_yaw_inertia": Declared("kg m^2", above=0.0, at_most=1e6),
    "product_of_inertia": Declared("kg m^2", at_least=-1e5, at_most=1e5),
    "front_axle_distance": Declared("m", above=0.0, at_most=20.0),
    "rear_axle_distance": Declared("m", above=0.0, at_most=20.0),
    "front_track": Declared("m", above=0.0, at_most=20.0),
    "rear_track": Declared("m", above=0.0, at_most=20.0),
    "sprung_height": Declared("m", above=0.0, at_most=20.0),
    "front_stiffness": Declared("N/m", above=0.0),
    "rear_stiffness": Declared("N/m", above=0.0),
    "front_damping": Declared("N s/m", at_least=0.0),
    "rear_damping": Declared("N s/m", at_least=0.0),
    "tire_radius": Declared("m", above=0.0, at_most=20.0),
    "tire_stiffness": Declared("N/m", above=0.0),
    "tire_damping": Declared("N s/m", at_least=0.0),
    "spin_inertia": Declared("kg m^2", above=0.0, at_most=1e4),
    "diametral_inertia": Declared("kg m^2", above=0.0, at_most=1e4),
    "slip_speed": Declared("m/s", above=0.0, at_most=10.0),
    "nominal_load": Declared("N", above=0.0),
    "load_scale": Declared("1", above=0.0),
    **{name: Declared("1") for name in MAGIC_FORMULA},
    # Below walking pace the slip of a rolling wheel has no meaning.
    "initial_speed": Declared("m/s", at_least=1.0, at_most=150.0),
    "drop_height": Declared("m", at_least=-0.05, at_most=1.0),
    "drop_pitch": Declared("rad", at_least=-0.5, at_most=0.5),
}
# Beyond these bounds of an output the model means nothing: slip needs forward motion, the contact
# point lies below the wheel centre.
VALIDITY = {
    "longitudinal_speed": (0.5, np.inf),
    "roll": (-1.2, 1.2),
    "pitch": (-1.2, 1.2),
}
# Outputs that are zero where a wheel has left the road.
LOADS = tuple(f"Fz_{wheel}" for wheel in WHEELS)


@dataclass(frozen=True)
class Derived:
    """What follows from the parameters, numbers or symbols; front first where there are two.

    Attributes
    ----------
    total_mass
        In kg.
    sprung_distance
        Sprung centre of mass to the front and rear axle in m.
    yaw_inertia
        Of the sprung body in kg m^2.
    load, preload
        Static vertical load of a tire, static force of a spring, in N.
    loaded_radius
        Static height of a wheel centre above the road in m.
    depth
        Sprung centre of mass above the wheel centres at zero travel in m.
    reference_load
        F_z0 of the tire in N.
    """

    total_mass: Any
    sprung_distance: tuple[Any, Any]
    yaw_inertia: Any
    load: tuple[Any, Any]
    preload: tuple[Any, Any]
    loaded_radius: tuple[Any, Any]
    depth: tuple[Any, Any]
    reference_load: Any


def derived(p: Mapping[str, Any]) -> Derived:
    """Derived parameters of numbers or symbols."""
    mass, corner = p["sprung_mass"], p["unsprung_mass"]
    a, b = p["front_axle_distance"], p["rear_axle_distance"]
    total = mass + 4 * corner
    sprung_a = (total * a - 2 * corner * (a + b)) / mass
    load = (
        total * p["gravity"] * b / (2 * (a + b)),
        total * p["gravity"] * a / (2 * (a + b)),
    )
    corners = sum(
        2 * corner * (distance**2 + track**2 / 4)
        for distance, track in ((a, p["front_track"]), (b, p["rear_track"]))
    )
    radius = tuple(p["tire_radius"] - part / p["tire_stiffness"] for part in load)
    return Derived(
        total,
        (sprung_a, a + b - sprung_a),
        p["whole_car_yaw_inertia"]
        - corners
        - 4 * p["diametral_inertia"]
        - mass * (a - sprung_a) ** 2,
        load,
        (load[0] - corner * p["gravity"], load[1] - corner * p["gravity"]),
        (radius[0], radius[1]),
        (p["sprung_height"] - radius[0], p["sprung_height"] - radius[1]),
        p["nominal_load"] * p["load_scale"],
    )


def check(p: Mapping[str, Any]) -> None:
    """Raise `GeometryError` if the vehicle can't stand on its four wheels."""
    d = derived(p)
    for name, distance in zip(("front", "rear"), d.sprung_distance, strict=True):
        if distance <= 0.0:
            away = "rear" if name == "front" else "front"
            raise GeometryError(
                f"the vehicle can't stand: its sprung mass lies beyond the {name} axle, so that "
                f"the {away} wheels leave the ground"
            )
    for name, radius in zip(("front", "rear"), d.loaded_radius, strict=True):
        if radius <= 0.0:
            raise GeometryError(
                f"the vehicle can't stand: its weight presses the {name} tires flat "
                f"(tire_stiffness is too small)"
            )
    if d.yaw_inertia <= 0.0:
        raise GeometryError(
            f"the sprung body has a yaw inertia of {d.yaw_inertia:.4g} kg m^2: "
            "whole_car_yaw_inertia is smaller than that of the unsprung masses alone"
        )


def starts(p: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Initial states (28,) by name: straight running, and the same dropped onto the road."""
    d, speed = derived(p), float(p["initial_speed"])
    equilibrium = np.zeros(len(COORDINATES) + len(SPEEDS))
    equilibrium[2] = p["sprung_height"]
    equilibrium[14] = speed
    equilibrium[24:] = [speed / d.loaded_radius[0 if front else 1] for front in FRONT]
    dropped = equilibrium.copy()
    dropped[2] += p["drop_height"]
    dropped[4] += p["drop_pitch"]
    # The velocity keeps its direction in space.
    dropped[14] = speed * np.cos(dropped[4])
    dropped[16] = speed * np.sin(dropped[4])
    return {"equilibrium": equilibrium, "dropped": dropped}


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
