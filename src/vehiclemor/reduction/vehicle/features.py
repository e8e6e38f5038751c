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
from functools import lru_cache
from itertools import combinations_with_replacement

from vehiclemor.codegen.foreign_texts import MOST_CHARACTERS, MOST_SIZE, check_line
from vehiclemor.codegen.vector_lanes import padded
from vehiclemor.sizes import apart, require

# After the reduced coordinates z come heading and place.
PLANAR = 3
# Reduced coordinates that a file may have; the models of this package have at most 9.
MOST_STATES = 100


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

    def check_sizes(self) -> None:
        """Raise `ValueError` if the texts are more than arithmetic of what they are given."""
        needed_parameters(self)

    @property
    def blocks(self) -> tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]:
        """Blocks of C: numbers of features, columns."""
        everything = tuple(range(len(self.terms))), tuple(range(self.states + PLANAR))
        return self.groups or (everything,)


@lru_cache(maxsize=64)
def needed_parameters(features: Features) -> int:
    """Number of parameters that the texts need; `ValueError` if they reach into anything else."""
    states, inputs, columns = features.states, features.inputs, features.states + PLANAR
    require(0 < states <= MOST_STATES and 0 <= inputs <= MOST_STATES, "states")
    lines = [*features.lines, *(("term", text) for text in features.terms)]
    lines += [("watched", text) for text, _ in features.watched]
    require(sum(len(text) for _, text in lines) <= MOST_CHARACTERS, "features")
    known = {f"z{i}" for i in range(states)} | {f"u{i}" for i in range(inputs)}
    sizes, most = [], 0
    for number, (name, text) in enumerate(lines):
        size, needed = check_line(name, text, known)
        sizes.append(size)
        most = max(most, needed)
        if number < len(features.lines):
            known.add(name)
    own, total = sizes[len(features.lines) :], sum(sizes)
    require(len(features.groups) <= columns, "groups")
    for terms, targets in features.blocks:
        apart("groups", terms, len(features.terms))
        apart("groups", targets, columns)
        require(bool(terms and targets), "groups")
        total += sum(own[j] for j in terms) + len(terms) * padded(len(targets))
    require(total <= MOST_SIZE, "features")
    return most


def monomials(names: Sequence[str], degree: int) -> tuple[str, ...]:
    """All products of that many of the names."""
    return tuple(" * ".join(part) for part in combinations_with_replacement(names, degree))


def linear_features(states: int, inputs: int) -> Features:
    """1, z and u."""
    terms = ("1.0", *(f"z{i}" for i in range(states)), *(f"u{i}" for i in range(inputs)))
    return Features(states, inputs, (), terms)
