"""Features of slow motion: few arguments, forces of the axles, and products of these.

Fast motion follows the slow one, so that slips and loads of the wheels are functions of few
arguments: lateral speed and yaw rate over the speed, roll angle, roll rate over the speed and
steering, each clipped to its training range.  A vehicle is its own mirror image: terms are odd in
the arguments in the lateral equations, and even in those of speed, heave and pitch.

Of tires with Fiala's law, see `multibody/components/tires`, the forces are those of the law at
free rolling, at slips and loads of all wheels that are sums of products of the arguments (two-track
model with load transfer: M. Mitschke, H. Wallentowitz, Dynamik der Kraftfahrzeuge, 5th ed.,
Springer 2014).  Of any other tires they are powers of the mean slip of each axle.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import reduce
from itertools import combinations_with_replacement
from operator import add

import numpy as np

from vehiclemor.codegen.operations import Value
from vehiclemor.multibody.quantities import FIALA, WHEELS
from vehiclemor.reduction.vehicle.features import (
    FeatureListing,
    Features,
    feature_columns,
    product,
)
from vehiclemor.reduction.vehicle.fitting import forward_selection, largest, ridge_fit
from vehiclemor.reduction.vehicle.linear_modes import SlowModes
from vehiclemor.reduction.vehicle.shape import ShapeSamples, VehicleShape
from vehiclemor.simulation.dynamic import DynamicModel

AXLES = (WHEELS[:2], WHEELS[2:])
# Lines of an axle: sums of both wheels' lateral force, aligning moment and part of the contact that
# slides, and what the left one has more.
FORCES = ("F", "M", "G", "FD", "MD", "GD")
MEAN, HALF = np.array([0.5, 0.5]), np.array([0.5, -0.5])
# Factors of a term, by the names of their lines.
Names = tuple[str, ...]
# Terms, their columns (samples, terms), and how many of the first ones a fit has in any case.
Table = tuple[Sequence[Names], np.ndarray, int]
ARGUMENTS = tuple(f"a{i}" for i in range(5))
NAMES = ("lateral speed", "yaw rate", "roll", "roll rate", "steering", "change of speed")
DERIVATIVES = ("rate of steering", "acceleration of steering")
# Arguments that go as one over the speed.
OVER_SPEED = (True, True, False, True)
SQUARE = (*combinations_with_replacement(ARGUMENTS, 2),)
CUBIC = (*combinations_with_replacement(ARGUMENTS, 3),)
LINEAR = tuple((f"raw{i}",) for i in range(len(ARGUMENTS)))
ONE, FAST = ("1",), ("m",)
# What changes with the speed.
FASTER = tuple(("m", a) for a in ARGUMENTS)
FASTER_SQUARE = tuple(("m", *pair) for pair in SQUARE)
# Arguments are clipped at this multiple of their training range.
HULL = 1.1
# Products in each sum that is a slip or a load of wheels, and the weight of their sizes.
WHEEL_TERMS, RIDGE = 9, 1e-12
# Part of its static load that a wheel keeps, so that no force is divided by zero.
LEAST_LOAD = 0.02
# Part of the slip at which all of a tire's contact slides that is trusted.
SATURATION = 1.2


def clipped(value: Value) -> Value:
    """A value clipped to [-1, 1]: nothing is known beyond the training runs."""
    return 0.5 * (abs(value + 1.0) - abs(value - 1.0))


class SlowFeatures(FeatureListing):
    """Lines of features under construction, by name, with the parameters that they take."""

    def __init__(self, lateral: int, symmetric: int, inputs: int) -> None:
        super().__init__(lateral + symmetric + 1, inputs)
        # How many coordinates steering moves, and how many others there are; then comes the speed.
        self.lateral, self.symmetric = lateral, symmetric
        self.values: list[float] = []  # Of the parameters.
        # Name of a line -> its value.
        self.by_name = {f"z{i}": z for i, z in enumerate(self.z)} | {"1": self.number(1.0)}
        self.watched: list[tuple[Value, str]] = []  # (value, what it is).
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
        return [(f"raw{len(NAMES) + j}",) for j in range(len(self.u) - 1)]

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

    def of_terms(self, terms: Sequence[Names], odd: int = 0) -> Features:
        """Features of these terms; the first ones are the odd ones."""
        indices = tuple(range(len(terms)))
        groups = (indices[:odd], self.odd_columns), (indices[odd:], self.even_columns)
        watched = [((value,), meaning) for value, meaning in self.watched]
        factors = [self.term(names) for names in terms]
        return self.features(factors, groups if odd else (), watched)

    def columns(self, terms: Sequence[Names], z: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Terms (samples, terms) of coordinates (samples, states) and inputs."""
        return feature_columns(self.of_terms(terms), z, u, np.array(self.values))


