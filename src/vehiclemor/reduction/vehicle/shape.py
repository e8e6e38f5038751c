"""Shape of a vehicle: its state without where it is and where it heads.

The equations of motion of a vehicle on a plane road don't depend on its position, and turn with its
heading.  So a reduced model needs the shape alone (speeds as components in the heading frame); the
heading and the position follow by quadratures:

    shape' = f(shape, u);  psi' = r,  X' = U cos(psi) - V sin(psi),  Y' = U sin(psi) + V cos(psi)

with r, U, V functions of shape and u.  Angles of the wheels' spin are left out for the same reason.
Inputs are the steering with its derivatives, and torques and friction of the wheels.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vehiclemor.multibody.quantities import OPTIONAL_INPUTS, WHEELS
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.integrators.step_kernels import partners
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Trajectory

STEP = 6e-6
# States that move less than this part of their range count as not moved; how often steering is
# followed through the equations; relative singular values that are rounding.
STILL, POWERS, RANK = 1e-6, 4, 1e-10
# Outputs in which the slow manifold has its nonlinear terms.
SLIP_OUTPUTS = ("roll", *(f"slip_angle_{wheel}" for wheel in WHEELS))
DRIVE, BRAKE, FRICTION = "drive_torque", "brake_torque", "friction"
# Steps of inputs in differences: of torques in N m, of all others.
TORQUE_STEP, INPUT_STEP = 1.0, 1e-5
OPTIONAL = {quantity.name for quantity in OPTIONAL_INPUTS}
KNOWN = {f"{kind}_{wheel}" for kind in (DRIVE, BRAKE, FRICTION) for wheel in WHEELS}


def no_vehicle(model: Model) -> str:
    """Why a model is no vehicle that is steered, driven and braked; else empty."""
    if len(getattr(model, "planar", ())) != 3:
        return f"{model.name} is no vehicle with a place and a heading on the road"
    missing = [name for name in SLIP_OUTPUTS if name not in model.outputs]
    if missing:
        return f"{model.name} has no output {', '.join(missing)}"
    steering, *others = [name for name in model.inputs if name not in KNOWN] or [""]
    if driven := [name for name in others if name in OPTIONAL]:
        return f"it reduces vehicles on an even road; this one is driven by {driven[0]} too"
    if not steering or others != [f"{steering}_dot", f"{steering}_ddot"][: len(others)]:
        return f"the inputs of {model.name} are not a steering and its derivatives"
    return ""


def no_steered_vehicle(model: Model) -> str:
    """Why a model is no vehicle whose inputs are the steering and its derivatives; else empty."""
    if driven := model.definition.choice.driven if hasattr(model, "definition") else ():
        return f"it reduces vehicles that steer alone; this one is driven by {driven[0]} too"
    return no_vehicle(model)


@dataclass(frozen=True)
class VehicleInputs:
    """Names of a vehicle's inputs; steering and its derivatives come first."""

    names: tuple[str, ...]

    @property
    def steering(self) -> int:
        """How many inputs are the steering and its derivatives."""
        return sum(name not in OPTIONAL for name in self.names)

    @property
    def torques(self) -> bool:
        """Whether drive or brakes are inputs."""
        return any(name.startswith((DRIVE, BRAKE)) for name in self.names)

    @property
    def steps(self) -> np.ndarray:
        """Steps (inputs,) of differences."""
        torque = [name.startswith((DRIVE, BRAKE)) for name in self.names]
        return np.where(torque, TORQUE_STEP, INPUT_STEP)

    def left_torque(self, left: str, right: str) -> np.ndarray:
        """Inputs (inputs,) by which the left wheel has 1 N m of drive more, and no more in sum."""
        change = np.zeros(len(self.names))
        for wheel, half in ((left, 0.5), (right, -0.5)):
            drive, brake = self.of_wheel(DRIVE, wheel), self.of_wheel(BRAKE, wheel)
            if drive is not None:
                change[drive] = half
            elif brake is not None:
                change[brake] = -half
        return change

    def of_wheel(self, kind: str, wheel: str) -> int | None:
        """Index of an input at a wheel, if it is one."""
        name = f"{kind}_{wheel}"
        return self.names.index(name) if name in self.names else None


@dataclass(frozen=True)
class Linearisation:
    """Derivatives of the shape's rate, of velocity (psi', U, V) and of outputs at straight running.

    By the shape (rows, n), and of the first two by the inputs (rows, inputs).
    """

    a: np.ndarray
    b: np.ndarray
    velocity_a: np.ndarray
    velocity_b: np.ndarray
    output_a: np.ndarray


