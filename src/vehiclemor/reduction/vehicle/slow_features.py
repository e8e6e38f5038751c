"""Arguments of slow motion, in which features of a reduced vehicle are written.

Fast motion follows the slow one, so that slips and loads of the wheels are functions of few
arguments: lateral speed and yaw rate over the speed, roll angle, roll rate over the speed and
steering, each clipped to its training range; with torques, those of the axles too.
"""

from collections.abc import Iterable, Sequence
from functools import reduce
from operator import add, mul

import numpy as np

from vehiclemor.codegen.operations import Value
from vehiclemor.multibody.quantities import WHEELS
from vehiclemor.reduction.vehicle.features import FeatureListing, Features, feature_columns
from vehiclemor.reduction.vehicle.fitting import largest
from vehiclemor.reduction.vehicle.linear_modes import SlowModes
from vehiclemor.reduction.vehicle.shape import (
    BRAKE,
    DRIVE,
    FRICTION,
    ShapeSamples,
    VehicleInputs,
    VehicleShape,
)

AXLES = (WHEELS[:2], WHEELS[2:])
# Factors of a term, by the names of their lines.
Names = tuple[str, ...]
ARGUMENTS = tuple(f"a{i}" for i in range(5))
NAMES = ("lateral speed", "yaw rate", "roll", "roll rate", "steering", "change of speed")
DERIVATIVES = ("rate of steering", "acceleration of steering")
# Arguments that go as one over the speed.
OVER_SPEED = (True, True, False, True)
ONE, FAST = ("1",), ("m",)
# Arguments are clipped at this multiple of their training range.
HULL = 1.1
# A brake fades below this spin in rad/s, see `components/body`.
BRAKE_SPEED = 1.0


def clipped(value: Value) -> Value:
    """A value clipped to [-1, 1]: nothing is known beyond the training runs."""
    return 0.5 * (abs(value + 1.0) - abs(value - 1.0))


