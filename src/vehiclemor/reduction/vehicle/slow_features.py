"""Features of slow motion: few arguments, forces of the axles, and products of these.

Fast motion follows the slow one, so that slips and loads of the wheels are functions of few
arguments: lateral speed and yaw rate over the speed, roll angle, roll rate over the speed and
steering, each held within its training range.  A vehicle is its own mirror image: terms are odd in
the arguments in the lateral equations, and even in those of speed, heave and pitch.

Of tires with Fiala's law, see `multibody/components/tires`, the forces are those of the law at
free rolling, at slips and loads of all wheels that are sums of products of the arguments (two-track
model with load transfer: M. Mitschke, H. Wallentowitz, Dynamik der Kraftfahrzeuge, 5th ed.,
Springer 2014).  Of any other tires they are powers of the mean slip of each axle.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from vehiclemor.multibody.components.tire_coefficients import FIALA
from vehiclemor.multibody.quantities import WHEELS
from vehiclemor.reduction.vehicle.features import Features, feature_columns, held, monomials
from vehiclemor.reduction.vehicle.lifting_loops import MOVING
from vehiclemor.reduction.vehicle.regression import forward_selection, largest, ridge_fit
from vehiclemor.reduction.vehicle.shape import ShapeSamples, VehicleShape
from vehiclemor.reduction.vehicle.slow_modes import SlowModes
from vehiclemor.simulation.dynamic import DynamicModel

AXLES = (WHEELS[:2], WHEELS[2:])
# Lines of an axle: sums of both wheels' lateral force, aligning moment and part of the contact that
# sticks, and what the left one has more.
FORCES = ("F", "M", "G", "FD", "MD", "GD")
MEAN, HALF = np.array([0.5, 0.5]), np.array([0.5, -0.5])
# Terms, their columns (samples, terms), and how many of them are given.
Table = tuple[Sequence[str], np.ndarray, int]
ARGUMENTS = tuple(f"a{i}" for i in range(5))
NAMES = ("lateral speed", "yaw rate", "roll", "roll rate", "steering", "change of speed")
DERIVATIVES = ("rate of steering", "acceleration of steering")
# Arguments that go as one over the speed.
OVER_SPEED = (True, True, False, True)
SQUARE, CUBIC = monomials(ARGUMENTS, 2), monomials(ARGUMENTS, 3)
LINEAR = tuple(f"raw{i}" for i in range(len(ARGUMENTS)))
# What changes with the speed.
FASTER = tuple(f"m * {a}" for a in ARGUMENTS)
FASTER_SQUARE = tuple(f"m * {pair}" for pair in SQUARE)
# Arguments are held beyond this multiple of their training range.
HULL = 1.1
# Products in each sum that is a slip or a load of wheels, and the weight of their sizes.
WHEEL_TERMS, RIDGE = 9, 1e-12
# Part of its static load that a wheel keeps, so that no force is divided by zero.
LEAST_LOAD = 0.02
# Part of the slip at which all of a tire's contact slides that is trusted.
SATURATION = 1.2
# Part of heave and pitch at the start that samples after the landing still show, and how much of
# it, in parts of what samples show, a car may have that is steered.
AFTER_LANDING, STEERED = 0.3, 1.2


@dataclass
class FeatureText:
    """Lines of features under construction, with the parameters that they name.

    Attributes
    ----------
    lateral, symmetric, inputs
        How many coordinates steering moves, how many others there are, and how many inputs.  After
        the coordinates comes the speed.
    watched, besides
        (expression, what it is) of what is watched: lateral motion, then the rest.
    coordinates
        Coordinates as parts of their training range.
    forces
        Kinds of lines of an axle, whose index stands behind them.
    """

    lateral: int
    symmetric: int
    inputs: int
    lines: list[tuple[str, str]] = field(default_factory=list)
    values: list[float] = field(default_factory=list)
    watched: list[tuple[str, str]] = field(default_factory=list)
    besides: list[tuple[str, str]] = field(default_factory=list)
    coordinates: list[str] = field(default_factory=list)
    forces: tuple[str, ...] = ()

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
    def derivatives(self) -> list[str]:
        """Lines of the derivatives of the steering."""
        return [f"raw{len(NAMES) + j}" for j in range(self.inputs - 1)]

    def parameter(self, value: float) -> str:
        """Text of a new parameter."""
        self.values.append(float(value))
        return f"p[{len(self.values) - 1}]"

    def let(self, name: str, text: str) -> str:
        """A new line; its name."""
        self.lines.append((name, text))
        return name

    def weighted(self, terms: Iterable[str], weights: Iterable[float]) -> str:
        """Text of a weighted sum of the terms with a weight."""
        pairs = zip(terms, weights, strict=True)
        return " + ".join(f"{self.parameter(w)} * {term}" for term, w in pairs if w)

    def features(self, terms: Sequence[str], odd: int = 0) -> Features:
        """Features of these terms; the first ones are the odd ones."""
        numbers = tuple(range(len(terms)))
        groups = (numbers[:odd], self.odd_columns), (numbers[odd:], self.even_columns)
        watched = (*self.watched, *self.besides)
        return Features(
            self.speed + 1,
            self.inputs,
            tuple(self.lines),
            tuple(terms),
            groups if odd else (),
            watched,
            len(self.watched),
        )

    def columns(self, terms: Sequence[str], z: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Terms (samples, terms) of coordinates (samples, states) and inputs."""
        return feature_columns(self.features(terms), z, u, np.array(self.values))


