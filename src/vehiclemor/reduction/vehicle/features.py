"""Features: functions of reduced coordinates and inputs, in which reduced equations are linear.

One text serves both sides: evaluated on arrays it makes the columns of a fit, and as a compiled
kernel it makes the right-hand side of the reduced vehicle

    z' = C_z phi(z, u),  psi' = C_r phi
    X' = U cos(psi) - V sin(psi),  Y' = U sin(psi) + V cos(psi),  (U, V) = C_UV phi

Coefficients are constants of the kernel: fits with the same features compile nothing new.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement

# After the reduced coordinates z come heading and place.
PLANAR = 3


@dataclass(frozen=True)
class Features:
    """Text of features.

    Attributes
    ----------
    states, inputs
        Numbers of reduced coordinates `z0, z1, ...` and of inputs `u0, u1, ...`.
    lines
        Assignments `name = expression` of what the features share, in order; they may use
        parameters `p[i]`.
    terms
        Expression of each feature.
    groups
        (numbers of features, columns of C) of each block of C that is not zero; all if empty.
    watched
        (expression, what it is) of what tells how far a run goes: at a magnitude of 1 it leaves
        what the features were made for.
    lateral
        How many of these, the first ones, move when the vehicle is steered: how long they do
        counts too.
    """

    states: int
    inputs: int
    lines: tuple[tuple[str, str], ...]
    terms: tuple[str, ...]
    groups: tuple[tuple[tuple[int, ...], tuple[int, ...]], ...] = ()
    watched: tuple[tuple[str, str], ...] = ()
    lateral: int = 0

    @property
    def blocks(self) -> tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]:
        """Blocks of C: numbers of features, columns."""
        everything = tuple(range(len(self.terms))), tuple(range(self.states + PLANAR))
        return self.groups or (everything,)


def monomials(names: Sequence[str], degree: int) -> tuple[str, ...]:
    """All products of that many of the names."""
    return tuple(" * ".join(part) for part in combinations_with_replacement(names, degree))


def linear_features(states: int, inputs: int) -> Features:
    """1, z and u."""
    terms = ("1.0", *(f"z{i}" for i in range(states)), *(f"u{i}" for i in range(inputs)))
    return Features(states, inputs, (), terms)