class SlowFeatures(FeatureListing):
    """Lines of features under construction, by name, with the parameters that they take."""

    def __init__(self, lateral: int, symmetric: int, inputs: VehicleInputs) -> None:
        super().__init__(lateral + symmetric + 1, len(inputs.names))
        self.inputs = inputs
        # How many coordinates steering moves, and how many others there are; then comes the speed.
        self.lateral, self.symmetric = lateral, symmetric
        self.values: list[float] = []  # Of the parameters.
        # Name of a line -> its value.
        self.by_name = {f"z{i}": z for i, z in enumerate(self.z)} | {"1": self.number(1.0)}
        self.watched: list[tuple[Value, str]] = []  # (value, what it is).
        self.reach: dict[str, float] = {}  # Largest values in training, by which lines are divided.
        # Kinds of lines of an axle, whose index stands behind them.
        self.forces: tuple[str, ...] = ()

    @property
    def speed(self) -> int:
        """Index of the speed."""
        return self.lateral + self.symmetric

    @property
    def odd_columns(self) -> tuple[int, ...]:
        """Columns of the coefficients of odd terms: lateral coordinates, yaw rate, sideways."""
        return (*range(self.lateral), self.speed + 1, self.speed + 3)

    @property
    def even_columns(self) -> tuple[int, ...]:
        """Columns of the coefficients of even terms: the other coordinates, speed, forward."""
        return (*range(self.lateral, self.speed + 1), self.speed + 2)

    @property
    def coordinates(self) -> list[Names]:
        """Coordinates as parts of their training range."""
        return [(f"scaled{i}",) for i in range(self.speed)]

    @property
    def derivatives(self) -> list[Names]:
        """Derivatives of the steering."""
        return [(f"raw{len(NAMES) + j}",) for j in range(self.inputs.steering - 1)]

    def parameter(self, value: float) -> Value:
        """A new parameter."""
        self.values.append(float(value))
        return self.p(len(self.values) - 1)

    def line(self, name: str, value: Value) -> Value:
        """A value with a name."""
        self.by_name[name] = self.let(value)
        return self.by_name[name]

    def term(self, names: Names) -> tuple[Value, ...]:
        """Factors of a term."""
        return tuple(self.by_name[name] for name in names)

    def weighted(self, values: Iterable[Value], weights: Iterable[float]) -> Value:
        """The weighted sum of the values with a weight."""
        pairs = zip(values, weights, strict=True)
        first, *others = [self.parameter(w) * value for value, w in pairs if w]
        return reduce(add, others, first)

    def torque(self, wheel: str, held: Value) -> Value:
        """Torque of a wheel in N m; `held` is what of a brake's acts on it."""
        drive, brake = (self.inputs.of_wheel(kind, wheel) for kind in (DRIVE, BRAKE))
        driven = self.number(0.0) if drive is None else self.u[drive]
        return driven if brake is None else self.let(driven - held * self.u[brake])

    def friction(self, wheel: str) -> Value | None:
        """Friction of a wheel's tire, where it is an input."""
        index = self.inputs.of_wheel(FRICTION, wheel)
        return None if index is None else self.u[index]

    def friction_of(self, axle: int) -> Value | None:
        """Mean friction of an axle's tires, where both are inputs."""
        left, right = (self.friction(wheel) for wheel in AXLES[axle])
        return None if left is None or right is None else self.let(0.5 * (left + right))

    def grips(self, axle: int, u: np.ndarray) -> np.ndarray:
        """The same (samples,) of inputs (samples, inputs); else 1."""
        left, right = (self.inputs.of_wheel(FRICTION, wheel) for wheel in AXLES[axle])
        if left is None or right is None:
            return np.ones(len(u))
        return u[:, [left, right]].mean(axis=1)

    def of_terms(self, terms: Sequence[Names], odd: int = 0) -> Features:
        """Features of these terms; the first ones are the odd ones."""
        indices = tuple(range(len(terms)))
        groups = (indices[:odd], self.odd_columns), (indices[odd:], self.even_columns)
        factors = [self.term(names) for names in terms]
        return self.features(factors, groups if odd else (), self.watched)

    def columns(self, terms: Sequence[Names], z: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Terms (samples, terms) of coordinates (samples, states) and inputs.

        Lines are computed by a kernel, their products are not: it would take seconds to compile.
        """
        names = sorted({name for term in terms for name in term}) or ["1"]
        lines = feature_columns(self.of_terms([(n,) for n in names]), z, u, np.array(self.values))
        by_name = dict(zip(names, lines.T, strict=True))
        columns = [reduce(mul, map(by_name.__getitem__, term)) for term in terms]
        return np.stack(columns, axis=1) if columns else np.zeros((len(z), 0))


def slow_features(shape: VehicleShape, modes: SlowModes, samples: ShapeSamples) -> SlowFeatures:
    """Lines of arguments, with the ranges that they have in training samples."""
    z = modes.coordinates(samples.deviations, samples.inputs)
    features = SlowFeatures(modes.lateral, len(modes.rates) - modes.lateral, shape.inputs)
    _add_arguments(features, shape, modes, (z, samples.inputs))
    if shape.inputs.torques:
        _add_torques(features, shape, (z, samples.inputs))
    return features


def _add_arguments(
    features: SlowFeatures,
    shape: VehicleShape,
    modes: SlowModes,
    samples: tuple[np.ndarray, np.ndarray],
) -> None:
    """Lines of the arguments in [-1, 1], `raw` before they are clipped, and what is watched."""
    (z, u), k, speed, linear = samples, features.lateral, features.speed, shape.linearised
    sizes = largest(z[:, :speed])
    roll = linear.output_a[shape.model.outputs.index("roll")]
    seen = np.vstack([linear.velocity_a[2], linear.velocity_a[0], roll, roll @ linear.a])
    rows = np.column_stack([seen @ modes.right[:, :k], seen @ modes.static_response])
    values = np.column_stack([z[:, :k], u[:, 0]]) @ rows.T
    values = np.where(OVER_SPEED, values / (shape.speed + z[:, speed:]), values)
    steering = u[:, : features.inputs.steering]
    reach = HULL * largest(np.column_stack([values, u[:, 0], z[:, speed], steering[:, 1:]]))
    part = features.let(1.0 / (features.parameter(shape.speed) + features.z[speed]))
    lateral = [*features.z[:k], features.u[0]]
    moved = [
        features.weighted(lateral, row / most) for row, most in zip(rows, reach[:4], strict=True)
    ]
    lines = [part * m if over else m for m, over in zip(moved, OVER_SPEED, strict=True)]
    steered = features.u[: steering.shape[1]]
    others = steered[0], features.z[speed], *steered[1:]
    lines += [features.parameter(1.0 / most) * x for x, most in zip(others, reach[4:], strict=True)]
    factor, names = features.parameter(HULL), (*NAMES, *DERIVATIVES[: len(steered) - 1])
    for i, (line, name) in enumerate(zip(lines, names, strict=True)):
        raw = features.line(f"raw{i}", line)
        features.watched.append((factor * raw, name))
    for i, name in enumerate((*ARGUMENTS, "m")):
        features.line(name, clipped(features.by_name[f"raw{i}"]))
    for (name,), coordinate, most in zip(features.coordinates, features.z, sizes, strict=False):
        features.line(name, features.parameter(1.0 / most) * coordinate)


def _add_torques(
    features: SlowFeatures,
    shape: VehicleShape,
    samples: tuple[np.ndarray, np.ndarray],
) -> None:
    """Lines of the torques of each axle, as parts of the training range.

    `T` of both wheels, `D` what the left one has more, `t` what both have per friction, `g` its
    size: it tells how much of the grip the tires need.
    """
    speed = features.let(features.parameter(shape.speed) + features.z[features.speed])
    slow = features.parameter((BRAKE_SPEED * float(shape.model.parameters["tire_radius"])) ** 2)
    held = features.let(speed / np.sqrt(speed * speed + slow))
    for axle, wheels in enumerate(AXLES):
        left, right = (features.torque(wheel, held) for wheel in wheels)
        features.line(f"T{axle}", left + right)
        features.line(f"D{axle}", left - right)
        grip = features.friction_of(axle)
        per_grip = left + right if grip is None else (left + right) / grip
        features.line(f"t{axle}", per_grip)
    names = [f"{kind}{axle}" for kind in "TDt" for axle in (0, 1)]
    sizes = largest(features.columns([(name,) for name in names], *samples))
    features.reach = dict(zip(names, sizes.tolist(), strict=True))
    for name, most in features.reach.items():
        features.line(name, features.parameter(1.0 / most) * features.by_name[name])
    for axle in (0, 1):
        use, name = features.by_name[f"t{axle}"], f"torque of axle {axle + 1}"
        features.watched.append((use, name))
        clip = features.line(f"t{axle}", clipped(use))
        features.line(f"g{axle}", abs(clip))