def slow_features(
    shape: VehicleShape, modes: SlowModes, samples: ShapeSamples, trusted: float, reversal: float
) -> SlowFeatures:
    """Lines of arguments and of the axles' forces, with what of training samples they need.

    A run isn't trusted whose arguments leave the multiple `trusted` of their training range, or the
    product of steering and its rate the multiple `reversal`: where much steering is taken back
    fast, loads lag behind.
    """
    z = modes.coordinates(samples.deviations, samples.inputs)
    features = SlowFeatures(
        modes.lateral, len(modes.rates) - modes.lateral, samples.inputs.shape[1]
    )
    _add_arguments(features, shape, modes, (z, samples.inputs), (HULL / trusted, reversal))
    _add_axles(features, shape.model, samples, z)
    return features


def _add_arguments(
    features: SlowFeatures,
    shape: VehicleShape,
    modes: SlowModes,
    samples: tuple[np.ndarray, np.ndarray],
    edges: tuple[float, float],
) -> None:
    """Lines of the arguments in [-1, 1], `raw` before they are clipped, and what is watched."""
    (z, u), k, speed, linear = samples, features.lateral, features.speed, shape.linearised
    sizes = largest(z[:, :speed])
    roll = linear.output_a[shape.model.outputs.index("roll")]
    seen = np.vstack([linear.velocity_a[2], linear.velocity_a[0], roll, roll @ linear.a])
    rows = np.column_stack([seen @ modes.right[:, :k], seen @ modes.static_response])
    values = np.column_stack([z[:, :k], u[:, 0]]) @ rows.T
    values = np.where(OVER_SPEED, values / (shape.speed + z[:, speed:]), values)
    reach = HULL * largest(np.column_stack([values, u[:, 0], z[:, speed], u[:, 1:]]))
    part = features.let(1.0 / (features.parameter(shape.speed) + features.z[speed]))
    lateral = [*features.z[:k], features.u[0]]
    moved = [
        features.weighted(lateral, row / most) for row, most in zip(rows, reach[:4], strict=True)
    ]
    lines = [part * m if over else m for m, over in zip(moved, OVER_SPEED, strict=True)]
    others = features.u[0], features.z[speed], *features.u[1:]
    lines += [features.parameter(1.0 / most) * x for x, most in zip(others, reach[4:], strict=True)]
    factor, names = features.parameter(edges[0]), (*NAMES, *DERIVATIVES[: len(features.u) - 1])
    for i, (line, name) in enumerate(zip(lines, names, strict=True)):
        raw = features.line(f"raw{i}", line)
        features.watched.append((factor * raw, name))
    for i, name in enumerate((*ARGUMENTS, "m")):
        features.line(name, clipped(features.by_name[f"raw{i}"]))
    if len(features.u) > 1:
        most = edges[1] * largest(u[:, :1] * u[:, 1:2])
        reversal = features.weighted([features.u[0] * features.u[1]], 1.0 / most)
        features.watched.append((reversal, "reversal of the steering"))
    for (name,), coordinate, most in zip(features.coordinates, features.z, sizes, strict=False):
        features.line(name, features.parameter(1.0 / most) * coordinate)


def _add_axles(
    features: SlowFeatures, model: DynamicModel, samples: ShapeSamples, z: np.ndarray
) -> None:
    """Lines of the axles' forces."""
    odd = [*LINEAR, *features.derivatives, *CUBIC, *FASTER]
    even = [ONE, FAST, *SQUARE, *FASTER_SQUARE]
    columns = features.columns([*odd, *even], z, samples.inputs)
    # Terms, their columns, and how many of the first ones every sum has.
    of_odd = odd, columns[:, : len(odd)], len(LINEAR) + len(features.derivatives)
    of_even = even, columns[:, len(odd) :], 1
    # Zero in straight running at any speed.
    of_turning = even[2:], columns[:, len(odd) + 2 :], 0

    def parts(values: np.ndarray, among: Table, more: int = WHEEL_TERMS) -> list[Value]:
        """The sum of the terms that a fit has in any case, and that of the chosen ones."""
        terms, table, given = among
        chosen = forward_selection(table, values[:, None], given, more)
        weights = ridge_fit(table[:, chosen], values, RIDGE)
        products = [product(features.term(terms[i])) for i in chosen]
        halves = [slice(given), slice(given, None)]
        return [
            features.let(features.weighted(products[h], weights[h])) for h in halves if products[h]
        ]

    def fitted(values: np.ndarray, among: Table, more: int = WHEEL_TERMS) -> Value:
        return features.let(reduce(add, parts(values, among, more)))

    def of_wheels(kind: str, wheels: Sequence[str]) -> np.ndarray:
        return samples.outputs[:, [model.outputs.index(f"{kind}_{wheel}") for wheel in wheels]]

    exact = set(FIALA) <= set(model.parameters.entries)
    features.forces = FORCES if exact else FORCES[:3]
    for axle, wheels in enumerate(AXLES):
        slips = np.tan(of_wheels("slip_angle", wheels))
        if not exact:
            mean = slips @ MEAN
            slip = features.let(clipped(fitted(mean / (HULL * largest(mean[:, None])), of_odd, 0)))
            size = features.line(f"G{axle}", abs(slip))
            force = features.line(f"F{axle}", slip * size)
            moment = features.line(f"M{axle}", force * size)
            features.by_name |= {f"FC{axle}": force, f"MC{axle}": moment}
            continue
        loads = of_wheels("Fz", wheels)
        small, curved = parts(slips @ MEAN, of_odd)
        slip, slip_half = features.let(small + curved), fitted(slips @ HALF, of_turning)
        load, load_half = fitted(loads @ MEAN, of_even), fitted(loads @ HALF, of_odd)
        tire = {name: float(model.parameters[name]) for name in FIALA}, float(loads.mean())
        left = add_fiala(features, wheels[0], slip + slip_half, load + load_half, tire)
        right = add_fiala(features, wheels[1], slip - slip_half, load - load_half, tire)
        for kind, one, other in zip(FORCES, left, right, strict=False):
            features.line(f"{kind}{axle}", one + other)
            features.line(f"{kind}D{axle}", one - other)
        stiffness = 2.0 * tire[0]["cornering_stiffness"] / tire[1]
        for kind, slope in (("F", -stiffness), ("M", stiffness / 3.0)):
            proportional = features.parameter(slope) * small
            features.line(f"{kind}C{axle}", features.by_name[f"{kind}{axle}"] - proportional)


