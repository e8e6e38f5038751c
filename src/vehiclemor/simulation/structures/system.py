"""Structures with the law of their ports, full or reduced, as the time loop takes them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from vehiclemor.codegen.loops import Ready, loops, ready
from vehiclemor.exceptions import GeometryError
from vehiclemor.multibody.definition import Structure
from vehiclemor.simulation.evaluation import address_of
from vehiclemor.simulation.structures import time_loops as compiled
from vehiclemor.simulation.structures.sparse_loops import Blocks, Columns
from vehiclemor.simulation.structures.time_loops import StepMatrices, Weights

STRUCTURAL_LOOPS = (
    "simulation.integrators.dense_solves",
    "simulation.structures.sparse_loops",
    "simulation.structures.time_loops",
)
# Spectral radius of the method at infinity.
DAMPED = 0.8
# Numbers stored for each that is not zero, and columns, in a block of a factor.
WASTE, WIDEST = 1.3, 32


def weights_of(
    h: float, damping_time: float, radius: float
) -> tuple[Weights, tuple[float, float, float]]:
    """Coefficients for a step of h s, and those of M, E and K in the matrix of a step.

    The radius is the spectral one at infinity: 1 damps nothing.
    """
    a_m, a_f = (2.0 * radius - 1.0) / (radius + 1.0), radius / (radius + 1.0)
    beta, gamma = 0.25 * (1.0 - a_m + a_f) ** 2, 0.5 - a_m + a_f
    slope, after = gamma / (beta * h), 1.0 - a_f
    rate_rate, rate_acceleration = 1.0 - gamma / beta, h * (1.0 - 0.5 * gamma / beta)
    of_mass, of_damping = (1.0 - a_m) / (beta * h * h), after * slope
    of_stiffness = after + of_damping * damping_time
    weights = Weights(
        slope=slope,
        rate_rate=rate_rate,
        rate_acceleration=rate_acceleration,
        change=1.0 / (beta * h * h),
        change_rate=1.0 / (beta * h),
        change_acceleration=0.5 / beta - 1.0,
        mass_position=of_mass,
        mass_rate=(1.0 - a_m) / (beta * h),
        mass_acceleration=(1.0 - a_m) * (0.5 / beta - 1.0) - a_m,
        damped_position=of_damping,
        damped_rate=after * rate_rate + a_f,
        damped_acceleration=after * rate_acceleration,
        mass_share=of_mass / of_stiffness,
        damping_share=of_damping / of_stiffness,
        stiffness_share=1.0 / of_stiffness,
        after=after,
        before=a_f,
        earlier=a_f / after,
        damping_time=damping_time,
        lag=a_f - a_m,
    )
    return weights, (of_mass, of_damping, of_stiffness)


@dataclass(frozen=True, eq=False)
class PortLaw:
    """Kernel and constants of the port forces, about a static state.

    Static are deflections and forces (2, p) at that state.
    """

    kernels: Any
    constants: np.ndarray
    static: np.ndarray

    def at(self, deflections: np.ndarray, rates: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Forces (p,) beyond the static ones and derivatives by deflections and rates, (p, 3)."""
        x = np.concatenate([self.static[0] + deflections, rates])
        forces = np.empty((len(deflections), 3))
        self.kernels.call("port_forces", x, np.ascontiguousarray(inputs), self.constants, forces)
        forces[:, 0] -= self.static[1]
        return forces


