"""A vehicle's own equations, speeds in the heading frame, on one affine subspace for all times."""

import ast
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vehiclemor.codegen.kernels import Kernels, kernel_sources
from vehiclemor.reduction.interface import Offline
from vehiclemor.reduction.reduced_system import ReducedSystem
from vehiclemor.reduction.settings import ProjectedSettings
from vehiclemor.reduction.vehicle.shape import VehicleShape, turned
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.projection_windows import ProjectionWindows
from vehiclemor.simulation.run_plans import Run
from vehiclemor.simulation.system import System


def projected_vehicle(
    shape: VehicleShape,
    spaces: ProjectionWindows,
    effective_rank: int,
    offline: Offline,
    settings: ProjectedSettings,
) -> ReducedSystem:
    """The vehicle's equations with speeds in the heading frame in subspaces of `one_window`."""
    frame = HeadingFrame(shape, spaces)
    return ReducedSystem(
        shape.model,
        heading_frame(shape),
        spaces,
        effective_rank,
        offline,
        settings.solver,
        settings.tolerance,
        frame.encode,
        frame.lift,
        project=frame.project,
        slopes=frame.slopes,
    )


@dataclass(frozen=True, eq=False)
class HeadingFrame(ShortRepr):
    """The way to speeds in the heading frame and back, and the subspace there."""

    shape: VehicleShape
    spaces: ProjectionWindows

    def encode(self, state: np.ndarray, _: np.ndarray) -> np.ndarray:
        """A full state (2 n,), seen from the heading frame."""
        return self._turned(state[None], -1.0)[0]

    def lift(self, run: Run, _: np.ndarray, __: np.ndarray) -> np.ndarray:
        """Full states (samples, 2 n) of a run."""
        return self._turned(run.path, 1.0)

    def project(self, states: np.ndarray) -> np.ndarray:
        """Full states moved along the directions that the test basis does not see."""
        spaces, there = self.spaces, self._turned(states, -1.0)
        mean, basis, test = spaces.means[0], spaces.trial_basis[0], spaces.test_basis[0]
        return self._turned(mean + (there - mean) @ test.T @ basis, 1.0)

    def slopes(self, state: np.ndarray, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the full state by a state and the inputs."""
        heading, (there,) = self.shape.model.planar[2], self._turned(state[None], 1.0)
        axes = np.full(len(state), state[heading])
        found = turned(np.eye(len(state)), self.shape.pairs, axes).T
        for a, b in self.shape.pairs:
            found[a, heading] -= there[b]
            found[b, heading] += there[a]
        return found, np.zeros((len(state), len(inputs)))

    def _turned(self, states: np.ndarray, sign: float) -> np.ndarray:
        heading = self.shape.model.planar[2]
        return turned(states, self.shape.pairs, sign * states[:, heading])


def one_window(
    mean: np.ndarray, trial_basis: np.ndarray, test_basis: np.ndarray
) -> ProjectionWindows:
    """Subspace for all times: mean (2 n,), basis by rows and projection (r, 2 n)."""
    ranks = np.array([len(trial_basis)], dtype=np.int64)
    edges = np.array([0.0, np.inf])
    return ProjectionWindows("state", edges, mean[None], trial_basis[None], test_basis[None], ranks)


def heading_frame(shape: VehicleShape) -> System:
    """The vehicle's equations with all speeds as components in the heading frame, compiled.

    A linear subspace can't turn with the heading.  So the text of the model's own kernel is taken
    with the heading at zero, and what the turning frame adds stands at its end.  A model whose
    speeds are components in the vehicle is left as it is.
    """
    model = shape.model
    if not shape.pairs:
        return model.system
    own = model.kernels.sources["derivative"].text
    text = heading_frame_text(own, model.planar, shape.pairs)
    kernels = Kernels(kernel_sources(text))
    return replace(model.system, kernels=kernels, rotating=np.zeros(0, dtype=np.int64))


def heading_frame_text(text: str, planar: np.ndarray, pairs: Sequence[tuple[int, int]]) -> str:
    """Text of the straight-line kernel `derivative` with pairs of speeds in the heading frame.

    The speeds of a pair, by their numbers, were components in space; `planar` are the numbers of
    the two positions and of the heading.
    """
    x, y, heading = (int(i) for i in planar)
    (function,) = ast.parse(text).body
    assert isinstance(function, ast.FunctionDef)
    lines, results = [], {}
    for statement in function.body:
        assert isinstance(statement, ast.Assign | ast.Expr)
        source = ast.unparse(statement)
        target, _, value = source.partition(" = ")
        if target.startswith("_result["):
            results[int(target[8:-1])] = value
        else:
            lines.append(f"{target} = 0.0" if value == f"_x[{heading}]" else source)
    turn = results[heading]
    lines.append(f"sine_heading, cosine_heading = sincos_one(_x[{heading}])")
    # At heading zero the rates of the place are the components in the heading frame.
    forward, sideward = results[x], results[y]
    results[x] = f"({forward}) * cosine_heading - ({sideward}) * sine_heading"
    results[y] = f"({forward}) * sine_heading + ({sideward}) * cosine_heading"
    for a, b in pairs:
        results[a] = f"({results[a]}) + ({turn}) * _x[{b}]"
        results[b] = f"({results[b]}) - ({turn}) * _x[{a}]"
    lines += [f"_result[{i}] = {value}" for i, value in sorted(results.items())]
    return f"{ast.unparse(function).splitlines()[0]}\n    " + "\n    ".join(lines) + "\n"