def add_fiala(
    features: SlowFeatures,
    wheel: str,
    slip: Value,
    load: Value,
    tire: tuple[Mapping[str, float], float],
) -> tuple[Value, Value, Value]:
    """Lateral force and aligning moment of a wheel, and its part that slides.

    Forces as parts of the static load, moments as parts of it times the width, from the tangent of
    the slip angle and the load in N.  Of the tire: its parameters and the static load in N.
    """
    (values, static), parameter, let = tire, features.parameter, features.let
    slip, load, least = let(slip), let(load), parameter(LEAST_LOAD * static)
    load = let(0.5 * (load + least + abs(load - least)))
    fall = parameter(values["largest_friction"] - values["smallest_friction"])
    limit = let(load * (parameter(values["largest_friction"]) - fall * abs(slip)))
    raw = let(parameter(values["cornering_stiffness"] / 3.0) * slip / limit)
    features.watched.append((parameter(1.0 / SATURATION) * raw, f"saturation of the {wheel} tire"))
    y = let(clipped(raw))
    left = let(1.0 - abs(y))
    sticking = let(left * left)
    share = let(parameter(1.0 / static) * limit * y)
    force = let(-share * (3.0 - 3.0 * abs(y) + y * y))
    return force, let(share * sticking * left), let(1.0 - sticking)


def required_terms(features: SlowFeatures) -> tuple[list[Names], list[Names]]:
    """Odd and even terms that the equations always have; the last four odd ones are not linear."""
    k, forces = features.lateral, [(f"{kind}C{axle}",) for kind in "FM" for axle in (0, 1)]
    odd = [*features.coordinates[:k], LINEAR[-1], *features.derivatives, *forces]
    return odd, [ONE, (f"z{features.speed}",), *features.coordinates[k:]]


def odd_candidates(features: SlowFeatures) -> list[Names]:
    """Odd terms that the equations may need besides."""
    terms = [*CUBIC, *FASTER, *(("m", *term) for term in FASTER)]
    for axle in (0, 1):
        terms += [("m", f"F{axle}"), ("m", f"M{axle}")]
        terms += [(f"GD{axle}",)] if "GD" in features.forces else []
        kinds = [kind for kind in ("G", "FD") if kind in features.forces]
        terms += [(f"{kind}{axle}", a) for kind in kinds for a in ARGUMENTS]
        terms += [(f"F{axle}", *pair) for pair in SQUARE]
    factors = (*ARGUMENTS, "F0", "F1")
    others = [*SQUARE, *((f"G{axle}",) for axle in (0, 1))]
    terms += [(*rate, *other) for rate in features.derivatives for other in others]
    symmetric = features.coordinates[features.lateral :]
    return [*terms, *((*coordinate, a) for coordinate in symmetric for a in factors)]


def even_candidates(features: SlowFeatures) -> list[Names]:
    """Even terms that the equations may need besides; zero in straight running at any speed."""
    terms = [*SQUARE, *FASTER_SQUARE]
    for axle in (0, 1):
        terms += [(f"{kind}{axle}",) for kind in ("FD", "MD") if kind in features.forces]
        force, moment = f"F{axle}", f"M{axle}"
        terms += [(force, force)]
        terms += [(*kind, a) for kind in ((force,), (moment,), ("m", force)) for a in ARGUMENTS]
    return [*terms, *((*rate, a) for rate in features.derivatives for a in ARGUMENTS)]
