"""Errors of a vehicle's reduced run, estimated from the full equations at a few instants.

What the full equations leave of a run, its residual, drives the error: to first order

    e' = A e + f(x, u) - x'

with A at straight running, where x is the run, and e what it lacks.  Since A holds for small slip
alone, it is solved again with f(x + e, u) - f(x, u) - A e added: two evaluations an instant.  See
T. Grepl, A. Patera, ESAIM Math. Model. Numer. Anal. 39 (2005), 157-181, for such estimates, and for
the exponential formula M. Hochbruck, A. Ostermann, Acta Numer. 19 (2010), 209-286.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.trajectory import Trajectory

INSTANTS = 64
# Part of the instants that is spread evenly; the others stand where the run moves.
EVEN = 1 / 3


@dataclass(frozen=True)
class ErrorEstimate:
    """Estimated errors (outputs,) of a run, root mean square and largest absolute ones."""

    rms: np.ndarray
    largest: np.ndarray


def estimated_errors(
    model: DynamicModel, run: Trajectory, instants: int = INSTANTS
) -> ErrorEstimate:
    """Errors of the outputs of a run of any reduced model of a vehicle.

    Parameters
    ----------
    run
        At equidistant times, five at least.
    instants
        At how many the full equations are evaluated, twice each.
    """
    shape, propagator = _prepared(model)
    shapes, planar = shape.of(run.states), run.states[:, model.planar]
    step = run.time[1] - run.time[0]
    slopes = _slopes(np.hstack([shapes, planar]), step)
    chosen = _instants(shapes, instants)
    x, u = shapes[chosen], run.inputs[chosen]
    places = np.arange(len(shapes))
    before = np.searchsorted(chosen[1:-1], places, "right")
    part = ((places - chosen[before]) / np.diff(chosen)[before])[:, None]

    def everywhere(values: np.ndarray) -> np.ndarray:
        # What the equations leave changes slowly, unlike the run.
        return values[before] + part * (values[before + 1] - values[before])

    rates, _ = shape.motion(x, u)
    residual = rates - slopes[chosen, :-3]
    e = propagator.driven(step, everywhere(residual))
    moved_rates, moved = shape.motion(x + e[chosen], u)
    further = moved_rates - rates - e[chosen] @ shape.linearised.a.T
    nonlinear = moved - e[chosen] @ shape.linearised.motion_a.T
    e = propagator.driven(step, everywhere(residual + further))
    # Motion of the run itself, in its own frame.
    x_rate, y_rate, turn = slopes[:, -3:].T
    sine, cosine = np.sin(planar[:, 2]), np.cos(planar[:, 2])
    own = np.column_stack([turn, cosine * x_rate + sine * y_rate, cosine * y_rate - sine * x_rate])
    lacking = everywhere(nonlinear - own[chosen]) + e @ shape.linearised.motion_a.T
    heading = _integral(step, lacking[:, 0])
    x_off = _integral(step, cosine * lacking[:, 1] - sine * lacking[:, 2] - heading * y_rate)
    y_off = _integral(step, sine * lacking[:, 1] + cosine * lacking[:, 2] + heading * x_rate)
    errors = e @ shape.linearised.output_a.T
    errors += np.column_stack([x_off, y_off, heading]) @ _of_planar(model).T
    return ErrorEstimate(np.sqrt(np.mean(errors**2, axis=0)), np.abs(errors).max(axis=0))


@dataclass(frozen=True)
class Propagator:
    """Solution of e' = A e + r from e = 0, the real part of what modes of A give."""

    rates: np.ndarray
    left: np.ndarray
    right: np.ndarray

    def driven(self, step: float, forcing: np.ndarray) -> np.ndarray:
        """Solution (samples, n) where the forcing (samples, n) is linear between the samples."""
        modal, z = forcing @ self.left.T, self.rates * step
        small = np.abs(z) < 1e-5
        safe = np.where(small, 1.0, z)
        growth = np.exp(z)
        first = np.where(small, 1.0 + 0.5 * z, (growth - 1.0) / safe)
        second = np.where(small, 0.5 + z / 6.0, (first - 1.0) / safe)
        found = np.zeros_like(modal)
        found[1:] = step * ((first - second) * modal[:-1] + second * modal[1:])
        # Each pass doubles the number of steps that have been added up.
        steps = 1
        while steps < len(found):
            found[steps:] += growth**steps * found[:-steps]
            steps *= 2
        return np.real(found @ self.right.T)


@lru_cache(maxsize=16)
def _prepared(model: DynamicModel) -> tuple[VehicleShape, Propagator]:
    shape = VehicleShape(model)
    rates, right = np.linalg.eig(shape.linearised.a)
    # Of two conjugate modes one counts twice.
    upper = np.imag(rates) >= 0.0
    twice = np.where(np.imag(rates) > 0.0, 2.0, 1.0)
    return shape, Propagator(rates[upper], np.linalg.inv(right)[upper], (right * twice)[:, upper])


@lru_cache(maxsize=16)
def _of_planar(model: DynamicModel) -> np.ndarray:
    """Derivatives (outputs, 3) of the outputs by place and heading, straight ahead."""
    at, moved = np.repeat(model.start()[None], 2, axis=0), []
    no_input = np.zeros((2, len(model.inputs)))
    for place in model.planar:
        states = at.copy()
        states[:, place] += (-1e-3, 1e-3)
        below, above = model.outputs_at(states, no_input)
        moved.append((above - below) / 2e-3)
    return np.array(moved).T


def _instants(shapes: np.ndarray, count: int) -> np.ndarray:
    """Numbers of at most so many samples, first and last among them."""
    size = np.abs(shapes - shapes[0]).max(axis=0) + 1e-9
    lengths = np.linalg.norm(np.diff(shapes, axis=0) / size, axis=1)
    even = np.full(len(lengths), 1.0 / len(lengths))
    dense = EVEN * even + (1.0 - EVEN) * lengths / (lengths.sum() or 1.0)
    reached = np.concatenate([[0.0], np.cumsum(dense)])
    chosen = np.searchsorted(reached / reached[-1], np.linspace(0.0, 1.0, count))
    return np.unique(np.clip(chosen, 0, len(shapes) - 1))


def _slopes(path: np.ndarray, step: float) -> np.ndarray:
    """Derivatives (samples, k) in time by differences of the fourth order, lower at the ends."""
    found = np.gradient(path, step, axis=0, edge_order=2)
    found[2:-2] = (path[:-4] - 8.0 * path[1:-3] + 8.0 * path[3:-1] - path[4:]) / (12.0 * step)
    return found


def _integral(step: float, values: np.ndarray) -> np.ndarray:
    """Integral (samples,) from the first sample on, by the trapezoidal rule."""
    return step * (np.cumsum(values) - 0.5 * (values + values[0]))
