"""Features: functions of reduced coordinates and inputs, in which reduced equations are linear.

One text serves both sides: evaluated on arrays it makes the columns of a fit, and as a compiled
kernel it makes the right-hand side of the reduced vehicle

    z' = C_z phi(z, u),  psi' = C_r phi
    X' = U cos(psi) - V sin(psi),  Y' = U sin(psi) + V cos(psi),  (U, V) = C_UV phi

 Coefficients are constants of the kernel: a fit compiles nothing new.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from vehiclemor.codegen.cache import load_module
from vehiclemor.codegen.link import kernels_source
from vehiclemor.simulation.system import System

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
    targets
        For each feature the columns of C that it has part in; all if empty.
    """

    states: int
    inputs: int
    lines: tuple[tuple[str, str], ...]
    terms: tuple[str, ...]
    targets: tuple[tuple[int, ...], ...] = ()

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

    def kernel(self, parameters: int) -> str:
        """Source of the kernel of the reduced vehicle; constants are parameters, then C."""
        count = self.states + PLANAR
        body = [f"z{i} = _x[{i}]" for i in range(self.states)]
        body += [f"u{i} = _u[{i}]" for i in range(self.inputs)]
        body += [f"{name} = {_constants(text)}" for name, text in self.lines]
        started: set[str] = set()
        for j, term in enumerate(self.terms):
            body.append(f"f{j} = {_constants(term)}")
            for i in self.targets[j] if self.targets else range(count):
                # One row of coefficients for each feature: neighbours become one vector.
                product = f"_constants[{parameters + j * count + i}] * f{j}"
                # Even and odd features apart: two short chains of sums instead of a long one.
                name = f"t{j % 2}_{i}"
                body.append(
                    f"{name} = {name} + {product}" if name in started else f"{name} = {product}"
                )
                started.add(name)
        sums = [[name for h in (0, 1) if (name := f"t{h}_{i}") in started] for i in range(count)]
        totals = [" + ".join(names) or "0.0" for names in sums]
        k = self.states
        body += [f"_result[{i}] = {totals[i]}" for i in range(k + 1)]
        body += [f"forward = {totals[k + 1]}", f"sideward = {totals[k + 2]}"]
        body += [f"sine, cosine = sincos_one(_x[{k}])"]
        body += [f"_result[{k + 1}] = forward * cosine - sideward * sine"]
        body += [f"_result[{k + 2}] = forward * sine + sideward * cosine"]
        return "def derivative(_x, _u, _constants, _work, _result):\n    " + "\n    ".join(body)

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
        sizes = {"WORK": 0, "CONSTANTS": len(parameters) + coefficients.size}
        text = self.kernel(len(parameters))
        kernels = load_module("features", kernels_source(text, sizes, "features"))
        constants = np.concatenate([parameters, coefficients.ravel()])
        addresses = np.array([kernels._derivative_machine.address, 0, 0, 0], dtype=np.int64)
        dim = self.states + PLANAR
        return System(
            (constants, addresses),
            self.inputs,
            np.concatenate([reference, np.zeros(PLANAR)]),
            typical,
            np.arange(dim - 2),
            np.zeros(0, dtype=np.int64),
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


def _constants(text: str) -> str:
    return text.replace("p[", "_constants[")
