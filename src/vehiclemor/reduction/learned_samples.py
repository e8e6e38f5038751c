"""Samples of training runs, as general learners take them, and the coordinates they learn in.

Of a vehicle the states are its shape, and heading and position follow by quadratures (see
`vehicle.shape`); of a structure coordinates and rates about the static state; of a mechanism there
are none, since its coordinates follow from the inputs.  States are taken relative to the model's
first start.
"""

import time
from dataclasses import dataclass, replace
from functools import lru_cache
from math import ceil
from typing import Any, NamedTuple

import numpy as np

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.training import Training, TrainingRun
from vehiclemor.reduction.vehicle.linear_modes import slow_modes
from vehiclemor.reduction.vehicle.shape import VehicleShape, no_steered_vehicle
from vehiclemor.simulation.model import Model

# Most samples of a regression, equidistant.
MOST_SAMPLES = 30_000
# Components below this part of the first one are rounding.
ROUNDING = 1e-9
# A first component below it, in SI units, is the error of full-order runs: nothing moves.
RESTING = 1e-6
# Fewer samples are refused.
FEWEST = 10
# Of the slow coordinates of a vehicle: fastest |lambda| (1/s), and heave and pitch.
FASTEST, SYMMETRIC = 45.0, 2


def online_inputs(model: Model, inputs: np.ndarray) -> np.ndarray:
    """Inputs (samples, inputs), and behind them the parameters that change from run to run."""
    values = model.parameters.values()
    online = [float(np.asarray(values[name])) for name in model.definition.online]
    return np.hstack([inputs, np.tile(online, (len(inputs), 1))]) if online else inputs


def shape_of(model: Any) -> VehicleShape | None:
    """Shape of a vehicle that is steered; none of any other model."""
    steered = model.kind in ("ode", "dae") and not no_steered_vehicle(model)
    return VehicleShape(model) if steered else None


def deviations_of(model: Any, shape: VehicleShape | None, states: np.ndarray) -> np.ndarray:
    """Deviations (samples, n) of full states, of a vehicle of its shape, from the first start."""
    return shape.of(states) - shape.reference if shape else states - model.start()


