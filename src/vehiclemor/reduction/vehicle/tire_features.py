"""Features with exact tire forces at quasi-static slips and loads of the wheels.

The slip and the load of every wheel are polynomials in few arguments a: lateral speed and yaw rate
over the speed, roll angle, roll rate over the speed, steering.  A vehicle is its own mirror image:
of the two wheels of an axle the mean slip and the load's difference are odd in a, the slip's
difference and the mean load even.  What the tire makes of slip and load is its own law, E. Fiala,
see `multibody/components/tires`, at free rolling.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from vehiclemor.multibody.quantities import WHEELS
from vehiclemor.reduction.vehicle.features import Features, monomials

# Reduced coordinates: lateral speed, yaw rate, roll angle, roll rate, deviation of the speed.
STATES = 5
SPEED = 4
AXLES = (WHEELS[:2], WHEELS[2:])
NAMES = ("lateral speed", "yaw rate", "roll", "roll rate", "steering", "speed")
ARGUMENTS = tuple(f"a{i}" for i in range(5))
# Part of its static load that a wheel keeps, so that no force is divided by zero.
LEAST_LOAD = 0.02
# Linear terms: coordinates, steering, and as many of its derivatives as the model has.
ODD = ARGUMENTS
CUBIC = monomials(ARGUMENTS, 3)
SQUARE = monomials(ARGUMENTS, 2)
# What changes with the speed.
FASTER = tuple(f"m * {a}" for a in ARGUMENTS)
FASTER_SQUARE = tuple(f"m * {pair}" for pair in SQUARE)


@dataclass
class Text:
    """Lines of features under construction, with the parameters that they name."""

    lines: list[tuple[str, str]] = field(default_factory=list)
    values: list[float] = field(default_factory=list)
    limits: list[tuple[str, str]] = field(default_factory=list)

    def parameter(self, value: float) -> str:
        """Text of a new parameter."""
        self.values.append(float(value))
        return f"p[{len(self.values) - 1}]"

    def let(self, name: str, text: str) -> str:
        """A new line; its name."""
        self.lines.append((name, text))
        return name

    def sum(self, name: str, terms: Sequence[str], weights: Sequence[float]) -> str:
        """A new line with a weighted sum."""
        parts = [f"{self.parameter(w)} * {t}" for t, w in zip(terms, weights, strict=True)]
        return self.let(name, " + ".join(parts))

    def copy(self) -> Text:
        """A copy that can grow on its own."""
        return Text(list(self.lines), list(self.values), list(self.limits))

    def features(self, inputs: int, terms: Sequence[str], odd: int = 0) -> Features:
        """Features of these terms; the first ones are the odd ones."""
        numbers = tuple(range(len(terms)))
        groups = ((numbers[:odd], (0, 1, 2, 3, 5, 7)), (numbers[odd:], (SPEED, 6))) if odd else ()
        lines, limits = tuple(self.lines), tuple(self.limits)
        return Features(STATES, inputs, lines, tuple(terms), groups, (4, 1), limits)


def arguments(speed: float, ranges: np.ndarray, hull: float, inputs: int) -> Text:
    """Lines of the arguments, in [-1, 1], `raw` where they are not held.

    Parameters
    ----------
    speed
        Of straight running in m/s.
    ranges
        Largest value of each argument (6,) in the training runs, in the order of `NAMES`.
    hull
        Multiple of it beyond which nothing is known.
    inputs
        Number of inputs.
    """
    text = Text()
    text.let("part", f"1.0 / ({text.parameter(speed)} + z{SPEED})")
    kinds = ("part * z0", "part * z1", "z2", "part * z3", "u0", f"z{SPEED}")
    for i, kind in enumerate(kinds):
        text.let(f"raw{i}", f"{text.parameter(1.0 / (hull * ranges[i]))} * {kind}")
        text.limits.append((f"raw{i}", NAMES[i]))
        text.let("m" if i == 5 else f"a{i}", held(f"raw{i}"))
    for j in range(1, inputs):
        text.let(f"d{j}", f"u{j}")
    return text


def held(name: str) -> str:
    """A value held in [-1, 1]."""
    return f"0.5 * (abs({name} + 1.0) - abs({name} - 1.0))"


def fiala(text: Text, wheel: str, slip: str, load: str, p: Mapping[str, float]) -> None:
    """Lines `F`, `M`, `G` of a wheel: lateral force, aligning moment per width, 1 - |y| squared.

    Parameters
    ----------
    slip, load
        Names of the tangent of the slip angle and of the load in N.
    p
        Parameters of the tire, see `tire_coefficients.FIALA`.
    """
    fall = text.parameter(p["largest_friction"] - p["smallest_friction"])
    most = text.parameter(p["largest_friction"])
    limit = text.let(f"limit_{wheel}", f"{load} * ({most} - {fall} * abs({slip}))")
    drive = text.parameter(p["cornering_stiffness"] / 3.0)
    text.let(f"y_{wheel}", f"{drive} * {slip} / {limit}")
    text.limits.append((f"{text.parameter(1.0 / p['saturation'])} * y_{wheel}", f"saturation of the {wheel} tire"))
    y = text.let(f"c_{wheel}", held(f"y_{wheel}"))
    left = text.let(f"left_{wheel}", f"1.0 - abs({y})")
    text.let(f"G_{wheel}", f"{left} * {left}")
    scale = text.parameter(1.0 / p["load"])
    share = text.let(f"share_{wheel}", f"{scale} * {limit} * {y}")
    text.let(f"F_{wheel}", f"-{share} * (3.0 - 3.0 * abs({y}) + {y} * {y})")
    text.let(f"M_{wheel}", f"{share} * G_{wheel} * {left}")


def axle_lines(text: Text, axle: int, load: float, p: Mapping[str, float]) -> None:
    """Lines of an axle from those of its mean and half differences of slip and load.

    Named with the number of the axle: forces `F`, aligning moments `M`, their differences from left
    to right `FD`, `MD`, factors of stiffness `G`, and `GD`.
    """
    for wheel, sign in zip(AXLES[axle], ("+", "-"), strict=True):
        slip = text.let(f"slip_{wheel}", f"slip{axle} {sign} slip_half{axle}")
        raw = text.let(f"given_{wheel}", f"load{axle} {sign} load_half{axle}")
        least = text.parameter(LEAST_LOAD * load)
        held_load = text.let(
            f"load_{wheel}", f"0.5 * ({raw} + {least} + abs({raw} - {least}))"
        )
        fiala(text, wheel, slip, held_load, {**p, "load": load})
    left, right = AXLES[axle]
    for kind in "FMG":
        text.let(f"{kind}{axle}", f"{kind}_{left} + {kind}_{right}")
        text.let(f"{kind}D{axle}", f"{kind}_{left} - {kind}_{right}")


def linear_terms(inputs: int) -> list[str]:
    """Odd terms of the slips and loads, and of the equations, that are not held."""
    raw = [*(f"raw{i}" for i in range(5)), *(f"d{j}" for j in range(1, inputs))]
    return raw


def odd_candidates() -> list[str]:
    """Odd terms that the equations may need beside the linear ones and the tire forces."""
    found = [*CUBIC, *(f"m * {a}" for a in ARGUMENTS)]
    for axle in (0, 1):
        found += [f"m * F{axle}", f"m * M{axle}", f"GD{axle}"]
        found += [f"G{axle} * {a}" for a in ARGUMENTS]
        found += [f"FD{axle} * {a}" for a in ARGUMENTS]
        found += [f"F{axle} * {pair}" for pair in SQUARE]
    return found


def even_candidates(inputs: int) -> list[str]:
    """Even terms that vanish in straight running at any speed."""
    found = [*SQUARE, *(f"m * {pair}" for pair in SQUARE)]
    for axle in (0, 1):
        found += [f"FD{axle}", f"MD{axle}", f"F{axle} * F{axle}"]
        found += [f"F{axle} * {a}" for a in ARGUMENTS]
        found += [f"M{axle} * {a}" for a in ARGUMENTS]
        found += [f"m * F{axle} * {a}" for a in ARGUMENTS]
    found += [f"d{j} * {a}" for j in range(1, inputs) for a in ARGUMENTS]
    return found
