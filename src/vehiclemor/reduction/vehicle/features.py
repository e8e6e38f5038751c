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
from functools import cached_property
from itertools import combinations_with_replacement

import numpy as np

from vehiclemor.codegen.kernels import Kernels, kernel_sources
from vehiclemor.codegen.weighted_sums import padded
from vehiclemor.reduction.vehicle.feature_kernels import (
    PLANAR,
    columns_text,
    diagonal_blocks,
    kernel_text,
)
from vehiclemor.simulation.paths import along
from vehiclemor.simulation.system import System


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
    diagonal
        Sizes of the diagonal blocks, from the first reduced coordinate on, outside of which the
        Jacobian of z' is zero at the reference; a kernel of the exponential method uses them.
    """

    states: int
    inputs: int
    lines: tuple[tuple[str, str], ...]
    terms: tuple[str, ...]
    groups: tuple[tuple[tuple[int, ...], tuple[int, ...]], ...] = ()
    diagonal: tuple[int, ...] = ()

    @property
    def blocks(self) -> tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]:
        """Blocks of C: numbers of features, columns."""
        everything = tuple(range(len(self.terms))), tuple(range(self.states + PLANAR))
        return self.groups or (everything,)

    def at(self, z: np.ndarray, u: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """Features (samples, terms) of reduced coordinates (samples, states) and inputs."""
        sizes = self.states, self.inputs, len(self.terms)
        return along(self._columns, "columns", parameters, (z, u), sizes)

    @cached_property
    def _columns(self) -> Kernels:
        return Kernels(kernel_sources(columns_text(self)))

    def system(
        self,
        parameters: np.ndarray,
        coefficients: np.ndarray,
        error_scale: np.ndarray,
        reference: np.ndarray,
    ) -> System:
        """The reduced vehicle as the compiled loops take it.

        Parameters
        ----------
        parameters
            Of the features.
        coefficients
            C (terms, states + 3): columns of z', then of psi', U and V.
        error_scale
            Magnitude of each state (states + 3,) below which errors count absolutely.
        reference
            Reduced coordinates (states,) at which the Jacobian is frozen.
        """
        blocks = [np.zeros((len(terms), padded(len(c)))) for terms, c in self.blocks]
        for block, (terms, columns) in zip(blocks, self.blocks, strict=True):
            block[:, : len(columns)] = coefficients[np.ix_(terms, columns)]
        constants = np.concatenate([parameters, *(block.ravel() for block in blocks)])
        dim = self.states + PLANAR
        fused = {"ros34pw2": "ros34pw2_step"} | ({"etdrk4": "etdrk4_step"} if self.diagonal else {})
        return System(
            Kernels(kernel_sources(kernel_text(self, len(parameters)))),
            constants,
            self.inputs,
            np.concatenate([reference, np.zeros(PLANAR)]),
            error_scale,
            np.arange(dim - 2),
            np.zeros(0, dtype=np.int64),
            fused,
            diagonal=diagonal_blocks(self.diagonal),
        )


def monomials(names: Sequence[str], degree: int) -> tuple[str, ...]:
    """All products of that many of the names."""
    return tuple(" * ".join(part) for part in combinations_with_replacement(names, degree))


def polynomial_features(states: int, inputs: int, degree: int = 1) -> Features:
    """1, z, u, and products of reduced coordinates up to a degree."""
    z = [f"z{i}" for i in range(states)]
    terms = ["1.0", *z, *(f"u{i}" for i in range(inputs))]
    for power in range(2, degree + 1):
        terms += monomials(z, power)
    return Features(states, inputs, (), tuple(terms))
