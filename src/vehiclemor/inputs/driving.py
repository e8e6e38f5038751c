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

from typing import NamedTuple

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


class Ramp(NamedTuple):
    """An input that rises from 0 to its size, or the derivative of that order of it.

    It begins at a time in s and takes a length in s at a frequency factor of 1; without a length it
    is constant.  The amplitude factor scales it, if it is `scaled`.
    """

    size: float
    begin: float = 0.0
    length: float = 0.0
    order: int = 0
    scaled: bool = False

    def at(self, times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
        """Values (n,) at times (n,) in s."""
        size = self.size * (amplitude if self.scaled else 1.0)
        if not self.length:
            return np.full(len(times), size)
        length = self.length / frequency
        return size * ramp((times - self.begin) / length, length)[:, self.order]

    def corners(self, frequency: float) -> set[float]:
        """Times in s at which it begins and ends."""
        return {self.begin, self.begin + self.length / frequency} if self.length else set()


def _torque(acceleration: float, share: float, begin: float) -> Ramp:
    """Torque of a wheel that has a share of the force which accelerates the car."""
    return Ramp(MASS * RADIUS * acceleration * share, begin, TORQUE_RAMP, scaled=True)


def _brakes(begin: float) -> dict[str, Ramp]:
    front, rear = FRONT_SHARE / 2.0, (1.0 - FRONT_SHARE) / 2.0
    shares = zip(WHEELS, (front, front, rear, rear), strict=True)
    return {f"brake_torque_{w}": _torque(BRAKING, share, begin) for w, share in shares}


def _ramps(name: str, summary: str, ramps: dict[str, Ramp], duration: float) -> Maneuver:
    """Maneuver of ramps by input."""

    def signal(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
        return np.stack([each.at(times, frequency, amplitude) for each in ramps.values()], axis=1)

    def corners(frequency: float) -> tuple[float, ...]:
        return tuple(sorted(set().union(*(each.corners(frequency) for each in ramps.values()))))

    linear = all(each.scaled for each in ramps.values())
    fields = name, summary, signal, tuple(ramps), duration, round(duration * RATE) + 1, corners
    return Maneuver(*fields, linear_in_amplitude=linear)


def _in_turn(name: str, summary: str, ramps: dict[str, Ramp]) -> tuple[Maneuver, Maneuver]:
    """Ramps of torques while the steering angle is held, and while the rack is."""
    summary = f"{summary} from 3 s on in a turn of 4 m/s^2 at 20 m/s"
    angle = {"delta": Ramp(LANE_CHANGE_AMPLITUDE * STEP_SIZE, BEGIN, ONSET)}
    rack = {
        displaced: Ramp(RACK_AMPLITUDE * STEP_SIZE, BEGIN, ONSET, order)
        for order, displaced in enumerate(("s", "s_dot", "s_ddot"))
    }
    return (
        _ramps(name, f"{summary}, 6 s", angle | ramps, 6.0),
        _ramps(f"rack_{name}", f"{summary}, of the rack, 6 s", rack | ramps, 6.0),
    )


def _bump(times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
    """Heights below the front and the rear wheel, and their rates."""
    travelled = SPEED * frequency * (times - BEGIN)
    part = (travelled[:, None] - np.array([0.0, WHEELBASE])) / LENGTH
    angle = 2.0 * np.pi * np.clip(part, 0.0, 1.0)
    heights = 0.5 * HEIGHT * (1.0 - np.cos(angle))
    rates = HEIGHT * np.pi * SPEED * frequency / LENGTH * np.sin(angle)
    return amplitude * np.hstack([heights, rates])


def _bump_corners(frequency: float) -> tuple[float, ...]:
    distances = np.array([0.0, LENGTH, WHEELBASE, WHEELBASE + LENGTH])
    return tuple((BEGIN + distances / (SPEED * frequency)).tolist())


straight_braking = _ramps(
    "straight_braking", "brakes at 0.3 g from 1 s on (ISO 21994), 10 s", _brakes(BEGIN), 10.0
)
split_friction = _ramps(
    "split_friction",
    "brakes at 0.3 g from 1 s on, friction 0.3 on the left side (ISO 14512), 5 s",
    _brakes(BEGIN) | {f"friction_{w}": Ramp(SLIPPERY if w[1] == "L" else 1.0) for w in WHEELS},
    5.0,
)
braking_in_turn, rack_braking_in_turn = _in_turn(
    "braking_in_turn", "brakes at 0.3 g (ISO 7975)", _brakes(IN_TURN)
)
power_in_turn, rack_power_in_turn = _in_turn(
    "power_in_turn",
    "drives the rear wheels at 0.2 g",
    {f"drive_torque_{wheel}": _torque(DRIVING, 0.5, IN_TURN) for wheel in WHEELS[2:]},
)
bump = Maneuver(
    "bump",
    "bump of 20 mm, 2.4 m long, below the left wheels; frequency factor is speed over 20 m/s, 4 s",
    _bump,
    ("road_FL", "road_RL", "road_FL_dot", "road_RL_dot"),
    4.0,
    round(4.0 * RATE) + 1,
    _bump_corners,
    linear_in_amplitude=True,
)
