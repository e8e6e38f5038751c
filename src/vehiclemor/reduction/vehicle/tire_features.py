"""Features with exact tire forces at quasi-static slips and loads of the wheels.

The slip and the load of every wheel are polynomials in few arguments a: lateral speed and yaw rate
over the speed, roll angle, roll rate over the speed, steering.  A vehicle is its own mirror image:
of the two wheels of an axle the mean slip and the load's difference are odd in a, the slip's
difference and the mean load even.  What the tire makes of slip and load is its own law, E. Fiala,
see `multibody/components/tires`, at free rolling.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vehiclemor.codegen.operations import Value
from vehiclemor.multibody.quantities import WHEELS
from vehiclemor.reduction.vehicle.features import (
    FeatureListing,
    Features,
    Term,
    held,
    monomials,
    product,
)

# Reduced coordinates: lateral speed, yaw rate, roll angle, roll rate, deviation of the speed.
STATES = 5
SPEED = 4
# Columns of the coefficients of odd terms and of even ones.
LATERAL, SYMMETRIC = (0, 1, 2, 3, 5, 7), (SPEED, 6)
AXLES = (WHEELS[:2], WHEELS[2:])
NAMES = ("lateral speed", "yaw rate", "roll", "roll rate", "steering")
OF_SPEED = "change of speed"
DERIVATIVES = ("rate of steering", "acceleration of steering")
# Part of its static load that a wheel keeps, so that no force is divided by zero.
LEAST_LOAD = 0.02


class TireFeatures(FeatureListing):
    """Features under construction, with their parameters and what they are products of.

    The first parameter multiplies all that is watched.

    Attributes
    ----------
    parameters
        Values of the parameters.
    raw
        Arguments and derivatives of the steering, scaled, not held.
    a, m
        Arguments and the change of speed, held.
    by_name
        Slips, loads, forces and moments of axles and wheels.
    """

    def __init__(self, inputs: int) -> None:
        super().__init__(STATES, inputs)
        self.parameters = [1.0]
        self.watched: list[tuple[Term, str]] = []
        self.raw: list[Value] = []
        self.a: list[Value] = []
        self.m: Value
        self.by_name: dict[str, Value] = {}

    def parameter(self, value: float) -> Value:
        """A new parameter."""
        self.parameters.append(float(value))
        return self.p(len(self.parameters) - 1)

    def sum(self, terms: Sequence[Term], weights: Sequence[float]) -> Value:
        """A weighted sum."""
        pairs = zip(weights, terms, strict=True)
        first, *others = [product((self.parameter(weight), *term)) for weight, term in pairs]
        return self.let(sum(others, first))

    def of(self, terms: Sequence[Term], odd: int = 0) -> Features:
        """Features of these terms; the first ones are the odd ones."""
        numbers = tuple(range(len(terms)))
        groups = ((numbers[:odd], LATERAL), (numbers[odd:], SYMMETRIC)) if odd else ()
        # The change of speed comes last: alone it moves without steering.
        watched = [((self.p(0), *term), name) for term, name in self.watched]
        watched.sort(key=lambda of: of[1] == OF_SPEED)
        lateral = max(len(watched) - 1, 0)
        return self.features(terms, groups, watched, lateral)

    @property
    def square(self) -> tuple[Term, ...]:
        """Products of two arguments."""
        return monomials(self.a, 2)

    @property
    def cubic(self) -> tuple[Term, ...]:
        """Products of three arguments."""
        return monomials(self.a, 3)

    def faster(self, terms: Iterable[Term]) -> list[Term]:
        """What changes with the speed."""
        return [(self.m, *term) for term in terms]

    def alone(self, values: Iterable[Value]) -> list[Term]:
        """Values as terms."""
        return [(value,) for value in values]


def argument_values(speed: float, z: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Arguments (samples, 5), change of the speed, and derivatives of the steering, not scaled."""
    part = 1.0 / (speed + z[:, SPEED])
    moved = np.column_stack([z[:, 0] * part, z[:, 1] * part, z[:, 2], z[:, 3] * part])
    return np.column_stack([moved, u[:, 0], z[:, SPEED], u[:, 1:]])


