"""The high-fidelity vehicle with frozen inertia, from the exact kernels of a ready model."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.codegen.derivation import Derivation
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.multibody.high_fidelity import frozen_quantities as frozen
from vehiclemor.multibody.high_fidelity.quantities import PLACES
from vehiclemor.reduction.high_fidelity.independent_kernels import free_lengths, independent_kernels
from vehiclemor.reduction.trust import trust_of
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.build import compiled
from vehiclemor.simulation.constants import hoisted_constants
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.run_plans import Run
from vehiclemor.simulation.trajectory import Trust

if TYPE_CHECKING:
    from vehiclemor.symbolic.program import Program

N = frozen.N
# Ranges over which polynomials are fitted: angle of an arm in rad, displacement of the rack in m.
# The lane changes reach 0.14 rad and 0.009 m.
ARM_RANGE, RACK_RANGE = 0.15, 0.012
# Up to these the errors stay below 0.06 m in the place and 2.5e-4 rad (RMS) in the heading, beyond
# they grow tenfold: 300 runs at 8 to 30 m/s with up to three times the steering of a lane change,
# 1,200 of other cars at 8 to 34 m/s.  Of these, where arm and rack are in their range, runs beyond
# the errors have lateral speeds (m/s) from 0.99 on, runs at 18 to 22 m/s up to 0.6.
KNOWN_ARM, KNOWN_RACK, KNOWN_SLIDE = 0.175, 0.010, 0.75
# Chebyshev points in each direction.
POINTS = 13
# Step (rad) of the difference by which a mass depends on the angle of an arm.
STEP = 1e-3
FRONT_ARM, REAR_ARM = 6, 8
ARMS = slice(FRONT_ARM, REAR_ARM + 2)
SPINS = slice(10, 14)
SIDEWAYS = 1


@dataclass(frozen=True, eq=False)
class ExactVehicle(ShortRepr):
    """Kernels of the vehicle in independent coordinates, with the constants of a ready model."""

    kernels: Kernels
    constants: np.ndarray

    def call(self, function: str, x: np.ndarray, u: Any, shape: tuple[int, ...]) -> np.ndarray:
        """Result of a kernel at the state x (28,) and inputs u (3,)."""
        result = np.empty(shape)
        inputs = np.array(u, dtype=float)
        state = np.array(x, dtype=float)
        self.kernels.call(function, state, inputs, self.constants, result)
        return result

    def suspension(self, place: int, angle: float, rack: float) -> np.ndarray:
        """Rows (3, 4) of the function `suspension` for an angle of one left arm."""
        x = np.zeros(2 * N)
        x[place] = angle
        return self.call("suspension", x, (rack, 0.0, 0.0), (3, 4))

    def mass(self, place: int = 0, angle: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Mass matrix (10, 10) without the wheels' spins; moments of inertia of these (4,)."""
        x = np.zeros(2 * N)
        x[place] = angle
        whole = self.call("mass", x, np.zeros(3), (N, N))
        spins = np.diag(whole)[SPINS]
        coupling = whole[:10, SPINS]
        return whole[:10, :10] - (coupling / spins) @ coupling.T, spins

    def encode(self, state: np.ndarray, u: np.ndarray) -> np.ndarray:
        """State (28,) of the frozen vehicle from one (52,) of the full one and inputs (3,)."""
        x = np.concatenate([state[list(PLACES)], state[26:][list(PLACES)]])
        return np.concatenate([x[:N], self.call("quasi_speeds", x, u, (N,))])


def exact_vehicle(model: DynamicModel) -> ExactVehicle:
    """The exact kernels of a ready model."""
    made, constants = independent_kernels(model)
    return ExactVehicle(made.kernels, constants)


def frozen_kernels(model: DynamicModel) -> tuple[Derivation, np.ndarray]:
    """Kernels of the vehicle with frozen inertia, and their constants of a ready model."""
    made, _ = compiled("high_fidelity_frozen_inertia", _derive)
    values = frozen_constants(model)
    fixed = [values[name] for name in frozen.CONSTANTS]
    return made, hoisted_constants(made, model.parameters.flat(), [*free_lengths(model), *fixed])


def _derive() -> "Program":
    from vehiclemor.multibody.high_fidelity import frozen_inertia

    return frozen_inertia.derive()


