"""Features: functions of reduced coordinates and inputs, in which reduced equations are linear.

One text serves both sides: evaluated on arrays it makes the columns of a fit, and as a compiled
kernel it makes the right-hand side of the reduced vehicle

    z' = C_z phi(z, u),  psi' = C_r phi
    X' = U cos(psi) - V sin(psi),  Y' = U sin(psi) + V cos(psi),  (U, V) = C_UV phi

Coefficients are constants of the kernel: fits with the same features compile nothing new.
"""

from collections.abc import Sequence
from functools import cached_property
from itertools import combinations_with_replacement

import numpy as np

from vehiclemor.codegen.kernels import Kernels, kernel_sources
from vehiclemor.codegen.weighted_sums import padded
from vehiclemor.reduction.vehicle.feature_kernels import (
    PLANAR,
    FeatureText,
    columns_text,
    diagonal_blocks,
    kernel_text,
)
from vehiclemor.simulation.paths import along
from vehiclemor.simulation.system import System


class Features(FeatureText):
    """Features that can be evaluated, and made the right-hand side of a reduced vehicle."""

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
        """The reduced vehicle as the compiled loops take it, with arguments of `ReducedVehicle`.

        Columns of the coefficients are those of z', then of psi', U and V; the Jacobian is frozen
        at the reference (states,).
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
