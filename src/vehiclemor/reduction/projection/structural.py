"""Structures in a basis: Galerkin projection of their matrices, ports and outputs.

q = V z about the static state: M z'' + (W W' + d K) z' + K z = B f holds with V'MV in the place
of M and so on; the law of the ports stays what it is.  Coordinates are turned so that V'MV is the
identity and V'KV diagonal (K.-J. Bathe, Finite Element Procedures, 2014, chapter 10): what is left
to solve in a step has few entries.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from vehiclemor.exceptions import ConvergenceError, InputError
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.multibody.definition import Structure
from vehiclemor.reduction.interface import OfflineCost
from vehiclemor.reduction.projection.bases import RankTolerance
from vehiclemor.reduction.settings import Settings, StructuralStep, StructuralTolerance
from vehiclemor.reduction.training import Training
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.checks import check_positive
from vehiclemor.simulation.kernel_derivatives import PLACES, By, chosen, parameter_names, partial
from vehiclemor.simulation.structures.model import (
    FIRST_STEP,
    REASONS,
    USUAL,
    Periods,
    StructuralModel,
)
from vehiclemor.simulation.structures.system import StructuralSystem
from vehiclemor.simulation.trajectory import Start, Trajectory
from vehiclemor.sizes import require

# Directions whose mass is below this part of the largest one carry none.
MASSLESS = 1e-12
RESULTS = {"rhs": "rhs", "outputs": "outputs"}


class StructuralSettings(Settings):
    """What all reductions of structures share."""

    tolerance: StructuralTolerance = USUAL
    step_size: StructuralStep = 0.0


def projected(structure: Structure, basis: np.ndarray) -> tuple[Structure, np.ndarray]:
    """A structure in a basis (n, k), and the modes (n, r) that are its coordinates."""
    from scipy.linalg import eigh
    from scipy.sparse import csc_array, eye_array

    def within(matrix: Any, vectors: np.ndarray) -> np.ndarray:
        product = vectors.T @ (matrix @ vectors)
        return 0.5 * (product + product.T)

    sizes, directions = eigh(within(structure.mass, basis))
    heavy = sizes > MASSLESS * sizes[-1]
    vectors = basis @ (directions[:, heavy] / np.sqrt(sizes[heavy]))
    squares, shapes = eigh(within(structure.stiffness, vectors))
    vectors = vectors @ shapes
    r = vectors.shape[1]
    positions, rates, accelerations, forces = structure.outputs
    made = Structure(
        mass=csc_array(eye_array(r)),
        stiffness=csc_array(np.diag(squares)),
        damping_time=structure.damping_time,
        dampers=csc_array((structure.dampers.T @ vectors).T),
        ports=csc_array((structure.ports.T @ vectors).T),
        load=np.zeros(r),
        outputs=(
            csc_array(positions @ vectors),
            csc_array(rates @ vectors),
            csc_array(accelerations @ vectors),
            forces,
        ),
    )
    return made, vectors


class StructuralRuns(ShortRepr):
    """Base of what gives whole runs of a structure: dataclasses with the fields below."""

    if TYPE_CHECKING:
        model: StructuralModel
        tolerance: float
        step_size: float  # In s, in the place of the tolerance; 0: by that.

    @property
    def solved(self) -> tuple[StructuralModel, Periods | None]:
        """The model that is solved, and in which bases."""
        return self.model, None

    def for_model(self, model: StructuralModel) -> Any:
        """The same for a model whose online parameters are others."""
        return replace(self, model=model)  # type: ignore[type-var]

    def simulate(
        self, maneuver: Maneuver, start: Start, outputs: tuple[str, ...] | None = None
    ) -> Trajectory:
        """A run at the maneuver's output times; it may have diverged."""
        self.model.start(start)
        model, periods = self.solved
        return model.run(maneuver, periods, self.tolerance, outputs, step=self.step_size)

    def best_approximation(self, states: np.ndarray) -> np.ndarray | None:
        """Runs have no coordinates to project."""
        del states


