"""The high-fidelity vehicle that all forms of its equations begin with: chassis, design points."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from vehiclemor.multibody.components import body
from vehiclemor.multibody.double_wishbone.points import POINTS
from vehiclemor.multibody.high_fidelity.equilibrium import DECLARED, SOLVED
from vehiclemor.symbolic import geometry as g
from vehiclemor.symbolic import mechanics
from vehiclemor.symbolic.tape import Tape

# 1 on the left, -1 on the right: FL, FR, RL, RR.
SIDES = (1, -1, 1, -1)
FRONT_POINTS = (
    *POINTS,
    "front_spring_chassis_point",
    "front_spring_arm_point",
    "upper_arm_centre",
    "lower_arm_centre",
    "carrier_centre",
)
REAR_POINTS = (
    "rear_arm_pivot",
    "rear_arm_centre",
    "rear_spring_chassis_point",
    "rear_spring_arm_point",
)


@dataclass(frozen=True)
class Numbers:
    """Numbers of the speeds; the first six are the chassis'."""

    total: int
    # Of the arms that carry the springs: lower arms in front, trailing arms behind.
    arms: tuple[int, ...]
    spins: tuple[int, ...]  # Of the wheels.

    @property
    def order(self) -> tuple[int, ...]:
        """Order of elimination: each but the last six couples to these and to one other."""
        return (*self.spins, *self.arms, *range(6))


@dataclass(frozen=True)
class Vehicle:
    """What all forms of the equations begin with."""

    # Moving frame of the chassis, its origin the centre of mass; gravity is counted as an
    # acceleration of it upwards.
    frame: mechanics.MovingFrame
    up: g.Vector  # Road normal, chassis components.
    points: tuple[dict[str, g.Vector], ...]  # Design points of the four corners, chassis frame.
    # Coordinates and their rates.
    q: Sequence[sp.Symbol]
    rates: Sequence[sp.Symbol]
    p: Mapping[str, sp.Expr]  # Symbols of the parameters.
    numbers: Numbers


def vehicle(
    tape: Tape,
    q: Sequence[sp.Symbol],
    rates: Sequence[sp.Symbol],
    p: Mapping[str, sp.Expr],
    numbers: Numbers,
) -> tuple[Vehicle, body.Attitude, list[sp.Expr]]:
    """The chassis with the design points; attitude and the six speeds of the chassis."""
    attitude = body.attitude(tape, q)
    speeds = body.speeds(tape, attitude, rates)
    up = attitude.road_normal
    # The first three speeds are velocities in space, and gravity an acceleration upwards.
    frame = mechanics.MovingFrame(
        g.vector(speeds[:3]),
        g.vector(speeds[3:6]),
        first=0,
        acceleration=g.named(tape, up * p["gravity"]),
    )
    points = design_points(tape, p)
    return Vehicle(frame, up, points, q, rates, p, numbers), attitude, speeds


def parameters() -> tuple[dict[str, sp.Expr], list[sp.Symbol]]:
    """Symbols of the parameters by name, components of points apart, and in order."""
    flat = []
    for name, declared in DECLARED["parameters"].items():
        flat += [name] if declared.size == 1 else [f"{name}_{axis}" for axis in "xyz"]
    flat += SOLVED
    symbols = {name: sp.Symbol(f"p_{name}", real=True) for name in flat}
    return dict(symbols), list(symbols.values())


def design_points(tape: Tape, p: Mapping[str, sp.Expr]) -> tuple[dict[str, g.Vector], ...]:
    """Design points of the four corners, chassis frame."""

    def vector(name: str) -> g.Vector:
        return g.vector([p[f"{name}_{axis}"] for axis in "xyz"])

    origin = vector("chassis_centre")
    front = g.named(tape, vector("front_frame_origin") - origin)
    rear = g.named(tape, vector("rear_wheel_centre") - origin)
    left = {name: g.named(tape, vector(name) + front) for name in FRONT_POINTS}
    behind = {name: g.named(tape, vector(name) + rear) for name in REAR_POINTS}
    behind["rear_wheel_centre"] = rear

    def mirrored(points: dict[str, g.Vector]) -> dict[str, g.Vector]:
        return {name: g.Vector(x, -y, z) for name, (x, y, z) in points.items()}

    return left, mirrored(left), behind, mirrored(behind)