@dataclass(frozen=True, eq=False)
class StructuralSystem:
    """A structure with the law of its ports, full or reduced, as the time loop takes it.

    Coordinates are those of the motion about the static state.  What is cached of runs are, by
    maneuver and tolerance, steps between output times and a remark.
    """

    structure: Structure
    law: PortLaw
    steps_of_runs: dict[Any, tuple[int, str]] = field(default_factory=dict)

    @cached_property
    def order(self) -> np.ndarray:
        """Order (n,) of the coordinates in which factors of the matrices stay sparse."""
        matrix = self.structure.mass + self.structure.stiffness
        return np.argsort(factored(matrix, "MMD_AT_PLUS_A").perm_c)

    @cached_property
    def step_matrices(self) -> Callable[[float, float], Ready]:
        """Step size in s and spectral radius -> the structure, its matrix factored once."""
        # The estimate of an error needs two step sizes.
        return lru_cache(maxsize=4)(self._prepared)

    def _prepared(self, h: float, radius: float) -> Ready:
        from scipy.sparse import hstack

        s, order = self.structure, self.order
        weights, (of_mass, of_damping, of_stiffness) = weights_of(h, s.damping_time, radius)
        mass, stiffness = (m[order][:, order] for m in (s.mass, s.stiffness))
        factor, p = factored(of_mass * mass + of_stiffness * stiffness), s.ports.shape[1]
        beside = hstack([s.ports, s.dampers]).tocsr()[order]
        response = factor.solve(beside.toarray())
        coupled = beside.T @ response
        damped = coupled[p:, p:]
        damping = of_damping * np.linalg.inv(np.eye(len(damped)) + of_damping * damped)
        by_dampers = coupled[:p, p:] @ damping @ coupled[p:, :p]
        response[:, :p] -= response[:, p:] @ (damping @ coupled[p:, :p])
        compliance = weights.after * (coupled[:p, :p] - by_dampers)
        cq, cv, ca, cf = s.outputs
        matrices = StepMatrices(
            mass=columns_of(mass),
            factor=blocks_of(factor.L),
            ports=columns_of(beside),
            pivots=1.0 / factor.U.diagonal(),
            response=np.ascontiguousarray(response.T),
            compliance=np.ascontiguousarray(0.5 * (compliance + compliance.T)),
            undamped=np.eye(len(damped)) - damping @ damped,
            damping=damping,
            weights=weights,
            law=np.array([address_of(self.law.kernels, "port_forces")], dtype=np.int64),
            constants=self.law.constants,
            static=np.ascontiguousarray(self.law.static),
            positions=columns_of(cq.tocsc()[:, order].T),
            rates=columns_of(cv.tocsc()[:, order].T),
            accelerations=columns_of(ca.tocsc()[:, order].T),
            forces=columns_of(cf.T),
        )
        return ready(matrices)

    def integrate(
        self,
        state: np.ndarray,
        inputs: np.ndarray,
        h: float,
        every: int,
        recorded: bool = False,
        radius: float = DAMPED,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
        """A run in steps of h s from a state (3, n): coordinates, rates and accelerations.

        Inputs (steps + 1, inputs) are those at all steps.  Gives outputs (samples, outputs) and
        coordinates (samples, n), none unless recorded, at every so many steps; counts; and why it
        has ended.  The state becomes the last one.  A spectral radius of 1 at infinity makes the
        method the midpoint rule, which needs no accelerations but those of the equations.
        """
        (_, n), p, samples = state.shape, self.law.static.shape[1], (len(inputs) - 1) // every + 1
        histories = np.full((samples, self.structure.outputs[0].shape[0]), np.nan)
        states = np.full((samples if recorded else 0, n), np.nan)
        scratch = p * (p + 8) + 2 * self.structure.dampers.shape[1] + histories.shape[1]
        buffer = np.empty(compiled.WORK_ROWS * n + compiled.PORT_ROWS * p + scratch)
        counts, order = np.zeros(3, dtype=np.int64), self.order
        moved = np.ascontiguousarray(state[:, order])
        arguments = moved, inputs, every, histories, states, buffer, counts
        loop = loops(STRUCTURAL_LOOPS, ("integrate",))["integrate"]
        reason = loop(self.step_matrices(h, radius), *arguments)
        state[:, order] = moved
        if recorded:
            states[:, order] = states.copy()
        return histories, states, counts, reason


def columns_of(matrix: Any) -> Columns:
    """A sparse matrix by columns, as loops take it."""
    matrix = matrix.tocsc()
    matrix.sort_indices()
    matrix.eliminate_zeros()
    rows, values = matrix.indices.astype(np.int64), np.ascontiguousarray(matrix.data, dtype=float)
    begins = np.ones(len(rows), dtype=bool)
    begins[1:] = np.diff(rows) != 1
    begins[matrix.indptr[:-1][np.diff(matrix.indptr) > 0]] = True
    first = np.flatnonzero(begins)
    pieces = np.searchsorted(first, matrix.indptr).astype(np.int64)
    table = np.column_stack([np.append(rows[first], 0), np.append(first, len(rows))])
    return Columns(pieces, table.ravel().astype(np.int64), values)


def factored(matrix: Any, order: str = "NATURAL") -> Any:
    """Factors L (D L') of a symmetric matrix, without pivoting; `GeometryError` if it has none."""
    from scipy.sparse.linalg import splu

    try:
        symmetric = {"SymmetricMode": True}
        return splu(matrix.tocsc(), permc_spec=order, diag_pivot_thresh=0.0, options=symmetric)
    except RuntimeError as error:
        raise GeometryError(f"the matrices of the structure are singular ({error})") from None


def blocks_of(low: Any) -> Blocks:
    """A lower triangular matrix in blocks of columns, as loops take it.

    Neighbours share a block if that stores few zeros: long columns are quicker than few numbers.
    """
    low = low.tocsc()
    low.sort_indices()
    first, rows, n = low.indptr.tolist(), low.indices.astype(np.int64), low.shape[0]
    columns, below, begin = [0], list[np.ndarray](), 0
    wanted = rows[1 : first[1]]
    for j in range(1, n + 1):
        together = wanted[:0]
        if j < n:
            below_diagonal = rows[first[j] + 1 : first[j + 1]]
            together = np.union1d(wanted[wanted > j], below_diagonal)
            width = j + 1 - begin
            stored = width * (width + 1) // 2 + width * len(together)
            if stored <= WASTE * (first[j + 1] - first[begin]) and width <= WIDEST:
                wanted = together
                continue
            together = below_diagonal
        columns.append(j)
        below.append(wanted)
        begin, wanted = j, together
    parts = []
    for (begin, end), others in zip(pairwise(columns), below, strict=True):
        width = end - begin
        block = np.zeros((width, width + len(others)))
        for k in range(width):
            here = slice(first[begin + k], first[begin + k + 1])
            inside = rows[here] - begin
            far = width + np.searchsorted(others, rows[here])
            block[k, np.where(inside < width, inside, far)] = low.data[here]
        parts.append(block.ravel())
    return Blocks(
        columns=np.array(columns, dtype=np.int64),
        rows=np.concatenate(below),
        row_offsets=_offsets(below),
        values=np.concatenate(parts),
        offsets=_offsets(parts),
    )


def _offsets(parts: Sequence[np.ndarray]) -> np.ndarray:
    """First index of each of some arrays that stand one behind the other, and their length."""
    return np.cumsum([0, *map(len, parts)]).astype(np.int64)
