"""Forces of the axles as features, by the model's own tire law.

Of tires with Fiala's law or the brush model, see `multibody/components/tires`, the forces are those
of the law at slips, thrusts and loads of all wheels that are sums of products of the arguments
(two-track model with load transfer: M. Mitschke, H. Wallentowitz, Dynamik der Kraftfahrzeuge, 5th
ed., Springer 2014).  Of any other tires they are powers of the mean slip of each axle.  Friction
acts by similarity: what counts is a slip, or a torque, over the friction.
"""

from collections.abc import Mapping, Sequence
from functools import reduce
from operator import add

import numpy as np

from vehiclemor.codegen.operations import Value
from vehiclemor.multibody.quantities import FIALA
from vehiclemor.reduction.vehicle.candidates import LINEAR, wheel_terms
from vehiclemor.reduction.vehicle.features import product
from vehiclemor.reduction.vehicle.fitting import forward_selection, largest, ridge_fit
from vehiclemor.reduction.vehicle.shape import ShapeSamples
from vehiclemor.reduction.vehicle.slow_features import AXLES, HULL, Names, SlowFeatures, clipped
from vehiclemor.simulation.dynamic import DynamicModel

# Lines of an axle: sums of both wheels' lateral force, aligning moment and part of the contact that
# slides, and what the left one has more.
FORCES = ("F", "M", "G", "FD", "MD", "GD")
MEAN, HALF = np.array([0.5, 0.5]), np.array([0.5, -0.5])
# Terms, their columns (samples, terms), and how many of the first ones a fit has in any case.
Table = tuple[Sequence[Names], np.ndarray, int]
# Products in each sum that is a slip or a load of wheels, also with torques; weight of their sizes.
WHEEL_TERMS, DRIVEN_TERMS, RIDGE = 9, 15, 1e-12
# Part of its static load that a wheel keeps, so that no force is divided by zero.
LEAST_LOAD = 0.02
# Part of the slip at which all of a tire's contact slides that is trusted.
SATURATION = 1.2
# Least deflection of the contact, so that its direction is one; Newton's steps to the deflection
# that gives a tire its longitudinal force, and the largest part of the sliding one that they reach.
LEAST_DEFLECTION, NEWTON, STEEPEST = 1e-9, 2, 0.9


def add_axles(
    features: SlowFeatures, model: DynamicModel, samples: ShapeSamples, z: np.ndarray
) -> None:
    """Add lines of the axles' forces, fitted on training samples with coordinates z."""
    fit = _WheelFit(features, samples, z)
    known = set(FIALA) <= set(model.parameters.entries)
    features.forces, add_axle = (FORCES, _add_tires) if known else (FORCES[:3], _add_powers)
    for axle, wheels in enumerate(AXLES):
        add_axle(fit, model, axle, wheels)


class _WheelFit:
    """Fits of what wheels do by sums of terms."""

    def __init__(self, features: SlowFeatures, samples: ShapeSamples, z: np.ndarray) -> None:
        self.features, self.samples = features, samples
        odd, even, thrusts = wheel_terms(features)
        columns = features.columns([*odd, *even, *thrusts], z, samples.inputs)
        first, last = len(odd), len(odd) + len(even)
        # Terms, their columns, and how many of the first ones every sum has.
        self.odd: Table = odd, columns[:, :first], len(LINEAR) + len(features.derivatives)
        self.even: Table = even, columns[:, first:last], 1
        # Zero in straight running at any speed, and zero without torques.
        self.turning: Table = even[2:], columns[:, first + 2 : last], 0
        self.driven: Table = thrusts, columns[:, last:], 0

    def __call__(self, values: np.ndarray, among: Table, more: int | None = None) -> Value:
        """The sum of terms that fits values (samples,), with so many terms more than needed."""
        return self.features.let(reduce(add, self.parts(values, among, more)))

    def parts(self, values: np.ndarray, among: Table, more: int | None = None) -> list[Value]:
        """The sum of the terms that it has in any case, and that of the chosen ones."""
        terms, table, given = among
        most = DRIVEN_TERMS if self.features.inputs.torques else WHEEL_TERMS
        chosen = forward_selection(table, values[:, None], given, most if more is None else more)
        weights = ridge_fit(table[:, chosen], values, RIDGE)
        products = [product(self.features.term(terms[i])) for i in chosen]
        halves = [half for half in (slice(given), slice(given, None)) if products[half]]
        sums = (self.features.weighted(products[half], weights[half]) for half in halves)
        return [self.features.let(each) for each in sums]

    def outputs(self, model: DynamicModel, kind: str, wheels: Sequence[str]) -> np.ndarray:
        """An output of the training samples at wheels (samples, wheels)."""
        return self.samples.outputs[:, [model.outputs.index(f"{kind}_{w}") for w in wheels]]


def _add_powers(fit: _WheelFit, model: DynamicModel, axle: int, wheels: Sequence[str]) -> None:
    """Powers of the mean slip of an axle: tires of any law."""
    features = fit.features
    mean = np.tan(fit.outputs(model, "slip_angle", wheels)) @ MEAN
    grip, grips = features.friction_of(axle), features.grips(axle, fit.samples.inputs)
    slip = fit(mean / (HULL * largest((mean / grips)[:, None])), fit.odd, 0)
    if grip is None:
        slip = features.let(clipped(slip))
        size = features.line(f"G{axle}", abs(slip))
        force = features.line(f"F{axle}", slip * size)
    else:
        per_grip = features.let(clipped(features.let(slip / grip)))
        size = features.line(f"G{axle}", abs(per_grip))
        force = features.line(f"F{axle}", features.line(f"S{axle}", grip * per_grip) * size)
    moment = features.line(f"M{axle}", force * size)
    features.by_name |= {f"FC{axle}": force, f"MC{axle}": moment}


