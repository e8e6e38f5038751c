"""Samples of training runs, as general learners take them: states, rates, inputs, what follows.

Of a vehicle the states are its shape, and heading and position follow by quadratures (see
`vehicle.shape`); of a structure coordinates and rates about the static state; of a mechanism there
are none, since its coordinates follow from the inputs.  States are taken relative to the model's
first start, and turned into their principal components, each standardised.
"""

import time
from dataclasses import dataclass, replace
from functools import lru_cache
from math import ceil
from typing import Any

import numpy as np

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.training import Training, TrainingRun
from vehiclemor.reduction.vehicle.shape import VehicleShape, no_steered_vehicle
from vehiclemor.simulation.model import Model

# Most samples of a fit, equidistant.
MOST_SAMPLES = 30_000
# Components below this part of the first one are rounding.
ROUNDING = 1e-9
# A first component below it, in SI units, is the error of full-order runs: nothing moves.
RESTING = 1e-6
# Rates of states in SI units below which the start is at rest.
STILL = 1e-6
# Fewer samples are refused.
FEWEST = 10


def online_inputs(model: Model, inputs: np.ndarray) -> np.ndarray:
    """Inputs (samples, inputs), and behind them the parameters that change from run to run."""
    values = model.parameters.values()
    online = [float(np.asarray(values[name])) for name in model.definition.online]
    return np.hstack([inputs, np.tile(online, (len(inputs), 1))]) if online else inputs


@dataclass(frozen=True, eq=False)
class States:
    """States of a model as deviations from its first start."""

    model: Any  # The full model.
    shape: VehicleShape | None  # Of a vehicle.

    @classmethod
    def of_model(cls, model: Any) -> "States":
        """The states of a model of any kind."""
        steered = model.kind in ("ode", "dae") and not no_steered_vehicle(model)
        return cls(model, VehicleShape(model) if steered else None)

    def check_sizes(self) -> None:
        """There are none."""

    @property
    def planar(self) -> int:
        """Number of quadratures: heading and position of a vehicle."""
        return 3 if self.shape else 0

    def of(self, states: np.ndarray) -> np.ndarray:
        """Deviations (samples, n) of full states from the first start."""
        if self.shape:
            return self.shape.of(states) - self.shape.reference
        return states - self.model.start()

    def back(self, deviations: np.ndarray, planar: np.ndarray) -> np.ndarray:
        """Full states of deviations, and of heading and position (samples, 3) of a vehicle."""
        if self.shape:
            return self.shape.states(deviations + self.shape.reference, planar[:, [1, 2, 0]])
        return deviations + self.model.start()

    def planar_of(self, state: np.ndarray) -> np.ndarray:
        """Heading and position of a state, nothing if the model has neither."""
        if not self.shape:
            return np.zeros(0)
        x, y, heading = self.model.planar
        return state[[heading, x, y]]


@dataclass(frozen=True, eq=False)
class Samples:
    """Equidistant samples of training runs, each with the one that follows it."""

    states: States  # Meaning of the columns of `deviations`.
    spacing: float  # Time in s to the sample that follows.
    # (samples, inputs).
    inputs: np.ndarray
    next_inputs: np.ndarray
    # (samples, n).
    deviations: np.ndarray
    next_deviations: np.ndarray
    rates: np.ndarray
    # psi', U, V (samples, 3) of a vehicle, less those of straight running; else (samples, 0).
    motion: np.ndarray
    outputs: np.ndarray  # (samples, outputs) of a structure, else (samples, 0).
    # Of the full model's equations; CPU time of the process.
    evaluations: int
    seconds: float

    @property
    def constant(self) -> bool:
        """Whether learnt equations need a constant: the first start is not at rest."""
        model = self.states.model
        if self.states.shape or model.kind == "structural":
            return False
        if model.kind == "ae":
            return True
        rest = model.rhs_at(model.start()[None], np.zeros((1, len(model.inputs))))[0]
        return bool(np.abs(rest).max() > STILL)