class RunSamples(NamedTuple):
    """Equidistant samples of one training run."""

    inputs: np.ndarray  # (samples, inputs)
    deviations: np.ndarray  # (samples, n)
    # What a run is made of (samples, m): the outputs of a structure, else deviations, and behind
    # them psi', U, V of a vehicle less those of straight running.
    values: np.ndarray


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of all training runs."""

    model: Any  # The full one.
    shape: VehicleShape | None  # Of a vehicle.
    spacing: float  # Time in s between samples.
    runs: tuple[RunSamples, ...]
    # Of the full model's equations; CPU time of the process.
    evaluations: int
    seconds: float


def thinned(histories: list[np.ndarray]) -> np.ndarray:
    """Rows of all runs, at most about `MOST_SAMPLES`, equidistant."""
    every = ceil(sum(map(len, histories)) / MOST_SAMPLES)
    return np.concatenate([history[::every] for history in histories])


def gathered(model: Any, training: Training, steps: int, skipped: float) -> Samples:
    """Samples of training runs, with so many steps between output times.

    The first seconds of each run are skipped, of a shorter one the first half.  `InputError` if the
    runs have output times of another spacing.
    """
    starts = (r.start if isinstance(r.start, str) else tuple(r.start) for r in training)
    runs = tuple((r.model, r.maneuver, start) for r, start in zip(training, starts, strict=True))
    samples, parts = _gathered(model, runs, steps), []
    for run, part in zip(training, samples.runs, strict=True):
        left_out = int(min(skipped / run.maneuver.duration, 0.5) * (len(part.inputs) - 1))
        parts.append(RunSamples(*(history[left_out:] for history in part)))
    return replace(samples, runs=tuple(parts))


# Candidates of one method, and methods one after the other, learn from the same samples.
@lru_cache(maxsize=2)
def _gathered(model: Any, runs: tuple[Any, ...], steps: int) -> Samples:
    began = time.process_time()
    training = [TrainingRun(*run) for run in runs]
    shape, maneuvers = shape_of(model), [run.maneuver for run in training]
    spacings = [maneuver.duration / (maneuver.samples - 1) / steps for maneuver in maneuvers]
    if max(spacings) - min(spacings) > 1e-9 * max(spacings):
        raise InputError(
            f"learned models need training runs with output times of one spacing, not "
            f"{min(spacings):g} and {max(spacings):g} s"
        )
    count = sum((maneuver.samples - 1) * steps for maneuver in maneuvers)
    if count < FEWEST:
        raise InputError(f"learned models need at least {FEWEST} samples of training, not {count}")
    found = [_of_run(shape, run, steps) for run in training]
    parts, evaluations = zip(*found, strict=True)
    seconds = time.process_time() - began
    return Samples(model, shape, spacings[0], parts, sum(evaluations), seconds)


def _of_run(shape: VehicleShape | None, run: TrainingRun, steps: int) -> tuple[RunSamples, int]:
    """Samples of a run, and evaluations of its equations."""
    model: Any = run.model
    maneuver = run.maneuver.subdivided(steps)
    further = 0
    if model.kind == "structural":
        full = model.run(maneuver, recorded=True)
        # Runs record coordinates alone.
        speeds = np.gradient(full.coordinates, full.times, axis=0, edge_order=2)
        deviations, values = np.hstack([full.coordinates, speeds]), full.outputs
    else:
        full = replace(run, maneuver=maneuver).recorded()
        deviations = full.coordinates
        if model.kind != "ae":
            deviations = deviations_of(model, shape, full.states)
        values = deviations
        if shape:
            motion = shape.rates(deviations + shape.reference, full.inputs)[1]
            values = np.hstack([deviations, motion - [0.0, shape.speed, 0.0]])
            further = len(motion)
    samples = RunSamples(online_inputs(model, full.inputs), deviations, values)
    return samples, full.counts[model.evaluations] + further


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Coordinates in which a learner works: linear in deviations and inputs."""

    forward: np.ndarray  # Per deviation (r, n).
    shift: np.ndarray  # What is subtracted, per input (r, inputs).

    def of(self, deviations: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Coordinates (samples, r) of deviations and inputs (samples, inputs)."""
        return deviations @ self.forward.T - inputs @ self.shift.T

    def standardised(self, samples: Samples) -> "Coordinates":
        """The same coordinates with a mean square of 1 along the samples."""
        z = thinned([self.of(run.deviations, run.inputs) for run in samples.runs])
        size = np.sqrt((z**2).mean(axis=0))[:, None]
        size[size == 0.0] = 1.0
        return Coordinates(self.forward / size, self.shift / size)


def principal(samples: Samples, rank: int) -> Coordinates:
    """The first principal components of the samples, at most as many as they span.

    States stand in SI units: scaled by their ranges, ringing of the wheels would come first, and
    learned models of it were unstable.  `InputError` if nothing moves.
    """
    deviations = thinned([run.deviations for run in samples.runs])
    # The triangle has the same components in half the time.
    _, sizes, rows = np.linalg.svd(np.linalg.qr(deviations, mode="r"), full_matrices=False)
    if sizes[0] < RESTING * np.sqrt(len(deviations)):
        raise InputError("nothing moves in the training runs: there is nothing to learn")
    chosen = rows[:rank][sizes[:rank] > ROUNDING * sizes[0]]
    return Coordinates(chosen, np.zeros((len(chosen), samples.runs[0].inputs.shape[1])))


def slow(samples: Samples) -> Coordinates:
    """Coordinates of a vehicle's slow motion, heave, pitch and speed: those of `slow_manifold`."""
    if not (shape := samples.shape):
        raise InputError("coordinates are 'slow'; only vehicles that steer have slow coordinates")
    modes = slow_modes(shape, FASTEST, SYMMETRIC)
    return Coordinates(modes.encoding, modes.input_shift)