def feature_text(
    shape: VehicleShape, modes: SlowModes, samples: ShapeSamples, trusted: float, reversal: float
) -> FeatureText:
    """Lines of arguments and of the axles' forces, with what of training samples they need.

    A run isn't trusted whose arguments leave the multiple `trusted` of their training range, or the
    product of steering and its rate the multiple `reversal`: where much steering is taken back
    fast, loads lag behind.
    """
    z = modes.coordinates(samples.deviations, samples.inputs)
    text = FeatureText(modes.lateral, len(modes.rates) - modes.lateral, samples.inputs.shape[1])
    _add_arguments(text, shape, modes, (z, samples.inputs), (HULL / trusted, reversal))
    _add_axles(text, shape.model, samples, z)
    return text


def _add_arguments(
    text: FeatureText,
    shape: VehicleShape,
    modes: SlowModes,
    samples: tuple[np.ndarray, np.ndarray],
    edges: tuple[float, float],
) -> None:
    """Lines of the arguments in [-1, 1], `raw` where they are not held, and what is watched."""
    (z, u), k, speed, linear = samples, text.lateral, text.speed, shape.linearised
    sizes = largest(z[:, :speed])
    roll = linear.output_a[shape.model.outputs.index("roll")]
    seen = np.vstack([linear.motion_a[2], linear.motion_a[0], roll, roll @ linear.a])
    rows = np.column_stack([seen @ modes.right[:, :k], seen @ modes.static_response])
    values = np.column_stack([z[:, :k], u[:, 0]]) @ rows.T
    values = np.where(OVER_SPEED, values / (shape.speed + z[:, speed:]), values)
    reach = HULL * largest(np.column_stack([values, u[:, 0], z[:, speed], u[:, 1:]]))
    text.let("part", f"1.0 / ({text.parameter(shape.speed)} + z{speed})")
    lateral = [*(f"z{j}" for j in range(k)), "u0"]
    moved = [text.weighted(lateral, row / most) for row, most in zip(rows, reach[:4], strict=True)]
    lines = [f"part * ({m})" if over else m for m, over in zip(moved, OVER_SPEED, strict=True)]
    others = ["u0", f"z{speed}", *(f"u{j}" for j in range(1, text.inputs))]
    lines += [text.weighted([x], [1.0 / most]) for x, most in zip(others, reach[4:], strict=True)]
    factor, names = text.parameter(edges[0]), (*NAMES, *DERIVATIVES[: text.inputs - 1])
    for i, (line, name) in enumerate(zip(lines, names, strict=True)):
        text.let(f"raw{i}", line)
        # Alone of them the speed changes without steering.
        watched = text.besides if name == NAMES[-1] else text.watched
        watched.append((f"{factor} * raw{i}", name))
    for i, name in enumerate((*ARGUMENTS, "m")):
        text.let(name, held(f"raw{i}"))
    if text.inputs > 1:
        most = edges[1] * largest(u[:, :1] * u[:, 1:2])
        text.watched.append((text.weighted(["u0 * u1"], 1.0 / most), "reversal of the steering"))
    text.coordinates = [text.weighted([f"z{i}"], [1.0 / most]) for i, most in enumerate(sizes)]
    # More heave and pitch than corners make is known only where the car runs straight.
    steered = held(f"{1.0 / MOVING!r} * ({' + '.join(f'abs({a})' for a in ARGUMENTS)})")
    alive = f"({AFTER_LANDING!r} + {(1.0 / STEERED - AFTER_LANDING)!r} * ({steered}))"
    text.besides += [(f"{alive} * {own}", "heave and pitch") for own in text.coordinates[k:]]


