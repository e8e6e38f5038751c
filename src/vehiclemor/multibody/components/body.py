"""The free chassis that vehicles share, with its coordinates, and the inputs of vehicles.

Chassis frame: origin at the centre of mass of the sprung body, x forward, y left, z up (ISO 8855).
The speeds are components in this frame.  The road is the plane z = 0.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from vehiclemor.multibody.quantities import AT_WHEEL, OPTIONAL_INPUTS, InputChoice, Quantity
from vehiclemor.parameters import Declared
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic.geometry import Rotation, Vector
from vehiclemor.symbolic.tape import Tape

# Spin in rad/s below which a brake fades, so that its torque changes sign smoothly.
BRAKE_SPEED = sp.Integer(1)


def symbols(quantities: Sequence[Quantity]) -> list[sp.Symbol]:
    """A symbol for each quantity, real."""
    return [sp.Symbol(quantity.name, real=True) for quantity in quantities]


@dataclass(frozen=True)
class WheelInputs:
    """Symbols of `AT_WHEEL`, or defaults of inputs that are neither driven nor parameters."""

    # Torques in N m: forwards on the wheel; against its spin, not negative.
    drive: sp.Expr
    brake: sp.Expr
    friction: sp.Expr  # Factor on the friction of the tire.
    # Height of the road under the wheel in m, upwards, and its rate in m/s.
    road: sp.Expr
    road_rate: sp.Expr

    def torque(self, tape: Tape, spin: sp.Expr) -> sp.Expr:
        """Torque of drive and brake on a wheel that spins on its carrier at so many rad/s."""
        # In one expression: without a brake nothing is left of it.
        against = self.brake * spin / sp.sqrt(spin**2 + BRAKE_SPEED**2)
        return tape.let(self.drive - against)


@dataclass(frozen=True)
class Inputs:
    """Inputs in the equations."""

    # Name -> symbol; the default of an optional input that is neither driven nor a parameter.
    values: dict[str, sp.Expr]
    driven: list[sp.Symbol]  # Symbols of the argument `u`.
    constant: list[sp.Symbol]  # Symbols of parameters behind those that the model declares.

    def at(self, wheel: str) -> WheelInputs:
        """Inputs at one wheel."""
        return WheelInputs(*(self.values[name.format(wheel)] for name, *_ in AT_WHEEL))


def inputs(every_run: Sequence[Quantity], choice: InputChoice) -> Inputs:
    """Inputs of every run and the optional ones of vehicles, as the choice has them."""
    values: dict[str, sp.Expr] = {q.name: sp.nsimplify(q.default) for q in OPTIONAL_INPUTS}
    optional = [q for q in OPTIONAL_INPUTS if q.name in choice.driven]
    driven = symbols([*every_run, *optional])
    constant = symbols([q for q in OPTIONAL_INPUTS if q.name in choice.constant])
    values |= {symbol.name: symbol for symbol in (*driven, *constant)}
    return Inputs(values, driven, constant)


def parameters(
    declared: Mapping[str, Declared], further: Iterable[str] = ()
) -> dict[str, sp.Symbol]:
    """A symbol for each parameter, three for a point, and for each further name."""
    flat: list[str] = []
    for name, parameter in declared.items():
        flat += [name] if parameter.size == 1 else [f"{name}_{axis}" for axis in "xyz"]
    return {name: sp.Symbol(f"p_{name}", real=True) for name in (*flat, *further)}


def outputs(q: Sequence[sp.Symbol], nu: Sequence[sp.Symbol]) -> list[sp.Expr]:
    """Outputs of the chassis: position, yaw, pitch, roll, three velocities and the yaw rate."""
    return [q[0], q[1], q[3], q[4], q[5], nu[0], nu[1], nu[2], nu[5]]


@dataclass(frozen=True)
class Attitude:
    """Orientation of the chassis: rotation matrix, sine and cosine of pitch and roll."""

    rotation: Rotation
    sin_pitch: sp.Expr
    cos_pitch: sp.Expr
    sin_roll: sp.Expr
    cos_roll: sp.Expr

    @property
    def road_normal(self) -> Vector:
        """Unit normal of the road, chassis components."""
        return self.rotation[2]


def attitude(tape: Tape, q: Sequence[sp.Symbol]) -> Attitude:
    """Orientation from yaw, pitch and roll, 3-2-1 Euler angles."""
    yaw, pitch, roll = q[3], q[4], q[5]
    return Attitude(
        g.euler_321(tape, yaw, pitch, roll),
        *(tape.let(f(angle)) for angle in (pitch, roll) for f in (sp.sin, sp.cos)),
    )


def rates(tape: Tape, chassis: Attitude, nu: Sequence[sp.Expr]) -> list[sp.Expr]:
    """Rates of X, Y, Z, yaw, pitch and roll from the speeds."""
    position = g.rotate(tape, chassis.rotation, g.vector(nu[:3]))
    return [*position, *angle_rates(tape, chassis, g.vector(nu[3:6]))]


def angle_rates(tape: Tape, chassis: Attitude, turning: Vector) -> list[sp.Expr]:
    """Rates of yaw, pitch and roll that go with an angular velocity, chassis components."""
    p, q, r = turning
    yaw = tape.let((q * chassis.sin_roll + r * chassis.cos_roll) / chassis.cos_pitch)
    pitch = tape.let(q * chassis.cos_roll - r * chassis.sin_roll)
    return [yaw, pitch, tape.let(p + yaw * chassis.sin_pitch)]


def angle_bias(tape: Tape, chassis: Attitude, turning: Vector) -> Vector:
    """Rate of the angular velocity where yaw, pitch and roll have no second derivatives."""
    yaw, pitch, roll = angle_rates(tape, chassis, turning)
    s, c, sp_, cp = chassis.sin_roll, chassis.cos_roll, chassis.sin_pitch, chassis.cos_pitch
    second = yaw * (c * cp * roll - s * sp_ * pitch) - pitch * s * roll
    third = yaw * (-s * cp * roll - c * sp_ * pitch) - pitch * c * roll
    return g.named(tape, (-yaw * cp * pitch, second, third))


def _speeds_per_rates(chassis: Attitude) -> tuple[Rotation, Rotation]:
    """Matrices that turn rates of position and of angles into speeds."""
    turned = g.matrix(lambda i, j: chassis.rotation[j][i])
    s, c = chassis.sin_roll, chassis.cos_roll
    angular = (
        g.vector((-chassis.sin_pitch, 0, 1)),
        g.vector((s * chassis.cos_pitch, c, 0)),
        g.vector((c * chassis.cos_pitch, -s, 0)),
    )
    return turned, angular


def speeds(tape: Tape, chassis: Attitude, rate: Sequence[sp.Expr]) -> list[sp.Expr]:
    """Chassis speeds (6) from the rates of X, Y, Z, yaw, pitch and roll."""
    linear, angular = _speeds_per_rates(chassis)
    return [
        *g.rotate(tape, linear, g.vector(rate[:3])),
        *g.rotate(tape, angular, g.vector(rate[3:6])),
    ]


def in_coordinates(
    tape: Tape,
    chassis: Attitude,
    nu: Sequence[sp.Expr],
    # M and F of M d(nu)/dt = F, the chassis speeds first; the others are rates of coordinates.
    mass: Sequence[Sequence[sp.Expr]],
    force: Sequence[sp.Expr],
    # What d(nu)/dt has in its first three entries where X, Y, Z have no second derivatives; by
    # default that of chassis components, which turn with the chassis.
    velocity_bias: Vector | None = None,
) -> list[sp.Expr]:
    """Second-order form M_q q'' = F_q, row by row: n entries of M_q, then F_q."""
    linear, angular = _speeds_per_rates(chassis)
    # nu = P q', so that d(nu)/dt = P q'' + bias and P^T (M P q'' + M bias - F) = 0.
    turning = g.vector(nu[3:6])
    if velocity_bias is None:
        swept = turning.cross(g.vector(nu[:3]))
        velocity_bias = g.named(tape, [-component for component in swept])
    bias = [*velocity_bias, *angle_bias(tape, chassis, turning)]
    n = len(mass)
    free = []
    for j in range(n):
        inertial = sp.Add(*[mass[j][k] * bias[k] for k in range(6)])
        free.append(tape.let(force[j] - inertial))

    def turned(column: Sequence[sp.Expr]) -> list[sp.Expr]:
        """P^T times a vector of length n."""
        blocks = [(linear, column[:3]), (angular, column[3:6])]
        sums = [sp.Add(*[p[k][i] * v[k] for k in range(3)]) for p, v in blocks for i in range(3)]
        return [*map(tape.let, sums), *column[6:]]

    # M P: P^T acts on rows, M is symmetric.
    rows_times_p = [turned(row) for row in mass]
    columns = [turned(column) for column in zip(*rows_times_p, strict=True)]
    # The translational block is the total mass in any axes.
    for i in range(3):
        for j in range(3):
            columns[i][j] = mass[i][j]
    augmented = zip(*columns, turned(free), strict=True)
    return [entry for row in augmented for entry in row]
