"""A grey box: the single-track car with roll and saturating tires, fitted to training runs.

What an engineer would take (M. Mitschke, H. Wallentowitz, Dynamik der Kraftfahrzeuge, Springer).
States are lateral speed V, yaw rate r, roll phi, its rate p, speed U; axle forces F_i are per mass:

    alpha_f = kappa s + e_f phi - (V + l_f r) / U,   alpha_r = e_r phi - (V - l_r r) / U
    F_i = D_i sin(S_i atan(c_i alpha_i / (S_i D_i)))
    p' = h (F_f + F_r) - k phi - d p,   V' = -U r + F_f + F_r + g p'
    r' = b_f F_f - b_r F_r,   U' = a V r - w_f alpha_f F_f - w_r alpha_r F_r

Least squares over runs find the 20 constants.  Polynomials give all other states.
"""

from functools import partial
from math import ceil
from typing import Any

import numpy as np
from pydantic import Field
from scipy.optimize import least_squares

from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.learned_model import LearnedModel, SampledSettings, TrainingData
from vehiclemor.reduction.learned_samples import MOST_SAMPLES, Coordinates, Samples
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.vehicle.shape import RANK, no_steered_vehicle

# Constants of a medium car, SI units, by which the fit begins; kappa is that of the model.
TIRES = [*(0.0, 1.3, 60.0, 5.0, 1.3), *(0.0, 1.4, 60.0, 5.0, 1.3)]
BODY = [*(0.8, 100.0, 8.0, 0.0), *(0.7, 0.8), *(1.0, 1.0, 1.0)]
# Change of a constant by which slopes are found, relative to it or to the least size.
STEP, LEAST = 1e-5, 0.1
# The least forward speed in m/s by which slips are divided.
SLOWEST = 1.0


class SingleTrackSettings(SampledSettings):
    """Settings for a vehicle."""

    readout: int = Field(
        3, ge=1, le=4, description="degree of the polynomials that give states and outputs"
    )
    iterations: int = Field(30, ge=0, le=500, description="of the least squares over whole runs")

    def of_samples(self, samples: Samples) -> Coordinates:
        """V, r, roll and its rate, and the deviation of U."""
        shape: Any = samples.shape
        linear = shape.linearised
        roll = linear.output_a[shape.model.outputs.index("roll")]
        turn, forward, lateral = linear.velocity_a
        rows = np.array([lateral, turn, roll, roll @ linear.a, forward])
        return Coordinates(rows, np.zeros((len(rows), samples.runs[0].inputs.shape[1])))


def axle_force(slip: np.ndarray, stiffness: Any, peak: Any, form: Any) -> np.ndarray:
    """Force of an axle per mass of the car in m/s^2."""
    return peak * np.sin(form * np.arctan(stiffness * slip / (form * peak)))


def rates(constants: np.ndarray, speed: float, z: np.ndarray, steer: Any) -> np.ndarray:
    """Rates of the states and of the heading (6, ...) at states (6, ...) and a steering input."""
    kappa, e_f, l_f, *front, e_r, l_r, c_r, d_r, s_r = constants[:11]
    h, k, d, g, b_f, b_r, a, w_f, w_r = constants[11:]
    v, r, roll, p, slower, _ = z
    u = np.maximum(speed + slower, SLOWEST)
    slip_f = kappa * steer + e_f * roll - (v + l_f * r) / u
    slip_r = e_r * roll - (v - l_r * r) / u
    force_f, force_r = axle_force(slip_f, *front), axle_force(slip_r, c_r, d_r, s_r)
    rolling = h * (force_f + force_r) - k * roll - d * p
    sideward = -u * r + force_f + force_r + g * rolling
    forward = a * v * r - w_f * slip_f * force_f - w_r * slip_r * force_r
    return np.stack([sideward, b_f * force_f - b_r * force_r, p, rolling, forward, r])


