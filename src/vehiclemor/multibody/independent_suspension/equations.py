"""Equations of the 14-DOF vehicle: Kane's equations of its five bodies and four spinning wheels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain

import sympy as sp

from vehiclemor.multibody.components import body, tires
from vehiclemor.multibody.independent_suspension.definition import DECLARED, Derived, derived
from vehiclemor.multibody.independent_suspension.relaxation import DEFINITION as RELAXED
from vehiclemor.multibody.quantities import DEFAULTS, WHEELS, InputChoice
from vehiclemor.parameters import Declared
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import mechanics
from vehiclemor.symbolic.elimination import eliminate_symmetric
from vehiclemor.symbolic.program import Program, assemble
from vehiclemor.symbolic.tape import Tape


def derive(choice: InputChoice = DEFAULTS) -> Program:
    """Derive state derivatives, outputs and the second-order form; parameters stay symbols."""
    return derive_with(choice, DECLARED["parameters"], [tires.static_slip] * len(WHEELS))


def derive_relaxed(choice: InputChoice = DEFAULTS) -> Program:
    """The same of the vehicle with relaxation, by another law of slip."""
    states = body.symbols(RELAXED.further_states)
    wheels = zip(states[:4], states[4:], strict=True)
    laws = [partial(tires.relaxed_slip, deflections=deflections) for deflections in wheels]
    return derive_with(choice, RELAXED.parameters, laws, states)


def derive_with(
    choice: InputChoice,
    declared_parameters: Mapping[str, Declared],
    slip_laws: Sequence[tires.SlipLaw],  # Of the wheels.
    further_states: Sequence[sp.Symbol] = (),
) -> Program:
    """As `derive` by laws of slip; with further states there is no second-order form."""
    tape = Tape()
    vehicle = _vehicle(tape, choice, declared_parameters)
    q, nu, attitude = vehicle.q, vehicle.nu, vehicle.attitude
    sprung = _sprung_body(tape, vehicle)
    wheels = [_wheel(tape, vehicle, number, law) for number, law in enumerate(slip_laws)]
    mass, force = tires.kane_with_corners(tape, sprung, wheels, range(6, 10), len(nu))
    for row, spin, inputs in zip(range(10, 14), nu[10:], vehicle.at_wheels, strict=True):
        # Reactions act on the carrier, which does not turn in the chassis.
        force[row] = tape.let(force[row] + inputs.torque(tape, spin))
    # Spins and travels couple to the chassis alone: what is left of it is 6 x 6.
    order = [*range(10, 14), *range(6, 10), *range(6)]
    solved = eliminate_symmetric(tape, mass, force, order)
    rates = [*body.rates(tape, attitude, nu), *nu[6:]]
    n = len(q)
    # Of all wheels the first deflection, then the second.
    slip_rates = chain(*zip(*(corner.wheel.slip.rates for corner in wheels), strict=True))
    derivative = [*rates, *(solved[k] for k in range(n)), *slip_rates]
    outputs = [*body.outputs(q, nu), *tires.tire_outputs(tape, wheels)]
    functions = {
        "derivative": (derivative, (len(derivative),)),
        "outputs": (outputs, (len(outputs),)),
    }
    if not further_states:
        second_order = body.in_coordinates(tape, attitude, nu, mass, force)
        functions["second_order"] = second_order, (n, n + 1)
        functions["speeds"] = [*body.speeds(tape, attitude, nu), *nu[6:]], (n,)
    return assemble(
        tape,
        {"x": [*q, *nu, *further_states], "u": vehicle.inputs.driven},
        [*vehicle.p.values(), *vehicle.inputs.constant],
        functions,
    )


@dataclass(frozen=True)
class _Vehicle:
    """The sprung body on the road, with what its wheels need of it."""

    frame: mechanics.MovingFrame
    attitude: body.Attitude
    q: list[sp.Symbol]
    nu: list[sp.Symbol]
    inputs: body.Inputs
    p: dict[str, sp.Symbol]
    # What follows from the parameters; distances, depths and preloads stand on the tape.
    derived: Derived

    @property
    def at_wheels(self) -> list[body.WheelInputs]:
        """Optional inputs at the four wheels."""
        return [self.inputs.at(wheel) for wheel in WHEELS]

    @property
    def weight(self) -> g.Vector:
        """Acceleration of gravity, chassis components."""
        return self.attitude.road_normal * -self.p["gravity"]


def _vehicle(
    tape: Tape, choice: InputChoice, declared_parameters: Mapping[str, Declared]
) -> _Vehicle:
    """The sprung body on the road."""
    q, nu = (body.symbols(DECLARED[k]) for k in ("coordinates", "speeds"))
    inputs = body.inputs(DECLARED["inputs"], choice)
    p = body.parameters(declared_parameters)
    attitude, d = body.attitude(tape, q), derived(p)
    pairs = {
        k: tuple(map(tape.let, getattr(d, k))) for k in ("sprung_distance", "depth", "preload")
    }
    frame = mechanics.MovingFrame(g.vector(nu[:3]), g.vector(nu[3:6]))
    return _Vehicle(frame, attitude, q, nu, inputs, p, replace(d, **pairs))


def _sprung_body(tape: Tape, v: _Vehicle) -> mechanics.Body:
    xz = -v.p["product_of_inertia"]
    inertia = (
        g.vector((v.p["roll_inertia"], 0, xz)),
        g.vector((0, v.p["pitch_inertia"], 0)),
        g.vector((xz, 0, tape.let(v.derived.yaw_inertia))),
    )
    mass = v.p["sprung_mass"]
    origin = v.frame.origin(tape)
    rotation = v.frame.rotation(tape, inertia)
    pushed = g.vector((v.inputs.values["body_force_x"], 0, 0))
    return mechanics.Body(mass, origin, v.weight * mass + pushed, rotation, inertia)


def _wheel(tape: Tape, v: _Vehicle, wheel: int, slip_law: tires.SlipLaw) -> tires.Corner:
    """A wheel of number 0 to 3 with its load, tire and spring."""
    p, d, frame, front = v.p, v.derived, v.frame, wheel < 2
    end, side = (0, "front") if front else (1, "rear")
    travel, rate, spin = v.q[6 + wheel], v.nu[6 + wheel], v.nu[10 + wheel]
    track = p[f"{side}_track"]
    hub = g.vector(
        (
            d.sprung_distance[0] if front else -d.sprung_distance[1],
            tape.let(track / 2 if wheel % 2 == 0 else -track / 2),
            tape.let(travel - d.depth[end]),
        )
    )
    delta = v.inputs.values["delta"]
    steer = (tape.let(sp.sin(delta)), tape.let(sp.cos(delta)))
    axle = g.vector((-steer[0], steer[1], 0) if front else (0, 1, 0))
    upwards = mechanics.along(mechanics.free_rate(6 + wheel, rate), mechanics.UNIT[2])
    centre = frame.point(tape, hub, upwards)
    about = mechanics.axisymmetric_inertia(p["spin_inertia"], p["diametral_inertia"], axle)
    rotation = frame.rotation(tape, about, spin=(10 + wheel, spin, axle))
    up = v.attitude.road_normal
    height = tape.let(v.q[2] + tape.let(up @ hub))
    motion = tires.WheelMotion(height, axle, centre.value, rotation.value)
    on_road = tires.upright_wheel(tape, up, motion, p, v.at_wheels[wheel], slip_law)
    mass = p["unsprung_mass"]
    applied = g.named(tape, on_road.force + v.weight * mass)
    spring = d.preload[end] + p[f"{side}_stiffness"] * travel + p[f"{side}_damping"] * rate
    rigid = mechanics.Body(mass, centre, applied, rotation, about, on_road.moment)
    return tires.Corner((rigid,), -tape.let(spring), on_road)
