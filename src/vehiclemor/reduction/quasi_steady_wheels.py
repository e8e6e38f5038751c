"""Quasi-steady wheels: the spins follow the other states without delay (singular perturbation).

P. Kokotovic, H. Khalil, J. O'Reilly, Singular Perturbation Methods in Control (SIAM 1999);
residualisation after Y. Liu, B. Anderson, Int. J. Control 50 (1989), 1379-1405.  About straight
running the spins x_f follow the other states x_s linearly, the equations of x_s stay as they are:

    x_f = x_f0 - A_ff^-1 A_fs (x_s - x_s0)

Spins in straight runs are proportional to the speed, so that these are exact at every speed.

To be expected: explicit steps become longer, since the fastest decay (160 to 520 1/s) is gone, but
hop and stabilised constraints limit them next, the right-hand side costs what it did, and for a
W-method stiffness is free: slower than the best full-order integrator.  In a bend the slaved wheels
brake: what a steered wheel rolls less than the car moves is of second order, and a slip of 1e-3 is
already a force.
"""

from __future__ import annotations

import ast
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vehiclemor.codegen.cache import load_module
from vehiclemor.codegen.link import kernels_source
from vehiclemor.maneuvers import Maneuver
from vehiclemor.reduction.interface import Offline
from vehiclemor.reduction.settings import Setting, Value
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.vehicle_shape import VehicleShape, is_vehicle
from vehiclemor.simulation.checks import check_inputs, cut_short
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.spaces import Spaces
from vehiclemor.simulation.system import System
from vehiclemor.simulation.system_loops import STATE
from vehiclemor.simulation.trajectory import Start, Trajectory

SUMMARY = "spins of the wheels slaved to the other states (singular perturbation)"
REFERENCE = "10.1137/1.9781611971118"
PROJECTED_SETTINGS = {
    "solver": Setting(
        "text",
        "explicit",
        "explicit: Dormand-Prince 5(4); rodas4: Rosenbrock of order 4",
        choices=("explicit", "rodas4"),
    ),
    "tolerance": Setting(
        "number", 1e-4, "largest local error of a state relative to its typical size", minimum=1e-13
    ),
}


@dataclass(frozen=True, eq=False)
class ProjectedVehicle:
    """The vehicle's equations with speeds in the heading frame, on one affine subspace.

    Attributes
    ----------
    shape
        Of the full-order model.
    system
        The equations in the heading frame, see `heading_frame`.
    spaces
        One window for all times, form STATE.
    effective_rank
        Coordinates or modes that stand for the vehicle's.
    """

    shape: VehicleShape
    system: System
    spaces: Spaces
    effective_rank: int
    offline: Offline
    solver: str
    tolerance: float

    def simulate(self, maneuver: Maneuver, start: Start) -> Trajectory:
        """Integrate the projected equations, then turn the speeds back."""
        model = self.shape.model
        check_inputs(maneuver, model.name, model.inputs)
        state = self._turned(model.start(start)[None], -1.0)[0]
        run = self.system.run(maneuver, state, self.spaces, self.solver, self.tolerance)
        states, inputs = self._turned(run.path, 1.0), maneuver.at(run.times)
        trajectory = model.trajectory(
            run.times, inputs, states, run.counts, run.seconds, run.failure
        )
        remarks = (trajectory.remark, cut_short(maneuver))
        return replace(trajectory, remark="; ".join(remark for remark in remarks if remark))

    def best_approximation(self, states: np.ndarray) -> np.ndarray:
        """Projection of states (samples, 2 n), along the equations that are left out."""
        mean, lift, drop = self.spaces.means[0], self.spaces.lifts[0], self.spaces.drops[0]
        there = self._turned(states, -1.0)
        return self._turned(mean + (there - mean) @ drop.T @ lift, 1.0)

    def _turned(self, states: np.ndarray, sign: float) -> np.ndarray:
        """States (samples, 2 n) with speeds turned into (-1) or out of (1) the heading frame."""
        turned = states.copy()
        angle = sign * states[:, self.shape.model.planar[2]]
        cosine, sine = np.cos(angle), np.sin(angle)
        for a, b in self.shape.pairs:
            turned[:, a] = cosine * states[:, a] - sine * states[:, b]
            turned[:, b] = sine * states[:, a] + cosine * states[:, b]
        return turned