def driven(rate: Any, start: np.ndarray, steer: np.ndarray, step: float) -> np.ndarray:
    """States and heading (steps + 1, 6, ...) by Runge and Kutta.

    States at the start are (5, ...), the steering at the start, in the middle and at the end of
    each step is (steps, 3, ...).
    """
    path = np.zeros((len(steer) + 1, len(start) + 1, *start.shape[1:]))
    path[0, :-1] = start
    for row, (first, middle, last) in enumerate(steer):
        z = path[row]
        k1 = rate(z, first)
        k2 = rate(z + 0.5 * step * k1, middle)
        k3 = rate(z + 0.5 * step * k2, middle)
        k4 = rate(z + step * k3, last)
        path[row + 1] = z + step / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
    return path


def fitted_constants(data: TrainingData, first: np.ndarray, speed: float, most: int) -> np.ndarray:
    """Constants by least squares of states and heading over whole runs, each by its size."""
    # A step of two samples is short beside all motions of the car.
    step, runs, of_length = 2.0 * data.samples.spacing, [], {}
    every = ceil(sum(map(len, data.paths)) / (2 * MOST_SAMPLES))
    for z, u in zip(data.paths, data.inputs, strict=True):
        heading = np.cumsum(np.append(0.0, 0.25 * step * (z[1:, 1] + z[:-1, 1])))
        history = np.column_stack([z, heading])[: len(u) // 2 * 2 + 1 : 2]
        runs.append(history)
        steer = steering(data, u)[: len(u) // 2 * 2].reshape(-1, 4)[:, [0, 1, 3]]
        of_length.setdefault(len(steer), []).append((steer, history))
    # Runs of one length are driven together.
    groups = [
        tuple(np.stack(part, axis=-1)[..., None] for part in zip(*group, strict=True))
        for group in of_length.values()
    ]
    size = np.sqrt(np.mean(np.concatenate(runs) ** 2, axis=0))[:, None, None]

    def residuals(sets: np.ndarray) -> np.ndarray:
        """Residuals (samples, sets) of sets of constants (constants, sets)."""
        parts, count = [], sets.shape[1]
        for inputs, wanted in groups:
            start = np.repeat(wanted[0, :-1], count, axis=-1)
            path = driven(partial(rates, sets[:, None], speed), start, inputs, step)
            parts.append(((path - wanted)[::every] / size).reshape(-1, count))
        return np.concatenate(parts)

    def slopes(constants: np.ndarray) -> np.ndarray:
        changes = STEP * np.maximum(np.abs(constants), LEAST)
        found = residuals(np.column_stack([constants, constants[:, None] + np.diag(changes)]))
        return (found[:, 1:] - found[:, :1]) / changes

    solve: Any = partial(least_squares, x_scale=np.maximum(np.abs(first), LEAST), max_nfev=most)
    # Steps too long for the tires are tried and given up.
    with np.errstate(all="ignore"):
        return solve(lambda c: residuals(c[:, None])[:, 0], first, slopes).x


def steering(data: TrainingData, inputs: np.ndarray) -> np.ndarray:
    """The first input (steps, ..., 2) at both ends of steps of standardised ones."""
    return data.input_scale[0] * inputs[..., :: len(data.input_scale)]


def fit(model: Any, training: Training, settings: SingleTrackSettings) -> LearnedModel:
    """The single track with the constants of least squares, and what is read from it."""
    data = TrainingData.of(model, training, settings)
    shape: Any = data.samples.shape
    # Of a car that turns as its wheels point.
    linear = shape.linearised
    steady = -np.linalg.lstsq(linear.a, linear.b[:, 0], rcond=RANK)[0]
    kappa = (TIRES[1] + TIRES[6]) * (linear.velocity_a[0] @ steady) / shape.speed
    first = np.array([kappa, *TIRES, *BODY])
    constants = fitted_constants(data, first, shape.speed, settings.iterations + 1)
    rate, step = partial(rates, constants, shape.speed), data.samples.spacing

    def path(start: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        first, last = np.moveaxis(steering(data, inputs), -1, 0)
        steer = np.stack([first, 0.5 * (first + last), last], axis=1)
        return np.moveaxis(driven(rate, start.T, steer, step)[:, :-1], -1, 1)

    return data.model(path)


METHOD = Method(
    name="single_track",
    summary="nonlinear single track with roll and saturating tires, fitted over whole runs",
    settings=dict.fromkeys(("ode", "dae"), SingleTrackSettings),
    refusal=no_steered_vehicle,
    fit=fit,
    packages=("scikit-learn",),
)
