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
from vehiclemor.reduction.vehicle.features import Features, held, monomials

# Reduced coordinates: lateral speed, yaw rate, roll angle, roll rate, deviation of the speed.
STATES = 5
SPEED = 4
# Columns of the coefficients of odd terms and of even ones.
LATERAL, SYMMETRIC = (0, 1, 2, 3, 5, 7), (SPEED, 6)
AXLES = (WHEELS[:2], WHEELS[2:])
NAMES = ("lateral speed", "yaw rate", "roll", "roll rate", "steering")
OF_SPEED = "change of speed"
DERIVATIVES = ("rate of steering", "acceleration of steering")
ARGUMENTS = tuple(f"a{i}" for i in range(5))
# Part of its static load that a wheel keeps, so that no force is divided by zero.
LEAST_LOAD = 0.02
CUBIC = monomials(ARGUMENTS, 3)
SQUARE = monomials(ARGUMENTS, 2)
# What changes with the speed.
FASTER = tuple(f"m * {a}" for a in ARGUMENTS)
FASTER_SQUARE = tuple(f"m * {pair}" for pair in SQUARE)


@dataclass
class Text:
    """Lines of features under construction, with the parameters that they name.

    The first parameter multiplies all that is watched.
    """

    lines: list[tuple[str, str]] = field(default_factory=list)
    values: list[float] = field(default_factory=lambda: [1.0])
    watched: list[tuple[str, str]] = field(default_factory=list)

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

    def features(self, inputs: int, terms: Sequence[str], odd: int = 0) -> Features:
        """Features of these terms; the first ones are the odd ones."""
        numbers = tuple(range(len(terms)))
        groups = ((numbers[:odd], LATERAL), (numbers[odd:], SYMMETRIC)) if odd else ()
        # The change of speed comes last: alone it moves without steering.
        watched = [(f"p[0] * {text}", name) for text, name in self.watched]
        watched.sort(key=lambda of: of[1] == OF_SPEED)
        lines, lateral = tuple(self.lines), max(len(watched) - 1, 0)
        return Features(STATES, inputs, lines, tuple(terms), groups, tuple(watched), lateral)


def argument_values(speed: float, z: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Arguments (samples, 5), change of the speed, and derivatives of the steering, not scaled."""
    part = 1.0 / (speed + z[:, SPEED])
    moved = np.column_stack([z[:, 0] * part, z[:, 1] * part, z[:, 2], z[:, 3] * part])
    return np.column_stack([moved, u[:, 0], z[:, SPEED], u[:, 1:]])


def arguments(speed: float, reach: np.ndarray, reversal: float) -> Text:
    """Lines of the arguments in [-1, 1], `raw` where they are not held.

    Each of `argument_values` may go as far as `reach`, the product of the steering and its rate as
    far as `reversal`: where much steering is taken back fast, loads lag behind.
    """
    text = Text()
    text.let("part", f"1.0 / ({text.parameter(speed)} + z{SPEED})")
    kinds = ("part * z0", "part * z1", "z2", "part * z3", "u0", f"z{SPEED}", "u1", "u2")
    names = (*NAMES, OF_SPEED, *DERIVATIVES)
    held_names = (*ARGUMENTS, "m")
    for i, most in enumerate(reach):
        text.let(f"raw{i}", f"{text.parameter(1.0 / most)} * {kinds[i]}")
        text.watched.append((f"raw{i}", names[i]))
        if i < len(held_names):
            text.let(held_names[i], held(f"raw{i}"))
    text.watched.append((f"{text.parameter(1.0 / reversal)} * u0 * u1", "reversal of the steering"))
    return text


@dataclass(frozen=True)
class Tire:
    """A wheel's tire: parameters, static load in N, and how far it may saturate."""

    parameters: Mapping[str, float]
    load: float
    saturation: float


def fiala(text: Text, wheel: str, slip: str, load: str, tire: Tire) -> None:
    """Lines of a wheel: `F` lateral force, `M` aligning moment, `G` its part that still sticks.

    Forces as parts of the static load, moments as parts of it times the width, from the lines of
    the tangent of the slip angle and of the load in N.
    """
    p, parameter, let = tire.parameters, text.parameter, text.let
    fall = parameter(p["largest_friction"] - p["smallest_friction"])
    limit = let(
        f"limit_{wheel}", f"{load} * ({parameter(p['largest_friction'])} - {fall} * abs({slip}))"
    )
    third = parameter(p["cornering_stiffness"] / 3.0)
    raw = let(f"y_{wheel}", f"{third} * {slip} / {limit}")
    text.watched.append(
        (f"{parameter(1.0 / tire.saturation)} * {raw}", f"saturation of the {wheel} tire")
    )
    y = let(f"c_{wheel}", held(raw))
    left = let(f"left_{wheel}", f"1.0 - abs({y})")
    let(f"G_{wheel}", f"{left} * {left}")
    share = let(f"share_{wheel}", f"{parameter(1.0 / tire.load)} * {limit} * {y}")
    let(f"F_{wheel}", f"-{share} * (3.0 - 3.0 * abs({y}) + {y} * {y})")
    let(f"M_{wheel}", f"{share} * G_{wheel} * {left}")


def axle_lines(text: Text, axle: int, tire: Tire) -> None:
    """Lines of an axle from those of the means and half differences of its slips and loads.

    Sums `F`, `M`, `G` of both wheels with the number of the axle, and `FD`, `MD`, `GD`, left less
    right.
    """
    left, right = AXLES[axle]
    for wheel, sign in ((left, "+"), (right, "-")):
        slip = text.let(f"slip_{wheel}", f"slip{axle} {sign} slip_half{axle}")
        given = text.let(f"given_{wheel}", f"load{axle} {sign} load_half{axle}")
        least = text.parameter(LEAST_LOAD * tire.load)
        load = text.let(f"load_{wheel}", f"0.5 * ({given} + {least} + abs({given} - {least}))")
        fiala(text, wheel, slip, load, tire)
    for kind in "FMG":
        text.let(f"{kind}{axle}", f"{kind}_{left} + {kind}_{right}")
        text.let(f"{kind}D{axle}", f"{kind}_{left} - {kind}_{right}")


def linear_terms(inputs: int) -> list[str]:
    """The arguments and derivatives of the steering; they are not held."""
    return [*(f"raw{i}" for i in range(5)), *_derivatives(inputs)]


def odd_candidates() -> list[str]:
    """Odd terms that the equations may need beside the linear ones and the tire forces."""
    found = [*CUBIC, *FASTER]
    for axle in (0, 1):
        found += [f"m * F{axle}", f"m * M{axle}", f"GD{axle}"]
        found += [f"{kind}{axle} * {a}" for kind in ("G", "FD") for a in ARGUMENTS]
        found += [f"F{axle} * {pair}" for pair in SQUARE]
    return found


def even_candidates(inputs: int) -> list[str]:
    """Even terms that vanish in straight running at any speed."""
    found = [*SQUARE, *FASTER_SQUARE]
    for axle in (0, 1):
        found += [f"FD{axle}", f"MD{axle}", f"F{axle} * F{axle}"]
        found += [f"{kind}{axle} * {a}" for kind in ("F", "M", "m * F") for a in ARGUMENTS]
    return [*found, *(f"{d} * {a}" for d in _derivatives(inputs) for a in ARGUMENTS)]


def _derivatives(inputs: int) -> list[str]:
    return [f"raw{5 + j}" for j in range(1, inputs)]