@dataclass(frozen=True, eq=False)
class VehicleShape:
    """Shape coordinates of one vehicle model."""

    model: DynamicModel

    def check_sizes(self) -> None:
        """There are none."""

    @cached_property
    def indices(self) -> np.ndarray:
        """Indices of the shape in the states."""
        left_out = set(self.model.planar)
        return np.array([i for i in self.model.active if i not in left_out])

    @cached_property
    def inputs(self) -> VehicleInputs:
        """What the inputs do."""
        return VehicleInputs(self.model.inputs)

    @cached_property
    def pairs(self) -> list[tuple[int, int]]:
        """Indices of pairs of states, other than the position, that are components in space."""
        turning, planar = self.model.rotating, set(self.model.planar)
        pairs = [(int(a), int(b)) for a, b in zip(turning[1::2], turning[2::2], strict=True)]
        return [pair for pair in pairs if not set(pair) <= planar]

    @cached_property
    def reference(self) -> np.ndarray:
        """Shape (n,) of straight running at the model's speed."""
        return self.of(self.model.start()[None])[0]

    @property
    def speed(self) -> float:
        """Speed of straight running in m/s."""
        return float(self.rates(self.reference[None], self.model.inputs_at_rest[None])[1][0, 1])

    def of(self, states: np.ndarray) -> np.ndarray:
        """Shapes (samples, n) of states (samples, 2 n)."""
        return turned(states, self.pairs, -states[:, self.model.planar[2]])[:, self.indices]

    def states(self, shapes: np.ndarray, planar: np.ndarray) -> np.ndarray:
        """States of shapes (samples, n) at `planar` (samples, 3); wheels don't turn."""
        states = np.zeros((len(shapes), len(self.model.definition.states)))
        states[:, self.indices] = shapes
        states[:, self.model.planar] = planar
        return turned(states, self.pairs, planar[:, 2])

    def rates(self, shapes: np.ndarray, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rates of the shapes (samples, n), and psi', U, V (samples, 3), by the full equations."""
        states = self.states(shapes, np.zeros((len(shapes), 3)))
        rates = self.model.rhs_at(states, inputs)
        x, y, heading = self.model.planar
        turn = rates[:, heading]
        for a, b in self.pairs:
            # Components in a frame that turns.
            rates[:, a] += turn * states[:, b]
            rates[:, b] -= turn * states[:, a]
        return rates[:, self.indices], rates[:, [heading, x, y]]

    @cached_property
    def linearised(self) -> Linearisation:
        """Derivatives at straight running."""
        return self.linearised_at(np.zeros(len(self.indices)))

    def linearised_at(self, deviation: np.ndarray) -> Linearisation:
        """Derivatives at a deviation (n,) from straight running, by central differences."""
        point = self.reference + deviation
        n, inputs = len(self.indices), len(self.model.inputs)
        steps = STEP * np.maximum(1.0, np.abs(point))
        shapes = np.tile(point, (2 * (n + inputs), 1))
        values = np.tile(self.model.inputs_at_rest, (len(shapes), 1))
        for side, sign in enumerate((1.0, -1.0)):
            shapes[side : 2 * n : 2] += sign * np.diag(steps)
            values[2 * n + side :: 2] += sign * np.diag(self.inputs.steps)
        widths = 2.0 * np.concatenate([steps, self.inputs.steps])
        outputs = self.model.outputs_at(
            self.states(shapes, np.zeros((len(shapes), 3))), np.ascontiguousarray(values)
        )
        images = *self.rates(shapes, values), outputs
        rate, speed, output = ((image[0::2] - image[1::2]).T / widths for image in images)
        return Linearisation(rate[:, :n], rate[:, n:], speed[:, :n], speed[:, n:], output[:, :n])

    @cached_property
    def mirror(self) -> np.ndarray:
        """Signed permutation (n, n): the deviation of the shape in the vehicle's mirror image.

        Names tell the partners.  Signs follow from what steering moves, which changes its sign in
        the mirror: of a state without a partner, and against its partner's of any other.
        """
        # Not its modes: a symmetric one of the same frequency would be mixed with a lateral one.
        linear, steering = self.linearised, self.linearised.b[:, : self.inputs.steering]
        parts = [np.linalg.lstsq(linear.a, steering[:, :1], rcond=RANK)[0], steering]
        for _ in range(POWERS):
            parts.append(linear.a @ parts[-1])
        moved = np.hstack(parts)
        moved /= np.abs(moved).max(axis=0)
        partner = partners(tuple(self.model.definition.states[i] for i in self.indices))
        matrix = np.zeros((len(partner), len(partner)))
        for i, j in enumerate(partner):
            still = i == j and np.abs(moved[i]).max() <= STILL
            turned_alike = i != j and moved[i] @ moved[j] <= 0.0
            matrix[i, j] = 1.0 if still or turned_alike else -1.0
        return matrix


def turned(states: np.ndarray, pairs: list[tuple[int, int]], angles: np.ndarray) -> np.ndarray:
    """States with their pairs of components turned by angles (samples,)."""
    turned = states.copy()
    cosine, sine = np.cos(angles), np.sin(angles)
    for a, b in pairs:
        turned[:, a] = cosine * states[:, a] - sine * states[:, b]
        turned[:, b] = sine * states[:, a] + cosine * states[:, b]
    return turned


class ShapeSamples(NamedTuple):
    """Samples of all runs: deviations of the shape from straight running, its rates; psi', U, V."""

    inputs: np.ndarray
    outputs: np.ndarray
    deviations: np.ndarray
    rates: np.ndarray
    planar_velocity: np.ndarray


def shape_samples(shape: VehicleShape, runs: Sequence[Trajectory]) -> ShapeSamples:
    """Samples of training runs; one evaluation of the full equations for each."""
    inputs = np.concatenate([run.inputs for run in runs])
    outputs = np.concatenate([run.outputs for run in runs])
    shapes = np.concatenate([shape.of(run.states) for run in runs])
    return ShapeSamples(inputs, outputs, shapes - shape.reference, *shape.rates(shapes, inputs))
