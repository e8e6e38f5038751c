"""Braking, driving and roads: tests of the standards that need more than steering.

Torques follow from the total acceleration a that is demanded, T = m R a: 66 % of the brake torque
in front, all drive torque on the rear axle, as CommonRoad has it for this car.  A maneuver does not
know its model: the mass m and the radius R of a loaded tire are those of the BMW 320i, see
`data/parameters/independent_suspension_vehicle.toml`.  Another car accelerates by another amount,
and this one by 5 % less, since its wheels turn.

ISO 21994 (straight braking), ISO 7975 (braking in a turn) and ISO 14512 (braking on a road that is
slippery on one side) brake from a steady speed; these start from the parameter `initial_speed` of
the model.  The amplitude factor is that of the acceleration, or of the height of the bump.
"""

from collections.abc import Callable, Mapping

import numpy as np

from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.inputs.steering import (
    BEGIN,
    LANE_CHANGE_AMPLITUDE,
    ONSET,
    RACK_AMPLITUDE,
    RATE,
    STEP_SIZE,
    ramp,
)
from vehiclemor.multibody.quantities import WHEELS

# Mass (kg), radius of a loaded tire (m), share of the brake torque in front.
MASS, RADIUS, FRONT_SHARE = 1093.3, 0.327, 0.66
GRAVITY = 9.81
# m/s^2: demanded of the brakes, and of the drive in a turn.
BRAKING, DRIVING = 0.3 * GRAVITY, 0.2 * GRAVITY
# s: length of the ramp of a torque, and when it begins in a turn.
TORQUE_RAMP, IN_TURN = 0.2, 3.0
SLIPPERY = 0.3
# m, m/s: height and length of the bump, wheelbase, and the speed at a frequency factor of 1.
HEIGHT, LENGTH, WHEELBASE, SPEED = 0.02, 2.4, 2.58, 20.0

BRAKES = tuple(f"brake_torque_{wheel}" for wheel in WHEELS)
# (Times (n,) in s, frequency factor, amplitude factor) -> values (n,).
Column = Callable[[np.ndarray, float, float], np.ndarray]


def _torque(acceleration: float, share: float, begin: float) -> Column:
    """Torque of one wheel, which has a share of the force that accelerates the car."""
    largest = MASS * RADIUS * acceleration * share

    def column(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
        length = TORQUE_RAMP / frequency
        return amplitude * largest * ramp((times - begin) / length, length)[:, 0]

    return column


def _brakes(begin: float) -> dict[str, Column]:
    front, rear = (_torque(BRAKING, s / 2.0, begin) for s in (FRONT_SHARE, 1.0 - FRONT_SHARE))
    return dict(zip(BRAKES, (front, front, rear, rear), strict=True))


def _constant(value: float) -> Column:
    return lambda times, frequency, amplitude: np.full(len(times), value)  # noqa: ARG005


def _turn(size: float, derivative: int) -> Column:
    """Steering into a turn, or one of its derivatives."""

    def column(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
        del amplitude
        length = ONSET / frequency
        return size * STEP_SIZE * ramp((times - BEGIN) / length, length)[:, derivative]

    return column


TURN = {"delta": _turn(LANE_CHANGE_AMPLITUDE, 0)}
RACK_TURN = {
    name: _turn(RACK_AMPLITUDE, order) for order, name in enumerate(("s", "s_dot", "s_ddot"))
}


def _road(distance: float, derivative: int) -> Column:
    """Height of the bump below a wheel so far behind the front axle (m), or its rate."""

    def column(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
        speed = SPEED * frequency
        part = (speed * (times - BEGIN) - distance) / LENGTH
        angle = 2.0 * np.pi * np.clip(part, 0.0, 1.0)
        if derivative:
            return amplitude * HEIGHT * np.pi * speed / LENGTH * np.sin(angle)
        return amplitude * HEIGHT * 0.5 * (1.0 - np.cos(angle))

    return column


def _bump_corners(frequency: float) -> tuple[float, ...]:
    distances = np.array([0.0, LENGTH, WHEELBASE, WHEELBASE + LENGTH])
    return tuple((BEGIN + distances / (SPEED * frequency)).tolist())


def _straight_corners(frequency: float) -> tuple[float, ...]:
    return BEGIN, BEGIN + TORQUE_RAMP / frequency


def _turn_corners(frequency: float) -> tuple[float, ...]:
    corners = BEGIN, BEGIN + ONSET / frequency, IN_TURN, IN_TURN + TORQUE_RAMP / frequency
    return tuple(sorted(corners))


def _maneuver(
    name: str,
    summary: str,
    columns: Mapping[str, Column],
    duration: float,
    corners: Callable[[float], tuple[float, ...]],
    linear: bool = False,
) -> Maneuver:
    def signal(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
        return np.stack([each(times, frequency, amplitude) for each in columns.values()], axis=1)

    samples = round(duration * RATE) + 1
    inputs = tuple(columns)
    return Maneuver(
        name, summary, signal, inputs, duration, samples, corners, linear_in_amplitude=linear
    )


straight_braking = _maneuver(
    "straight_braking",
    "brakes at 0.3 g from 1 s on (ISO 21994), 10 s",
    _brakes(BEGIN),
    10.0,
    _straight_corners,
    linear=True,
)
split_friction = _maneuver(
    "split_friction",
    "brakes at 0.3 g from 1 s on, friction 0.3 on the left side (ISO 14512), 5 s",
    _brakes(BEGIN)
    | {f"friction_{w}": _constant(SLIPPERY if w.endswith("L") else 1.0) for w in WHEELS},
    5.0,
    _straight_corners,
)
_DRIVE = {f"drive_torque_{wheel}": _torque(DRIVING, 0.5, IN_TURN) for wheel in WHEELS[2:]}
braking_in_turn, rack_braking_in_turn = (
    _maneuver(
        f"{prefix}braking_in_turn",
        "brakes at 0.3 g from 3 s on in a turn of 4 m/s^2 at 20 m/s (ISO 7975), 6 s",
        turn | _brakes(IN_TURN),
        6.0,
        _turn_corners,
    )
    for prefix, turn in (("", TURN), ("rack_", RACK_TURN))
)
power_in_turn, rack_power_in_turn = (
    _maneuver(
        f"{prefix}power_in_turn",
        "drives the rear wheels at 0.2 g from 3 s on in a turn of 4 m/s^2 at 20 m/s, 6 s",
        turn | _DRIVE,
        6.0,
        _turn_corners,
    )
    for prefix, turn in (("", TURN), ("rack_", RACK_TURN))
)
bump = _maneuver(
    "bump",
    "bump of 20 mm, 2.4 m long, below the left wheels; frequency factor is speed over 20 m/s, 4 s",
    {
        "road_FL": _road(0.0, 0),
        "road_RL": _road(WHEELBASE, 0),
        "road_FL_dot": _road(0.0, 1),
        "road_RL_dot": _road(WHEELBASE, 1),
    },
    4.0,
    _bump_corners,
    linear=True,
)
