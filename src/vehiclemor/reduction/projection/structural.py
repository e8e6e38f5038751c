"""Structures in a basis: Galerkin projection of matrices, ports and outputs; and their modes.

q = V z about the static state: M z'' + (W W' + d K) z' + K z = B f holds with V'MV instead of M
and so on; the law of the ports stays what it is.  Coordinates are turned so that V'MV is the
identity and V'KV diagonal (K.-J. Bathe, Finite Element Procedures, 2014, chapter 10): what is left
to solve in a step has few entries.
"""

import time
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from pydantic import Field, field_validator

from vehiclemor.arguments import check_shapes
from vehiclemor.exceptions import ConvergenceError, InputError
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.multibody.definition import Structure
from vehiclemor.reduction.interface import OfflineCost
from vehiclemor.reduction.projection.bases import RankTolerance
from vehiclemor.reduction.settings import LARGEST_TOLERANCE, SHORTEST, Settings
from vehiclemor.reduction.training import Training
from vehiclemor.registry import choice
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.evaluation import PLACES, By, parameter_names, partial
from vehiclemor.simulation.structures.model import FIRST_STEP, REASONS, USUAL, StructuralModel
from vehiclemor.simulation.structures.system import StructuralSystem
from vehiclemor.simulation.trajectory import Start, Trajectory

# Modes that are looked for at first.
FIRST_MODES = 16
# Directions whose mass is below this part of the largest one carry none.
MASSLESS = 1e-12
RESULTS = ("rhs", "outputs")


class StructuralSettings(Settings):
    """What all reductions of structures share."""

    integration = ("tolerance",)
    tolerance: float = Field(
        USUAL,
        gt=0.0,
        le=LARGEST_TOLERANCE,
        description="largest error of an output by the step size, as part of its range",
    )
    step_size: float = Field(
        0.0,
        ge=0.0,
        le=0.1,
        description="step size in s in the place of the tolerance, from 1e-6 s on; 0: by that",
    )

    @field_validator("step_size")
    @classmethod
    def _long_enough(cls, value: float) -> float:
        """A step that is none, or long enough that a run ends."""
        if 0.0 < value < SHORTEST:
            raise ValueError(f"is {value:g}; it must be 0 or at least {SHORTEST:g}")
        return value


def modes_within(structure: Structure, basis: np.ndarray) -> np.ndarray:
    """Modes (n, r) of a structure in the span of a basis (n, k): of unit mass, slow ones first."""
    from scipy.linalg import eigh

    def within(matrix: Any, vectors: np.ndarray) -> np.ndarray:
        product = vectors.T @ (matrix @ vectors)
        return 0.5 * (product + product.T)

    sizes, directions = eigh(within(structure.mass, basis))
    heavy = sizes > MASSLESS * sizes[-1]
    vectors = basis @ (directions[:, heavy] / np.sqrt(sizes[heavy]))
    return vectors @ eigh(within(structure.stiffness, vectors))[1]


def projected(structure: Structure, modes: np.ndarray) -> Structure:
    """A structure in coordinates of its modes (n, r), as `modes_within` gives them."""
    from scipy.sparse import csc_array, diags_array, eye_array

    positions, rates, accelerations, forces = structure.outputs
    squares = np.einsum("ij,ij->j", modes, structure.stiffness @ modes)
    return Structure(
        mass=csc_array(eye_array(modes.shape[1])),
        stiffness=csc_array(diags_array(squares)),
        damping_time=structure.damping_time,
        dampers=csc_array((structure.dampers.T @ modes).T),
        ports=csc_array((structure.ports.T @ modes).T),
        load=np.zeros(modes.shape[1]),
        outputs=(
            csc_array(positions @ modes),
            csc_array(rates @ modes),
            csc_array(accelerations @ modes),
            forces,
        ),
    )