@dataclass(frozen=True, eq=False)
class ReducedStructure(StructuralRuns):
    """A structure in one basis, or in another one in each control period."""

    model: StructuralModel  # The full one.
    bases: tuple[np.ndarray, ...]  # Vectors (n, r) of each period.
    edges: tuple[float, ...]  # Times in s at which the next period begins.
    # Cost of making it; error by the step size, as of the full model.
    offline: OfflineCost
    tolerance: float
    step_size: float = 0.0  # In s, in the place of the tolerance; 0: by that.

    def check_sizes(self) -> None:
        """Raise `ValueError` if there is no basis of the model's coordinates for each period."""
        n = self.model.size
        require(len(self.bases) == len(self.edges) + 1 > 0, "edges")
        require(all(basis.ndim == 2 and len(basis) == n for basis in self.bases), "bases")

    @property
    def order(self) -> int:
        """Largest number of reduced coordinates in any period."""
        return max(basis.shape[1] for basis in self.bases)

    @cached_property
    def _modes(self) -> list[tuple[Structure, np.ndarray]]:
        return [projected(self.model.system.structure, basis) for basis in self.bases]

    @cached_property
    def periods(self) -> Periods:
        """Reduced structures, and how coordinates pass from one to the next: nearest by mass."""
        law, mass = self.model.system.law, self.model.system.structure.mass
        systems = tuple(StructuralSystem(structure, law) for structure, _ in self._modes)
        vectors = [modes for _, modes in self._modes]
        pairs = pairwise(vectors)
        passed = tuple(after.T @ (mass @ before) for before, after in pairs)
        return Periods(systems, self.edges, passed)

    @property
    def solved(self) -> tuple[StructuralModel, Periods | None]:
        """The model in its bases."""
        return self.model, self.periods


