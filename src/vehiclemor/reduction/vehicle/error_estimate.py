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
        How often the full equations are evaluated, twice each.
    """
    shape, propagator = _prepared(model)
    shapes = shape.of(run.states)
    planar = run.states[:, model.planar]
    chosen = _instants(shapes, instants)
    t, u, x = run.time[chosen], run.inputs[chosen], shapes[chosen]
    step = run.time[1] - run.time[0]
    slopes = _slopes(np.hstack([shapes, planar]), step)[chosen]
    heading = planar[chosen, 2]
    rates, _ = shape.motion(x, u)
    residual = rates - slopes[:, :-3]
    linear = shape.linearised
    e = propagator.driven(t, residual)
    moved_rates, moved = shape.motion(x + e, u)
    e = propagator.driven(t, residual + moved_rates - rates - e @ linear.a.T)
    # Motion of the run itself, in its own frame.
    sine, cosine = np.sin(heading), np.cos(heading)
    forward = cosine * slopes[:, -3] + sine * slopes[:, -2]
    sideways = cosine * slopes[:, -2] - sine * slopes[:, -3]
    turn, along, across = (moved - np.column_stack([slopes[:, -1], forward, sideways])).T
    off = _integral(t, turn)
    x_off = _integral(t, along * cosine - across * sine - off * slopes[:, -2])
    y_off = _integral(t, along * sine + across * cosine + off * slopes[:, -3])
    errors = e @ linear.output_a.T + np.column_stack([x_off, y_off, off]) @ _of_planar(model).T
    squares = _integral(t, errors**2)[-1] / (t[-1] - t[0])
    return ErrorEstimate(np.sqrt(squares), np.abs(errors).max(axis=0))


@dataclass(frozen=True)
class Propagator:
    """Solution of e' = A e + r from e = 0 by the modes of A."""

    rates: np.ndarray
    left: np.ndarray
    right: np.ndarray

    def driven(self, t: np.ndarray, forcing: np.ndarray) -> np.ndarray:
        """Solution (samples, n) where the forcing (samples, n) is linear between the times."""
        modal = forcing @ self.left.T
        h = np.diff(t)[:, None]
        z = self.rates * h
        small = np.abs(z) < 1e-5
        safe = np.where(small, 1.0, z)
        growth = np.exp(z)
        first = np.where(small, 1.0 + 0.5 * z, (growth - 1.0) / safe)
        second = np.where(small, 0.5 + z / 6.0, (first - 1.0) / safe)
        pushed = h * ((first - second) * modal[:-1] + second * modal[1:])
        found = np.zeros_like(modal)
        for i in range(len(h)):
            found[i + 1] = growth[i] * found[i] + pushed[i]
        return (found @ self.right.T).real


@lru_cache(maxsize=16)
def _prepared(model: DynamicModel) -> tuple[VehicleShape, Propagator]:
    shape = VehicleShape(model)
    rates, right = np.linalg.eig(shape.linearised.a)
    return shape, Propagator(rates, np.linalg.inv(right), right)


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


def _integral(t: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Integral from the first time on, by the trapezoidal rule."""
    h = np.diff(t).reshape(-1, *(1,) * (values.ndim - 1))
    found = np.zeros_like(values)
    found[1:] = np.cumsum(0.5 * h * (values[1:] + values[:-1]), axis=0)
    return found
