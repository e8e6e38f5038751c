"""Terms that the equations of a reduced vehicle have or may have, by the names of their lines.

A vehicle is its own mirror image: terms are odd in the arguments in the lateral equations, and even
in those of speed, heave and pitch.  Torques of both wheels of an axle are even, what the left one
has more is odd.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement, product

from vehiclemor.reduction.vehicle.slow_features import ARGUMENTS, FAST, ONE, Names, SlowFeatures

SQUARE = (*combinations_with_replacement(ARGUMENTS, 2),)
CUBIC = (*combinations_with_replacement(ARGUMENTS, 3),)
LINEAR = tuple((f"raw{i}",) for i in range(len(ARGUMENTS)))
# What changes with the speed.
FASTER = tuple(("m", a) for a in ARGUMENTS)
FASTER_SQUARE = tuple(("m", *pair) for pair in SQUARE)
# Torques of both axles, and how much of their friction the tires need for them; what the left wheel
# has more.
TORQUES, USES = ("T0", "T1"), ("t0", "t1")
LEFT = (("D0",), ("D1",))


def wheel_terms(features: SlowFeatures) -> tuple[list[Names], list[Names], list[Names]]:
    """Odd and even terms of slips and loads of the wheels, and even ones of their thrust."""
    odd = [*LINEAR, *features.derivatives, *CUBIC, *FASTER]
    even = [ONE, FAST, *SQUARE, *FASTER_SQUARE]
    if not features.inputs.torques:
        return odd, even, []
    odd += [(torque, a) for torque in (*TORQUES, *USES) for a in ARGUMENTS]
    odd += LEFT
    even += [*((torque,) for torque in TORQUES), *product(TORQUES, FAST)]
    even += combinations_with_replacement(TORQUES, 2)
    thrusts: list[Names] = []
    for torque in TORQUES:
        thrusts += [(torque,), (torque, "m"), *((torque, other) for other in TORQUES)]
        thrusts += [(torque, *pair) for pair in SQUARE]
    return odd, even, thrusts


@dataclass(frozen=True)
class Required:
    """Terms that the equations always have."""

    # Of small steering, with what left wheels have more of a torque, and of straight running: odd
    # and even ones whose coefficients are those of the linearised vehicle.
    small: Sequence[Names]
    straight: Sequence[Names]
    # Others, whose coefficients are fitted.
    odd: Sequence[Names]
    even: Sequence[Names]


def required_terms(features: SlowFeatures) -> Required:
    """Terms that the equations always have."""
    k, odd = features.lateral, [(f"{kind}C{axle}",) for kind in "FM" for axle in (0, 1)]
    small = [*features.coordinates[:k], LINEAR[-1], *features.derivatives]
    straight = [ONE, (f"z{features.speed}",), *features.coordinates[k:]]
    if not features.inputs.torques:
        return Required(small, straight, odd, ())
    changing = (*LINEAR[:-1], *features.coordinates[:k])
    odd += [("m", *argument) for argument in changing]
    return Required([*small, *LEFT], straight, odd, [(torque,) for torque in (*TORQUES, *USES)])


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
    symmetric = features.coordinates[features.lateral :]
    terms += [(*coordinate, a) for coordinate in symmetric for a in factors]
    others = [*SQUARE, *((f"G{axle}",) for axle in (0, 1))]
    terms += [(*rate, *other) for rate in features.derivatives for other in others]
    if not features.inputs.torques:
        return terms
    terms += product(TORQUES, (*factors, "M0", "M1"))
    terms += [(*pair, a) for pair in combinations_with_replacement(TORQUES, 2) for a in factors]
    for axle in (0, 1):
        lines = [f"{kind}{axle}" for kind in "FMS" if f"{kind}{axle}" in features.by_name]
        use, size = f"t{axle}", f"g{axle}"
        for line in lines:
            terms += [(use, line), (size, line), (use, use, line), (use, size, line)]
            terms += [(use, line, "m"), (use, use, line, "m")]
            terms += [(use, torque, line) for torque in TORQUES]
        terms += [(f"D{axle}", "m"), *product((f"D{axle}",), TORQUES)]
    return terms


def even_candidates(features: SlowFeatures) -> list[Names]:
    """Even terms that the equations may need besides; zero in straight running at any speed."""
    terms = [*SQUARE, *FASTER_SQUARE]
    for axle in (0, 1):
        terms += [(f"{kind}{axle}",) for kind in ("FD", "MD") if kind in features.forces]
        force, moment = f"F{axle}", f"M{axle}"
        terms += [(force, force)]
        terms += [(*kind, a) for kind in ((force,), (moment,), ("m", force)) for a in ARGUMENTS]
    terms += [(*rate, a) for rate in features.derivatives for a in ARGUMENTS]
    if not features.inputs.torques:
        return terms
    terms += [*product(TORQUES, FAST), *combinations_with_replacement(TORQUES, 2)]
    terms += [(torque, *pair) for torque in TORQUES for pair in SQUARE]
    symmetric = features.coordinates[features.lateral :]
    terms += [(*coordinate, torque) for coordinate in symmetric for torque in TORQUES]
    for axle in (0, 1):
        use, size = f"t{axle}", f"g{axle}"
        terms += [(use, size), (use, use), (use, use, use), (use, "m"), (use, size, "m")]
        terms += [(use, *pair) for pair in SQUARE]
        terms += [(f"T{axle}", f"F{axle}", a) for a in ARGUMENTS]
        terms += [(f"t{axle}", f"F{axle}", a) for a in ARGUMENTS]
        terms += [(f"D{axle}", a) for a in ARGUMENTS]
    return terms
