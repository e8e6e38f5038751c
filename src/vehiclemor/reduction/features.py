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
from vehiclemor.codegen.weighted_sums import padded
from vehiclemor.simulation.rosenbrock_methods import ROS34PW2
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
    groups
        (numbers of features, columns of C) of each block of C that is not zero; all if empty.
    """

    states: int
    inputs: int
    lines: tuple[tuple[str, str], ...]
    terms: tuple[str, ...]
    groups: tuple[tuple[tuple[int, ...], tuple[int, ...]], ...] = ()

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

    def kernels(self, parameters: int) -> str:
        """Source of the kernels of the reduced vehicle; constants are parameters, then C.

        Parameters
        ----------
        parameters
            Number of parameters.
        """
        k = self.states + PLANAR
        lines = [f"y{i} = _x[{i}]" for i in range(k)] + self._inputs_at(0)
        lines += self._rates("y", "", parameters)
        lines += [f"_result[{i}] = rate_{i}" for i in range(k)]
        return _function("derivative", lines) + "\n" + self._step(parameters)

    def _inputs_at(self, first: int) -> list[str]:
        return [f"u{i} = _u[{first + i}]" for i in range(self.inputs)]

    def _rates(self, state: str, mark: str, parameters: int) -> list[str]:
        """Assignments of `rate{mark}_i` for states named `{state}i` and inputs `u0, u1, ...`."""
        k = self.states
        body = [f"z{i} = {state}{i}" for i in range(k)]
        body += [f"{name} = {_constants(text)}" for name, text in self.lines]
        first = parameters
        sums: dict[int, list[str]] = {}
        for b, (terms, columns) in enumerate(self.blocks):
            names = ", ".join(f"t{b}_{i}" for i in columns)
            factors = ", ".join(_constants(self.terms[j]) for j in terms)
            body.append(f"({names},) = weighted_sums(_constants, {first}, ({factors},))")
            first += len(terms) * padded(len(columns))
            for i in columns:
                sums.setdefault(i, []).append(f"t{b}_{i}")
        totals = [" + ".join(sums.get(i, ["0.0"])) for i in range(k + PLANAR)]
        body += [f"rate{mark}_{i} = {totals[i]}" for i in range(k + 1)]
        body += [f"forward = {totals[k + 1]}", f"sideward = {totals[k + 2]}"]
        body += [f"sine, cosine = sincos_one({state}{k})"]
        body += [f"rate{mark}_{k + 1} = forward * cosine - sideward * sine"]
        body += [f"rate{mark}_{k + 2} = forward * sine + sideward * cosine"]
        return body

    def _step(self, parameters: int) -> str:
        """A whole step of the W-method without a loop, see `stepped_loops`."""
        dim, method = self.states + PLANAR, ROS34PW2
        active = dim - 2
        lines = [f"y{i} = _x[{i}]" for i in range(dim)]
        lines += [f"rate0_{i} = _x[{dim + i}]" for i in range(dim)]
        lines += [f"h = _x[{2 * dim}]", f"scale = {float(method.gamma)!r} * h"]
        for stage in range(4):
            if stage:
                for i in range(dim):
                    parts = [f"{float(method.a[stage, j])!r} * s{j}_{i}" for j in range(stage)]
                    lines.append(f"m{i} = y{i} + {' + '.join(parts)}")
                lines += self._inputs_at((stage - 1) * self.inputs)
                lines += self._rates("m", str(stage), parameters)
            for i in range(dim):
                parts = [
                    f"{float(method.gamma * method.c[stage, j])!r} * s{j}_{i}" for j in range(stage)
                ]
                lines.append(f"b{i} = " + " + ".join([f"scale * rate{stage}_{i}", *parts]))
            names = ", ".join(f"v{i}" for i in range(dim))
            factors = ", ".join(f"b{i}" for i in range(active))
            lines.append(f"({names},) = weighted_sums(_x, {2 * dim + 1}, ({factors},))")
            # Nothing depends on the place: its columns of the inverse are the identity's.
            lines += [f"s{stage}_{i} = v{i}" for i in range(active)]
            lines += [f"s{stage}_{i} = v{i} + b{i}" for i in range(active, dim)]
        for i in range(dim):
            new = " + ".join(f"{float(method.m[j])!r} * s{j}_{i}" for j in range(4))
            error = " + ".join(f"{float(method.e[j])!r} * s{j}_{i}" for j in range(4))
            lines += [f"n{i} = y{i} + {new}", f"_result[{i}] = n{i}"]
            lines.append(f"_result[{dim + i}] = {error}")
        # The third stage was at the end of the step: its inputs serve.
        lines += self._rates("n", "", parameters)
        lines += [f"_result[{2 * dim + i}] = rate_{i}" for i in range(dim)]
        return _function("step", lines)

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
        text = self.kernels(len(parameters))
        kernels = load_module("features", kernels_source(text, sizes, "features"))
        machines = kernels._derivative_machine, kernels._step_machine
        addresses = np.array([machines[0].address, 0, machines[1].address, 0], dtype=np.int64)
        dim = self.states + PLANAR
        return System(
            (constants, addresses),
            self.inputs,
            np.concatenate([reference, np.zeros(PLANAR)]),
            typical,
            np.arange(dim - 2),
            np.zeros(0, dtype=np.int64),
            stepped=True,
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


def _function(name: str, lines: Sequence[str]) -> str:
    body = "\n    ".join(lines)
    return f"def {name}(_x, _u, _constants, _work, _result):\n    {body}\n"


def _constants(text: str) -> str:
    return text.replace("p[", "_constants[")