def gathered(model: Any, training: Training, steps: int, skipped: float) -> Samples:
    """Samples of training runs, with so many steps between output times.

    The first seconds of each run are skipped, of a shorter one the first half.  `InputError` if the
    runs have output times of another spacing.
    """
    starts = (r.start if isinstance(r.start, str) else tuple(r.start) for r in training)
    runs = tuple((r.model, r.maneuver, start) for r, start in zip(training, starts, strict=True))
    return _gathered(model, runs, steps, skipped)


# Candidates of one method, and methods one after the other, learn from the same samples.
@lru_cache(maxsize=2)
def _gathered(model: Any, runs: tuple[Any, ...], steps: int, skipped: float) -> Samples:
    began = time.process_time()
    training = [TrainingRun(*run) for run in runs]
    states, maneuvers = States.of_model(model), [run.maneuver for run in training]
    spacings = [maneuver.duration / (maneuver.samples - 1) / steps for maneuver in maneuvers]
    if max(spacings) - min(spacings) > 1e-9 * max(spacings):
        raise InputError(
            f"learned models need training runs with output times of one spacing, not "
            f"{min(spacings):g} and {max(spacings):g} s"
        )
    count = sum((maneuver.samples - 1) * steps for maneuver in maneuvers)
    if count < FEWEST:
        raise InputError(f"learned models need at least {FEWEST} samples of training, not {count}")
    every = ceil(count / MOST_SAMPLES)
    parts = [_of_run(states, run, steps, every, skipped) for run in training]
    *histories, evaluations = zip(*parts, strict=True)
    arrays = [np.concatenate(history) for history in histories]
    seconds = time.process_time() - began
    return Samples(states, spacings[0], *arrays, evaluations=sum(evaluations), seconds=seconds)


def _of_run(
    states: States, run: TrainingRun, steps: int, every: int, skipped: float
) -> tuple[Any, ...]:
    """Histories of every so many samples of a run, as in `Samples`; evaluations of its equations.

    Each sample is followed by another one of the same run, so that the last one is left out.
    """
    model: Any = run.model
    maneuver = run.maneuver.subdivided(steps)
    last = maneuver.samples - 1
    first = int(min(skipped / maneuver.duration, 0.5) * last)
    rows = np.arange(first, last, every)
    if model.kind == "structural":
        full = model.run(maneuver, recorded=True)
        # Runs record coordinates alone.
        speeds = np.gradient(full.coordinates, full.times, axis=0, edge_order=2)
        deviations = np.hstack([full.coordinates, speeds])
        rates = np.gradient(deviations, full.times, axis=0, edge_order=2)[rows]
        motion, outputs = rates[:, :0], full.outputs[rows]
    else:
        full = replace(run, maneuver=maneuver).recorded()
        motion = outputs = full.states[rows, :0]
        if model.kind == "ae":
            deviations, rates = full.coordinates, np.zeros_like(full.states[rows])
        elif states.shape:
            shape, deviations = states.shape, states.of(full.states)
            rates, motion = shape.rates(deviations[rows] + shape.reference, full.inputs[rows])
            motion = motion - [0.0, shape.speed, 0.0]
        else:
            deviations = states.of(full.states)
            rates = model.rhs_at(full.states[rows], full.inputs[rows])
    inputs = online_inputs(model, full.inputs)
    return (
        inputs[rows],
        inputs[rows + 1],
        deviations[rows],
        deviations[rows + 1],
        rates,
        motion,
        outputs,
        full.counts[model.evaluations] + len(rows),
    )


def components(samples: Samples, rank: int) -> tuple[np.ndarray, np.ndarray]:
    """The first principal components of the samples, at most as many as they span.

    Components of mean square 1 per deviation (r, n), and deviations per component (n, r).
    States stand in SI units: scaled by their ranges, ringing of the wheels would come first, and
    learned models of it were unstable.  `InputError` if nothing moves.
    """
    _, sizes, rows = np.linalg.svd(samples.deviations, full_matrices=False)
    if sizes[0] < RESTING * np.sqrt(len(samples.deviations)):
        raise InputError("nothing moves in the training runs: there is nothing to learn")
    sizes = sizes[:rank][sizes[:rank] > ROUNDING * sizes[0]] / np.sqrt(len(samples.deviations))
    vectors = rows[: len(sizes)]
    return vectors / sizes[:, None], vectors.T * sizes