def _add_tires(fit: _WheelFit, model: DynamicModel, axle: int, wheels: Sequence[str]) -> None:
    """Forces of both tires of an axle by their own law."""
    features = fit.features
    slips = np.tan(fit.outputs(model, "slip_angle", wheels))
    loads = fit.outputs(model, "Fz", wheels)
    small, curved = fit.parts(slips @ MEAN, fit.odd)
    slip, slip_half = features.let(small + curved), fit(slips @ HALF, fit.turning)
    load, load_half = fit(loads @ MEAN, fit.even), fit(loads @ HALF, fit.odd)
    tire = {name: float(model.parameters[name]) for name in FIALA}
    tire["static_load"] = float(loads.mean())
    thrusts: list[Value | None] = [None, None]
    if features.inputs.torques:
        values = fit.outputs(model, "Fx", wheels)
        thrust, thrust_half = fit(values @ MEAN, fit.driven), fit(values @ HALF, fit.odd)
        thrusts = [thrust + thrust_half, thrust - thrust_half]
    sides = (slip + slip_half, load + load_half), (slip - slip_half, load - load_half)
    left, right = (
        add_fiala(features, tire, wheel, *side, thrust)
        for wheel, side, thrust in zip(wheels, sides, thrusts, strict=True)
    )
    for kind, one, other in zip(FORCES, left, right, strict=False):
        features.line(f"{kind}{axle}", one + other)
        features.line(f"{kind}D{axle}", one - other)
    stiffness = 2.0 * tire["cornering_stiffness"] / tire["static_load"]
    for kind, slope in (("F", -stiffness), ("M", stiffness / 3.0)):
        proportional = features.parameter(slope) * small
        features.line(f"{kind}C{axle}", features.by_name[f"{kind}{axle}"] - proportional)


def add_fiala(
    features: SlowFeatures,
    tire: Mapping[str, float],
    wheel: str,
    slip: Value,
    load: Value,
    thrust: Value | None,
) -> tuple[Value, Value, Value]:
    """Lateral force and aligning moment of a wheel, and its part that slides.

    Given are the tire's parameters and its static load, the tangent of the slip angle, the load
    and, with torques, the longitudinal force in N.  Forces are parts of the static load, moments
    parts of it times the width.  Without torques it is Fiala's law at free rolling, else the brush
    model, at the slip ratio that its longitudinal force needs.
    """
    static, parameter, let = tire["static_load"], features.parameter, features.let
    slip, load, least = let(slip), let(load), parameter(LEAST_LOAD * static)
    load, friction = let(0.5 * (load + least + abs(load - least))), features.friction(wheel)
    grip = load if friction is None else let(load * friction)
    most = parameter(tire["largest_friction"])
    fall = parameter(tire["largest_friction"] - tire["smallest_friction"])
    across, deflection = let(parameter(tire["cornering_stiffness"] / 3.0) * slip), None
    if thrust is None:
        limit = let(grip * (most - fall * abs(slip)))
        raw = let(across / limit)
    else:
        thrust, per_slip = let(thrust), tire["longitudinal_slip_stiffness"] / 3.0

        def friction_force(along: Value) -> Value:
            ratio = let(parameter(1.0 / per_slip) * along)
            return let(grip * (most - fall * np.sqrt(slip * slip + ratio * ratio)))

        along = let(thrust * (1.0 / 3.0))
        along = _deflected(features, along, across, (thrust, friction_force(along)))
        limit = friction_force(along)
        nothing = parameter(LEAST_DEFLECTION * static**2)
        deflection = let(np.sqrt(across * across + along * along + nothing))
        raw = let(deflection / limit)
    features.watched.append((parameter(1.0 / SATURATION) * raw, f"saturation of the {wheel} tire"))
    y = let(clipped(raw))
    left = let(1.0 - abs(y))
    sticking = let(left * left)
    share = let(parameter(1.0 / static) * limit * y)
    if deflection is not None:
        share = let(share * across / deflection)
    force = let(-share * (3.0 - 3.0 * abs(y) + y * y))
    return force, let(share * sticking * left), let(1.0 - sticking)


def _deflected(
    features: SlowFeatures, along: Value, across: Value, forces: tuple[Value, Value]
) -> Value:
    """Longitudinal deflection that gives a brush its thrust, by Newton steps from a first one.

    Deflections times stiffness over 3, as the friction force and the thrust in N.
    """
    let, (thrust, limit) = features.let, forces
    for _ in range(NEWTON):
        part = let(np.sqrt(along * along + across * across + 1e-6 * limit * limit) / limit)
        part = let(0.5 * (part + STEEPEST - abs(part - STEEPEST)))
        force = let(3.0 - 3.0 * part + part * part)
        steep = let(along / limit)
        slope = let(force - (3.0 - 2.0 * part) * steep * steep / part)
        along = let(along - (along * force - thrust) / slope)
    return along