def _add_axles(
    text: FeatureText, model: DynamicModel, samples: ShapeSamples, z: np.ndarray
) -> None:
    """Lines of the axles' forces."""
    odd = [*LINEAR, *text.derivatives, *CUBIC, *FASTER]
    even = ["1.0", "m", *SQUARE, *FASTER_SQUARE]
    columns = text.columns([*odd, *even], z, samples.inputs)
    # Terms, their columns, and how many of the first ones every sum has.
    of_odd = odd, columns[:, : len(odd)], len(LINEAR) + len(text.derivatives)
    of_even = even, columns[:, len(odd) :], 1
    # Zero in straight running at any speed.
    of_turning = even[2:], columns[:, len(odd) + 2 :], 0

    def add_sum(name: str, values: np.ndarray, among: Table, more: int = WHEEL_TERMS) -> str:
        terms, table, given = among
        chosen = forward_selection(table, values[:, None], given, more)
        weights = ridge_fit(table[:, chosen], values, RIDGE)
        return text.let(name, text.weighted([terms[i] for i in chosen], weights))

    def of_wheels(kind: str, wheels: Sequence[str]) -> np.ndarray:
        return samples.outputs[:, [model.outputs.index(f"{kind}_{wheel}") for wheel in wheels]]

    exact = set(FIALA) <= set(model.parameters.entries)
    text.forces = FORCES if exact else FORCES[:3]
    for axle, wheels in enumerate(AXLES):
        slips = np.tan(of_wheels("slip_angle", wheels))
        if not exact:
            mean = slips @ MEAN
            add_sum(f"mean{axle}", mean / (HULL * largest(mean[:, None])), of_odd, 0)
            text.let(f"slip{axle}", held(f"mean{axle}"))
            text.let(f"G{axle}", f"abs(slip{axle})")
            text.let(f"F{axle}", f"slip{axle} * G{axle}")
            text.let(f"M{axle}", f"F{axle} * G{axle}")
            continue
        loads = of_wheels("Fz", wheels)
        add_sum(f"slip{axle}", slips @ MEAN, of_odd)
        add_sum(f"slip_half{axle}", slips @ HALF, of_turning)
        add_sum(f"load{axle}", loads @ MEAN, of_even)
        add_sum(f"load_half{axle}", loads @ HALF, of_odd)
        tire = {name: float(model.parameters[name]) for name in FIALA}
        for wheel, sign in zip(wheels, "+-", strict=True):
            slip = text.let(f"slip_{wheel}", f"slip{axle} {sign} slip_half{axle}")
            load = text.let(f"given_{wheel}", f"load{axle} {sign} load_half{axle}")
            add_fiala(text, wheel, (slip, load), tire, float(loads.mean()))
        left, right = wheels
        for kind in FORCES[:3]:
            text.let(f"{kind}{axle}", f"{kind}_{left} + {kind}_{right}")
            text.let(f"{kind}D{axle}", f"{kind}_{left} - {kind}_{right}")


def add_fiala(
    text: FeatureText,
    wheel: str,
    at: tuple[str, str],
    tire: Mapping[str, float],
    static_load: float,
) -> None:
    """Lines of a wheel: `F` lateral force, `M` aligning moment, `G` its part that still sticks.

    Forces as parts of the static load, moments as parts of it times the width, from the lines of
    the tangent of the slip angle and of the load in N.
    """
    (slip, given), parameter, let = at, text.parameter, text.let
    least = parameter(LEAST_LOAD * static_load)
    load = let(f"load_{wheel}", f"0.5 * ({given} + {least} + abs({given} - {least}))")
    fall = parameter(tire["largest_friction"] - tire["smallest_friction"])
    friction = f"({parameter(tire['largest_friction'])} - {fall} * abs({slip}))"
    limit = let(f"limit_{wheel}", f"{load} * {friction}")
    raw = let(f"y_{wheel}", f"{parameter(tire['cornering_stiffness'] / 3.0)} * {slip} / {limit}")
    edge = parameter(1.0 / SATURATION)
    text.watched.append((f"{edge} * {raw}", f"saturation of the {wheel} tire"))
    y = let(f"c_{wheel}", held(raw))
    left = let(f"left_{wheel}", f"1.0 - abs({y})")
    let(f"G_{wheel}", f"{left} * {left}")
    share = let(f"share_{wheel}", f"{parameter(1.0 / static_load)} * {limit} * {y}")
    let(f"F_{wheel}", f"-{share} * (3.0 - 3.0 * abs({y}) + {y} * {y})")
    let(f"M_{wheel}", f"{share} * G_{wheel} * {left}")


def given_terms(text: FeatureText) -> tuple[list[str], list[str]]:
    """Odd and even terms that the equations always have."""
    k, forces = text.lateral, [f"{kind}{axle}" for kind in "FM" for axle in (0, 1)]
    odd = [*text.coordinates[:k], LINEAR[-1], *text.derivatives, *forces]
    return odd, ["1.0", f"z{text.speed}", *text.coordinates[k:]]


def odd_candidates(text: FeatureText) -> list[str]:
    """Odd terms that the equations may need besides."""
    found = [*CUBIC, *FASTER]
    for axle in (0, 1):
        found += [f"m * F{axle}", f"m * M{axle}"]
        found += [f"GD{axle}"] if "GD" in text.forces else []
        factors = [kind for kind in ("G", "FD") if kind in text.forces]
        found += [f"{kind}{axle} * {a}" for kind in factors for a in ARGUMENTS]
        found += [f"F{axle} * {pair}" for pair in SQUARE]
    moved = (*ARGUMENTS, "F0", "F1")
    return [*found, *(f"{own} * {a}" for own in text.coordinates[text.lateral :] for a in moved)]


def even_candidates(text: FeatureText) -> list[str]:
    """Even terms that the equations may need besides; zero in straight running at any speed."""
    found = [*SQUARE, *FASTER_SQUARE]
    for axle in (0, 1):
        found += [f"{kind}{axle}" for kind in ("FD", "MD") if kind in text.forces]
        found += [f"F{axle} * F{axle}"]
        found += [f"{kind}{axle} * {a}" for kind in ("F", "M", "m * F") for a in ARGUMENTS]
    return [*found, *(f"{rate} * {a}" for rate in text.derivatives for a in ARGUMENTS)]
