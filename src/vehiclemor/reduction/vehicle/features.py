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

import numpy as np

from vehiclemor.codegen.cache import load_module
from vehiclemor.codegen.link import kernels_source
from vehiclemor.codegen.weighted_sums import padded
from vehiclemor.reduction.vehicle.feature_kernels import PLANAR, diagonal_blocks, kernel_text
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

    # What is evaluated is text of this package, not of a user.
    def at(self, z: np.ndarray, u: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """Features (samples, terms) of reduced coordinates (samples, states) and inputs."""
        values: dict[str, object] = {"abs": np.abs, "p": parameters}
        values |= {f"z{i}": z[:, i] for i in range(self.states)}
        values |= {f"u{i}": u[:, i] for i in range(self.inputs)}
        for name, expression in self.lines:
            values[name] = eval(expression, {"__builtins__": {}}, values)  # noqa: S307
        columns = [eval(term, {"__builtins__": {}}, values) for term in self.terms]  # noqa: S307
        return np.column_stack([np.broadcast_to(column, len(z)) for column in columns])

    def system(
        self,
        parameters: np.ndarray,
        coefficients: np.ndarray,
        typical: np.ndarray,
        reference: np.ndarray,
    ) -> System:
        """The reduced vehicle as the compiled loops take it.

        Parameters
        ----------
        parameters
            Of the features.
        coefficients
            C (terms, states + 3): columns of z', then of psi', U and V.
        typical
            Magnitude of each state (states + 3,) below which errors count absolutely.
        reference
            Reduced coordinates (states,) at which the Jacobian is frozen.
        """
        blocks = [np.zeros((len(terms), padded(len(c)))) for terms, c in self.blocks]
        for block, (terms, columns) in zip(blocks, self.blocks, strict=True):
            block[:, : len(columns)] = coefficients[np.ix_(terms, columns)]
        constants = np.concatenate([parameters, *(block.ravel() for block in blocks)])
        sizes = {"WORK": 0, "CONSTANTS": len(constants)}
        text = kernel_text(self, len(parameters))
        kernels = load_module("features", kernels_source(text, sizes, "features"))
        machines = kernels._derivative_machine, kernels._w_step_machine
        addresses = [machines[0].address, 0, machines[1].address, 0]
        if self.diagonal:
            addresses[3] = kernels._exponential_step_machine.address
        dim = self.states + PLANAR
        return System(
            (constants, np.array(addresses, dtype=np.int64)),
            self.inputs,
            np.concatenate([reference, np.zeros(PLANAR)]),
            typical,
            np.arange(dim - 2),
            np.zeros(0, dtype=np.int64),
            stepped=True,
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