@dataclass(frozen=True, eq=False)
class SteppedStructure(ReducedStructure):
    """A structure in one basis, which is a function of its states too."""

    @cached_property
    def states(self) -> tuple[str, ...]:
        """Names of the modal coordinates and, after them, of their rates."""
        r = self._first.structure.size
        return tuple(f"{name}{k}" for name in ("mode_", "mode_rate_") for k in range(1, r + 1))

    @property
    def _first(self) -> StructuralSystem:
        return self.periods.systems[0]

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
        check_positive("dt", dt)
        count = max(int(np.ceil(dt / FIRST_STEP - 1e-9)), 1)
        ends = inputs if next_inputs is None else next_inputs
        path = inputs + np.linspace(0.0, 1.0, count + 1)[:, None] * (ends - inputs)
        r = len(state) // 2
        moved = np.array([state[:r], state[r:], self.rates(state, inputs)[r:]])
        # Rounded, so that a loop whose times are rounded factors once.
        h = float(f"{dt / count:.12g}")
        reason = self._first.march(moved, path, h, count, radius=1.0)[3]
        if reason:
            raise ConvergenceError(f"{self.model.name}: {REASONS[reason]}, from t = {time:g} s on")
        return np.concatenate(moved[:2])

    @cached_property
    def _dense(self) -> tuple[np.ndarray, ...]:
        """Squares of the frequencies (r,), ports (r, p), dampers (r, k), outputs as in `Structure`.

        Products with these few numbers take less time than with sparse arrays.
        """
        s: Any = self._first.structure
        outputs = (matrix.toarray() for matrix in s.outputs)
        return s.stiffness.diagonal(), s.ports.toarray(), s.dampers.toarray(), *outputs

    def _forces(self, state: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Port forces and their derivatives (p, 3)."""
        ports, r = self._dense[1], len(state) // 2
        return self._first.law.at(state[:r] @ ports, state[r:] @ ports, inputs)

    def rates(self, state: np.ndarray, inputs: np.ndarray, time: float = 0.0) -> np.ndarray:
        """Time derivative (2 r,) of a state."""
        del time
        squares, ports, dampers, *_ = self._dense
        r, damping_time = len(squares), self._first.structure.damping_time
        elastic = squares * (state[:r] + damping_time * state[r:])
        force = ports @ self._forces(state, inputs)[:, 0]
        return np.concatenate([state[r:], force - elastic - dampers @ (state[r:] @ dampers)])

    def outputs(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Outputs (samples, outputs) of states (samples, 2 r) at inputs (samples, inputs)."""
        found, r = [], states.shape[1] // 2
        cq, cv, ca, cf = self._dense[3:]
        for x, u in zip(states, inputs, strict=True):
            force = self._forces(x, u)[:, 0] + self._first.law.static[1]
            moved = cq @ x[:r] + cv @ x[r:] + ca @ self.rates(x, u)[r:]
            found.append(moved + cf @ force)
        return np.array(found)

    def sensitivities(
        self, state: np.ndarray, inputs: np.ndarray, time: float, by: By, of: str
    ) -> np.ndarray:
        """Analytic derivatives of the rates or of the outputs by state or inputs."""
        del time
        function = chosen(of, RESULTS)
        if parameter_names(by):
            raise InputError(f"the reduced equations of {self.model.name} have no parameters")
        squares, ports, dampers, cq, cv, ca, cf = self._dense
        damping_time, law = self._first.structure.damping_time, self._first.law
        r, p = ports.shape
        if by == "state":
            slopes = self._forces(state, inputs)
            force = np.hstack([slopes[:, 1, None] * ports.T, slopes[:, 2, None] * ports.T])
            elastic = np.diag(squares)
            linear = np.hstack([-elastic, -damping_time * elastic - dampers @ dampers.T])
            rate = np.hstack([np.zeros((r, r)), np.eye(r)])
        else:
            x = np.concatenate([law.static[0] + ports.T @ state[:r], ports.T @ state[r:]])
            arrays = x, inputs, law.constants
            found = partial(law.kernels, "port_forces", arrays, 3 * p, PLACES["inputs"])
            force, linear = found.reshape(p, 3, -1)[:, 0], np.zeros((r, len(inputs)))
            rate = linear
        acceleration = linear + ports @ force
        if function == "rhs":
            return np.vstack([rate, acceleration])
        position = np.hstack([np.eye(r), np.zeros((r, r))]) if by == "state" else linear
        return cq @ position + cv @ rate + ca @ acceleration + cf @ force

    def decode(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Coordinates (samples, n) about the static state of states (samples, 2 r)."""
        del inputs
        (_, vectors), *_ = self._modes
        return states[:, : vectors.shape[1]] @ vectors.T

    def trust(self, states: np.ndarray, inputs: np.ndarray) -> None:
        """Its inputs tell how far it goes in what it knows."""
        del states, inputs


def reduced(
    model: StructuralModel,
    bases: Sequence[np.ndarray],
    settings: StructuralSettings,
    began: float,
    evaluations: int = 0,
    edges: Sequence[float] | np.ndarray = (),
) -> ReducedStructure:
    """The structure in its bases; offline cost from `began` (`time.process_time()`) on."""
    modes = tuple(projected(model.system.structure, basis)[1] for basis in bases)
    cost = OfflineCost(time.process_time() - began, evaluations)
    kind = SteppedStructure if len(modes) == 1 else ReducedStructure
    ends = tuple(map(float, edges))
    return kind(model, modes, ends, cost, settings.tolerance, settings.step_size)


class StructuralPodSettings(StructuralSettings):
    """POD of the motion about the static state, which takes the place of the mean."""

    rank: int = Field(21, ge=1, description="basis vectors in each control period")
    rank_tolerance: RankTolerance = 1e-10


def check_subspace(model: StructuralModel, settings: StructuralPodSettings) -> None:
    """Every rank fits: there are never more vectors than coordinates."""
    del model, settings


def fit_windows(
    model: StructuralModel,
    training: Training,
    edges: np.ndarray,
    settings: StructuralPodSettings,
) -> ReducedStructure:
    """POD bases of all training runs between edges (windows + 1,) in s.

    Snapshots are the coordinates at the output times.
    """
    began, evaluations, parts = time.process_time(), 0, []
    for run in training:
        full: Any = run.model
        recorded = full.run(run.maneuver, recorded=True)
        evaluations += recorded.counts["port_evaluations"]
        parts.append((recorded.times, recorded.coordinates))
    bases = []
    for first, last in pairwise(edges):
        within = [q[(t >= first - 1e-9) & (t <= last + 1e-9)] for t, q in parts]
        vectors, values, _ = np.linalg.svd(np.vstack(within).T, full_matrices=False)
        kept = values[: settings.rank] > settings.rank_tolerance * values[0]
        bases.append(vectors[:, : settings.rank][:, kept])
    return reduced(model, bases, settings, began, evaluations, edges[1:-1])