def arguments(inputs: int, speed: float, reach: np.ndarray, reversal: float) -> TireFeatures:
    """The arguments in [-1, 1], `raw` where they are not held.

    Each of `argument_values` may go as far as `reach`, the product of the steering and its rate as
    far as `reversal`: where much steering is taken back fast, loads lag behind.
    """
    made = TireFeatures(inputs)
    z, u = made.z, made.u
    part = made.let(1.0 / (made.parameter(speed) + z[SPEED]))
    moving: list[Term] = [(part, z[0]), (part, z[1]), (z[2],), (part, z[3]), (u[0],)]
    kinds = [*moving, (z[SPEED],), *made.alone(u[1:])]
    for most, name, kind in zip(reach, (*NAMES, OF_SPEED, *DERIVATIVES), kinds, strict=False):
        made.raw.append(made.let(product((made.parameter(1.0 / most), *kind))))
        made.watched.append(((made.raw[-1],), name))
        if len(made.raw) <= len(NAMES) + 1:
            made.a.append(made.let(held(made.raw[-1])))
    made.m = made.a.pop()
    reversed_ = made.parameter(1.0 / reversal), u[0], u[1]
    made.watched.append((reversed_, "reversal of the steering"))
    return made


@dataclass(frozen=True)
class Tire:
    """A wheel's tire: parameters, static load in N, and how far it may saturate."""

    parameters: Mapping[str, float]
    load: float
    saturation: float


def fiala(made: TireFeatures, wheel: str, slip: Value, load: Value, tire: Tire) -> list[Value]:
    """Lateral force and aligning moment of a wheel, and its part that still sticks.

    Forces as parts of the static load, moments as parts of it times the width, from the tangent of
    the slip angle and the load in N.
    """
    p, parameter, let = tire.parameters, made.parameter, made.let
    fall = parameter(p["largest_friction"] - p["smallest_friction"])
    limit = let(load * (parameter(p["largest_friction"]) - fall * abs(slip)))
    raw = let(parameter(p["cornering_stiffness"] / 3.0) * slip / limit)
    used = parameter(1.0 / tire.saturation), raw
    made.watched.append((used, f"saturation of the {wheel} tire"))
    y = let(held(raw))
    left = let(1.0 - abs(y))
    sticking = let(left * left)
    share = let(parameter(1.0 / tire.load) * limit * y)
    force = let(-share * (3.0 - 3.0 * abs(y) + y * y))
    return [force, let(share * sticking * left), sticking]


def add_axle(made: TireFeatures, axle: int, tire: Tire) -> None:
    """What the tires of an axle do, from the means and half differences of its slips and loads.

    Sums `F`, `M`, `G` of both wheels with the number of the axle, and `FD`, `MD`, `GD`, left less
    right.
    """
    named, wheels = made.by_name, []
    for wheel, sign in zip(AXLES[axle], (1, -1), strict=True):
        slip, load = (
            made.let(named[mean] + named[half] if sign > 0 else named[mean] - named[half])
            for mean, half in ((f"{kind}{axle}", f"{kind}_half{axle}") for kind in ("slip", "load"))
        )
        least = made.parameter(LEAST_LOAD * tire.load)
        load = made.let(0.5 * (load + least + abs(load - least)))
        wheels.append(fiala(made, wheel, slip, load, tire))
    for kind, left, right in zip("FMG", *wheels, strict=True):
        named[f"{kind}{axle}"] = made.let(left + right)
        named[f"{kind}D{axle}"] = made.let(left - right)


def odd_candidates(made: TireFeatures) -> list[Term]:
    """Odd terms that the equations may need beside the linear ones and the tire forces."""
    named, m = made.by_name, made.m
    found = [*made.cubic, *made.faster(made.alone(made.a))]
    for axle in (0, 1):
        force, moment = named[f"F{axle}"], named[f"M{axle}"]
        found += [(m, force), (m, moment), (named[f"GD{axle}"],)]
        found += [(named[f"{kind}{axle}"], a) for kind in ("G", "FD") for a in made.a]
        found += [(force, *pair) for pair in made.square]
    return found


def even_candidates(made: TireFeatures) -> list[Term]:
    """Even terms that vanish in straight running at any speed."""
    named = made.by_name
    found = [*made.square, *made.faster(made.square)]
    for axle in (0, 1):
        force, moment = named[f"F{axle}"], named[f"M{axle}"]
        found += [(named[f"FD{axle}"],), (named[f"MD{axle}"],), (force, force)]
        found += [(*kind, a) for kind in ((force,), (moment,), (made.m, force)) for a in made.a]
    return [*found, *((rate, a) for rate in made.raw[len(NAMES) + 1 :] for a in made.a)]