def settings(kind: str) -> Mapping[str, Setting]:
    """Settings for models of that kind."""
    return PROJECTED_SETTINGS if kind in ("ode", "dae") else {}


def presets(model: Model) -> Mapping[str, Mapping[str, Value]]:
    """Presets; the same for every model."""
    del model
    return {"recommended": {}}


def accepts(model: Model) -> tuple[bool, str]:
    """Vehicles whose wheels spin."""
    accepted, reason = is_vehicle(model)
    if accepted and isinstance(model, DynamicModel) and not len(spin_angles(model)):
        return False, f"{model.name} has no wheels that spin"
    return accepted, reason


def check(model: Model, settings: Mapping[str, Value]) -> None:
    """All validated settings fit every vehicle."""
    del model, settings


def fit(
    model: Model, training: Sequence[TrainingRun], settings: Mapping[str, Value]
) -> ProjectedVehicle:
    """Slave the spins by the linearisation; no training run is looked at."""
    del training
    assert isinstance(model, DynamicModel)
    began = time.perf_counter()
    shape, n = VehicleShape(model), len(model.coordinates)
    spins = spin_angles(model) + n
    fast, slow = np.isin(shape.kept, spins), ~np.isin(shape.kept, spins)
    a = shape.linearised.a
    slaved = -np.linalg.solve(a[np.ix_(fast, fast)], a[np.ix_(fast, slow)])
    left = np.setdiff1d(np.arange(2 * n), spins)
    lift, drop, mean = np.eye(2 * n)[left], np.eye(2 * n)[left], np.zeros(2 * n)
    rows = np.searchsorted(left, shape.kept[slow])
    lift[np.ix_(rows, shape.kept[fast])] = slaved.T
    # Reduced coordinates are the states themselves: only the spins have a constant part.
    mean[shape.kept[fast]] = shape.reference[fast] - slaved @ shape.reference[slow]
    system = heading_frame(shape)
    evaluations = 2 * (len(shape.kept) + len(model.inputs))
    return ProjectedVehicle(
        shape,
        system,
        one_window(mean, lift, drop),
        # The wheels' coordinates stay; their speeds are no states.
        n,
        Offline(time.perf_counter() - began, evaluations),
        str(settings["solver"]),
        float(settings["tolerance"]),
    )


def spin_angles(model: DynamicModel) -> np.ndarray:
    """Numbers of the coordinates that are spin angles: cyclic, and not of the place."""
    free = np.setdiff1d(np.arange(len(model.coordinates)), model.active)
    return np.setdiff1d(free, model.planar)


def one_window(mean: np.ndarray, lift: np.ndarray, drop: np.ndarray) -> Spaces:
    """Subspace for all times: mean (2 n,), basis by rows and projection (r, 2 n)."""
    ranks = np.array([len(lift)], dtype=np.int64)
    return Spaces(STATE, np.array([0.0, np.inf]), mean[None], lift[None], drop[None], ranks)


def heading_frame(shape: VehicleShape) -> System:
    """The vehicle's equations with all speeds as components in the heading frame, compiled.

    A linear subspace can't turn with the heading.  So the text of the model's own kernel is taken
    with the heading at zero, and what the turning frame adds stands at its end.  A model whose
    speeds are components in the vehicle is left as it is.
    """
    model = shape.model
    if not shape.pairs:
        return model.system
    text = heading_frame_text(model.kernels._derivative_text, model.planar, shape.pairs)
    sizes = {"WORK": model.kernels.WORK, "CONSTANTS": model.kernels.CONSTANTS}
    kernels = load_module(
        "heading_frame", kernels_source(text, sizes, f"{model.name}, speeds in the heading frame")
    )
    addresses = np.array([kernels._derivative_machine.address, 0, 0, 0], dtype=np.int64)
    nothing = np.zeros(0, dtype=np.int64)
    return replace(model.system, machine=(model.constants, addresses), turning=nothing)


def heading_frame_text(text: str, planar: np.ndarray, pairs: Sequence[tuple[int, int]]) -> str:
    """Text of the kernel `derivative` with pairs of speeds in the heading frame.

    Parameters
    ----------
    text
        Straight-line kernel whose speeds in pairs are components in space.
    planar
        Numbers of the two positions and of the heading.
    pairs
        Numbers of the two speeds of each pair.
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