@dataclass(frozen=True, eq=False)
class ReducedStructure(ShortRepr):
    """A structure in one basis, as a function of its states too."""

    model: StructuralModel  # The full one.
    basis: np.ndarray  # Modes (n, r), see `modes_within`.
    # Cost of making it; error by the step size, as of the full model.
    offline: OfflineCost
    tolerance: float
    step_size: float = 0.0  # In s, instead of the tolerance; 0: by that.

    def check_sizes(self) -> None:
        """Raise `ValueError` if the basis is of other coordinates than the model's."""
        check_shapes("basis", (self.basis, self.model.size, self.order))

    @property
    def order(self) -> int:
        """Number of reduced coordinates."""
        return self.basis.shape[1]

    def for_model(self, model: StructuralModel) -> Any:
        """The same for a model whose online parameters are others, its modes in the same basis."""
        return replace(self, model=model, basis=modes_within(model.system.structure, self.basis))

    @cached_property
    def system(self) -> StructuralSystem:
        """The reduced structure."""
        full = self.model.system
        return StructuralSystem(projected(full.structure, self.basis), full.law)

    @cached_property
    def states(self) -> tuple[str, ...]:
        """Names of the modal coordinates and, after them, of their rates."""
        numbers = range(1, self.order + 1)
        return tuple(f"{name}{k}" for name in ("mode_", "mode_rate_") for k in numbers)

    def simulate(
        self, maneuver: Excitation, start: Start, outputs: tuple[str, ...] | None = None
    ) -> Trajectory:
        """A run at the maneuver's output times; it may have diverged."""
        self.model.start(start)
        return self.model.run(maneuver, self.system, self.tolerance, outputs, step=self.step_size)

    def best_approximation(self, states: np.ndarray) -> np.ndarray | None:
        """Runs have no coordinates to project."""

    def begin(self, start: Start, inputs: np.ndarray) -> np.ndarray:
        """State (2 r,) of the static state."""
        del inputs
        self.model.start(start)
        return np.zeros(len(self.states))

    def step(
        self,
        state: np.ndarray,
        inputs: np.ndarray,
        dt: float,
        time: float = 0.0,
        next_inputs: np.ndarray | None = None,
    ) -> np.ndarray:
        """State (2 r,) after dt s, in equal steps of a millisecond at most, by the midpoint rule.

        A state has no accelerations of the method, with which runs go on.
        """
        count = max(int(np.ceil(dt / FIRST_STEP - 1e-9)), 1)
        ends = inputs if next_inputs is None else next_inputs
        path = inputs + np.linspace(0.0, 1.0, count + 1)[:, None] * (ends - inputs)
        r = len(state) // 2
        moved = np.array([state[:r], state[r:], self.rates(state, inputs)[r:]])
        # Rounded, so that a loop whose times are rounded factors once.
        h = float(f"{dt / count:.12g}")
        reason = self.system.integrate(moved, path, h, count, radius=1.0)[3]
        if reason:
            raise ConvergenceError(f"{self.model.name}: {REASONS[reason]}, from t = {time:g} s on")
        return np.concatenate(moved[:2])

    @cached_property
    def _linear(self) -> tuple[np.ndarray, ...]:
        """Matrices of x' = A x + B f and y = C x + D f, f the forces of the ports; ports (r, p)."""
        s = self.system.structure
        ports, dampers, elastic = s.ports.toarray(), s.dampers.toarray(), s.stiffness.toarray()
        positions, rates, accelerations, forces = (matrix.toarray() for matrix in s.outputs)
        nothing, one = np.zeros_like(elastic), np.eye(len(elastic))
        slowing = s.damping_time * elastic + dampers @ dampers.T
        a, b = np.block([[nothing, one], [-elastic, -slowing]]), np.vstack([0.0 * ports, ports])
        c = np.hstack([positions, rates]) + accelerations @ a[len(elastic) :]
        return a, b, c, forces + accelerations @ ports, ports

    def _forces(self, state: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Port forces and their derivatives (p, 3)."""
        deflections, rates = state.reshape(2, -1) @ self._linear[-1]
        return self.system.law.at(deflections, rates, inputs)

    def rates(self, state: np.ndarray, inputs: np.ndarray, time: float = 0.0) -> np.ndarray:
        """Time derivative (2 r,) of a state."""
        del time
        a, b, *_ = self._linear
        return a @ state + b @ self._forces(state, inputs)[:, 0]

    def outputs(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Outputs (samples, outputs) of states (samples, 2 r) at inputs (samples, inputs)."""
        _, _, c, d, _ = self._linear
        forces = [self._forces(x, u)[:, 0] for x, u in zip(states, inputs, strict=True)]
        static = self.system.structure.outputs[-1] @ self.system.law.static[1]
        return states @ c.T + np.array(forces) @ d.T + static

    def sensitivities(
        self, state: np.ndarray, inputs: np.ndarray, time: float, by: By, of: str
    ) -> np.ndarray:
        """Analytic derivatives of the rates or of the outputs by state or inputs."""
        del time
        choice("of", of, RESULTS)
        if parameter_names(by):
            raise InputError(f"the reduced equations of {self.model.name} have no parameters")
        a, b, c, d, ports = self._linear
        direct, by_force = (a, b) if of == "rhs" else (c, d)
        if by == "state":
            slopes = self._forces(state, inputs)
            return direct + by_force @ np.hstack(
                [slopes[:, [1]] * ports.T, slopes[:, [2]] * ports.T]
            )
        law, (deflections, rates) = self.system.law, state.reshape(2, -1) @ ports
        arrays = np.concatenate([law.static[0] + deflections, rates]), inputs, law.constants
        forces = partial(law.kernels, "port_forces", arrays, 3 * len(rates), PLACES["inputs"])
        return by_force @ forces.reshape(len(rates), 3, -1)[:, 0]

    def decode(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Coordinates (samples, n) about the static state of states (samples, 2 r)."""
        del inputs
        return states[:, : self.order] @ self.basis.T

    def trust(self, states: np.ndarray, inputs: np.ndarray) -> None:
        """Its inputs tell how far it goes in what it knows."""


def reduced(
    model: StructuralModel,
    basis: np.ndarray,
    settings: StructuralSettings,
    began: float,
    evaluations: int = 0,
) -> ReducedStructure:
    """The structure in a basis; offline cost from `began` (`time.process_time()`) on."""
    modes = modes_within(model.system.structure, basis)
    cost = OfflineCost(time.process_time() - began, evaluations)
    return ReducedStructure(model, modes, cost, settings.tolerance, settings.step_size)


def port_rates(model: StructuralModel) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and damping (p,) of the ports at the static state."""
    law = model.system.law
    rest = np.zeros(law.static.shape[1])
    _, stiffness, damping = -law.at(rest, rest, np.zeros(len(model.inputs))).T
    return stiffness, damping


def modes_below(stiffness: Any, mass: Any, solve: Any, shift: float, highest: float) -> np.ndarray:
    """Modes (n, k) up to so many Hz; `solve` is by the stiffness less `shift` times the mass."""
    from scipy.sparse.linalg import LinearOperator, eigsh

    n, count, largest = mass.shape[0], FIRST_MODES, (2.0 * np.pi * highest) ** 2
    operator = LinearOperator((n, n), matvec=solve, dtype=float)  # type: ignore[call-arg]
    begin = solve(mass @ np.cos(np.arange(n, dtype=float)))
    while True:
        count = min(count, n - 2)
        squares, modes = eigsh(stiffness, count, mass, shift, v0=begin, OPinv=operator)
        order = np.argsort(squares)
        squares, modes = squares[order], modes[:, order]
        if squares[-1] > largest or count == n - 2:
            break
        count *= 2
    if squares[0] > largest:
        first = np.sqrt(max(squares[0], 0.0)) / (2.0 * np.pi)
        raise InputError(f"no mode is below {highest:g} Hz: the first has {first:.4g}")
    return modes[:, squares <= largest]


class StructuralPodSettings(StructuralSettings):
    """POD of the motion about the static state, which replaces the mean."""

    rank: int = Field(21, ge=1, description="basis vectors")
    rank_tolerance: RankTolerance = 1e-10


def fit_basis(
    model: StructuralModel, training: Training, settings: StructuralPodSettings
) -> ReducedStructure:
    """POD basis of all training runs: snapshots are the coordinates at the output times."""
    began, evaluations, paths = time.process_time(), 0, []
    for run in training:
        full: Any = run.model
        recorded = full.run(run.maneuver, recorded=True)
        evaluations += recorded.counts["port_evaluations"]
        paths.append(recorded.coordinates)
    vectors, values, _ = np.linalg.svd(np.vstack(paths).T, full_matrices=False)
    large = values[: settings.rank] > settings.rank_tolerance * values[0]
    return reduced(model, vectors[:, : settings.rank][:, large], settings, began, evaluations)