def frozen_constants(model: DynamicModel) -> dict[str, float]:
    """Constants of the frozen vehicle by name, see `frozen_quantities.CONSTANTS`."""
    exact = exact_vehicle(model)
    mass, _ = exact.mass()
    design = np.zeros(2 * N)
    values = _suspension_constants(exact)
    for name, place, moved in (("turn_by_arm", N + FRONT_ARM, 0.0), ("turn_by_rack", 0, 1.0)):
        x = design.copy()
        x[place] = 1.0 - moved
        values[name] = exact.call("quasi_speeds", x, (0.0, moved, 0.0), (N,))[SPINS][0]
    values |= {"total_mass": mass[0, 0], "offset_x": -mass[4, 2], "offset_z": mass[4, 0]}
    values |= {f"tensor_{axis}{axis}": mass[3 + i, 3 + i] for i, axis in enumerate("xyz")}
    values["tensor_xz"] = mass[3, 5]
    for end, place in zip(frozen.ENDS, (FRONT_ARM, REAR_ARM), strict=True):
        second = _difference(lambda angle, place=place: exact.mass(place, angle)[0][:3, place])
        for i, axis in enumerate("xyz"):
            values[f"{end}_first_{axis}"] = mass[i, place]
            values[f"{end}_second_{axis}"] = second[i]
    for family, places, sign in zip(frozen.FAMILIES, frozen.FAMILY_CHASSIS, (1, -1), strict=True):
        shapes = np.zeros((5, 10))
        shapes[range(3), places] = 1.0
        # Angles of a right front arm are negative for the same travel.
        shapes[3, FRONT_ARM : FRONT_ARM + 2] = 1.0, -sign
        shapes[4, REAR_ARM : REAR_ARM + 2] = 1.0, sign
        inverse = np.linalg.inv(shapes @ mass @ shapes.T)
        values |= {f"{family}_{i}{j}": inverse[i, j] for i in range(5) for j in range(i + 1)}
    return {name: float(values[name]) for name in frozen.CONSTANTS}


def judge(run: Run, inputs: np.ndarray) -> Trust:
    """How far a run goes in the ranges of the polynomials, and sideways."""
    known = np.array([*(KNOWN_ARM,) * 4, KNOWN_RACK, KNOWN_SLIDE])
    used = np.column_stack([run.path[:, ARMS], inputs[:, 0], run.path[:, N + SIDEWAYS]]) / known
    names = (*("angle of an arm",) * 4, "displacement of the rack", "lateral speed")
    return trust_of(run.times, used, names)


def _suspension_constants(exact: ExactVehicle) -> dict[str, float]:
    """Coefficients of the polynomials; with their slopes by the arms' angles exact at design."""
    nodes = np.cos(np.pi * (np.arange(POINTS) + 0.5) / POINTS)
    angles = ARM_RANGE * nodes

    def front(angle: float, rack: float) -> np.ndarray:
        # Wheel centre, x and z of the axle, spring.
        rows = exact.suspension(FRONT_ARM, angle, rack)
        return np.concatenate([rows[0, :3], rows[2, [0, 2]], rows[0, 3:]])

    def rear(angle: float) -> np.ndarray:
        return exact.suspension(REAR_ARM, angle, 0.0)[1]

    grid = [(a, s) for a in angles for s in RACK_RANGE * nodes]
    basis = np.array([[a**i * s**j for i, j in frozen.MONOMIALS] for a, s in grid])
    rows = np.array([front(a, s)[:5] for a, s in grid])
    at_design, slope = front(0.0, 0.0), _difference(lambda a: front(a, 0.0))
    known = {(0, 0): at_design[:5], (1, 0): slope[:5]}
    found = _fitted(basis, rows, {frozen.MONOMIALS.index(k): row for k, row in known.items()})
    values = {
        f"{name}_{i}_{j}": found[row, column]
        for column, name in enumerate(frozen.FRONT_MAPS)
        for row, (i, j) in enumerate(frozen.MONOMIALS)
    }
    behind, behind_slope = rear(0.0), _difference(rear)
    values["rear_centre_y"] = behind[1]
    rows = np.array([rear(a) for a in angles])
    springs = np.array([front(a, 0.0)[5] for a in angles])
    curves = {
        "rear_centre_x": (rows[:, 0], behind[0], behind_slope[0], frozen.DEGREE),
        "rear_centre_z": (rows[:, 2], behind[2], behind_slope[2], frozen.DEGREE),
        "front_spring": (springs, at_design[5], slope[5], frozen.SPRING_DEGREE),
        "rear_spring": (rows[:, 3], behind[3], behind_slope[3], frozen.SPRING_DEGREE),
    }
    for name, (curve, first, second, degree) in curves.items():
        powers = angles[:, None] ** np.arange(degree + 1)
        found = _fitted(powers, curve[:, None], {0: np.array([first]), 1: np.array([second])})
        values |= {f"{name}_{i}": value for i, value in enumerate(found[:, 0])}
    return values


def _difference(function: Callable[[float], np.ndarray]) -> np.ndarray:
    """Derivative at zero, of an error of the fourth order in `STEP`."""
    far, near = (function(k * STEP) - function(-k * STEP) for k in (2, 1))
    return (8.0 * near - far) / (12.0 * STEP)


def _fitted(basis: np.ndarray, values: np.ndarray, known: Mapping[int, np.ndarray]) -> np.ndarray:
    """Coefficients (columns of the basis, columns of values) by least squares, some known."""
    scale = np.abs(basis).max(axis=0)
    found = np.zeros((basis.shape[1], values.shape[1]))
    for row, value in known.items():
        found[row] = value
    free = [row for row in range(basis.shape[1]) if row not in known]
    scaled = basis[:, free] / scale[free]
    solved = np.linalg.lstsq(scaled, values - basis @ found, rcond=None)[0]
    found[free] = solved / scale[free][:, None]
    return found
