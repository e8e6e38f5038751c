"""Models of general learners: training data, a learned step of few coordinates, what follows it."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import import_module
from typing import Any, Literal

import numpy as np
from pydantic import Field
from scipy.interpolate import CubicSpline

from vehiclemor.inputs.checks import checked_maneuver
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.reduction.error_estimate import estimates
from vehiclemor.reduction.interface import OfflineCost, installed
from vehiclemor.reduction.learned_samples import (
    Coordinates,
    Samples,
    deviations_of,
    gathered,
    online_inputs,
    principal,
    shape_of,
    slow,
    thinned,
)
from vehiclemor.reduction.settings import Settings
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.trust import trust_of
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.run_timer import timed
from vehiclemor.simulation.trajectory import Start, Trajectory

# Beyond this magnitude of a standardised coordinate a run has diverged.
LARGEST = 1e3
# How far a run may leave the samples of training, which lie apart, as a multiple of their range;
# and part of a parameter by which it may leave the one value of training.
MARGIN, SLACK = 1.1, 0.05

# One step of some runs: coordinates (runs, r) and standardised inputs at its ends (runs, 2 inputs)
# -> coordinates (runs, r).
Step = Callable[[np.ndarray, np.ndarray], np.ndarray]
# Coordinates (runs, r) at the start and inputs of all steps (steps, runs, 2 inputs) -> coordinates
# (steps + 1, runs, r); from where a run diverges they are no numbers.
Path = Callable[[np.ndarray, np.ndarray], np.ndarray]


class SampledSettings(Settings):
    """How training runs are sampled and states are read from coordinates."""

    readout: int = Field(
        1, ge=1, le=4, description="degree of the polynomials that give states and outputs"
    )
    steps: int = Field(1, ge=1, le=100, description="samples in the time between output times")
    skipped: float = Field(
        0.0, ge=0.0, le=100.0, description="first seconds of a run that are not learned from"
    )


class LearnedSettings(SampledSettings):
    """What all general learners share."""

    coordinates: Literal["principal", "slow"] = Field(
        "principal", description="principal components; of a vehicle those of slow_manifold too"
    )
    rank: int = Field(
        4, ge=1, le=100, description="principal components, at most; a mechanism has none"
    )

    def of_samples(self, samples: Samples) -> Coordinates:
        """The chosen coordinates, standardised."""
        chosen = slow(samples) if self.coordinates == "slow" else principal(samples, self.rank)
        return chosen.standardised(samples)


def stepped(step: Step) -> Path:
    """A path by one step after the other, of each run until it diverges."""

    def path(start: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        path = np.full((len(inputs) + 1, *start.shape), np.nan)
        path[0] = z = start
        sound = np.ones(len(start), dtype=bool)
        for k, u in enumerate(inputs):
            z = step(z, u)
            sound &= np.abs(z).max(axis=1) < LARGEST
            if not sound.any():
                break
            path[k + 1, sound] = z[sound]
            # Libraries refuse what is no number.
            z = np.where(sound[:, None], z, 0.0)
        return path

    return path


def paths_in_step(
    path: Path, starts: Sequence[np.ndarray], inputs: Sequence[np.ndarray]
) -> list[np.ndarray]:
    """Coordinates (steps + 1, r) of some runs, from starts (r,) and inputs (steps, 2 inputs).

    All of them go on step by step together: a prediction of many rows takes a library hardly longer
    than one of a single row.
    """
    padded = np.zeros((max(map(len, inputs)), len(inputs), inputs[0].shape[1]))
    for run, u in enumerate(inputs):
        padded[: len(u), run] = u
    with np.errstate(all="ignore"):
        paths = np.asarray(path(np.stack(starts), padded))
    return [paths[: len(u) + 1, run] for run, u in enumerate(inputs)]


def predicted(*regressors: tuple[Any, Any]) -> Path:
    """A path whose changes in a step are what regressors of scikit-learn predict, times scales."""

    def step(z: np.ndarray, u: np.ndarray) -> np.ndarray:
        v = np.hstack([z, u])
        return z + sum(scale * regressor.predict(v) for regressor, scale in regressors)

    return stepped(step)


@dataclass(frozen=True, eq=False)
class TrainingData:
    """Samples of the training runs for a regression, and the model of what is learned."""

    samples: Samples
    coordinates: Coordinates
    readout: int  # Degree.
    began: float  # `time.process_time()` at the beginning of the fit.

    @classmethod
    def of(
        cls, model: Any, training: Training, settings: Any, library: str = "sklearn"
    ) -> "TrainingData":
        """From training runs; `InputError` if the package of the library is missing."""
        for needed in (library, "sklearn"):
            with installed(needed):
                import_module(needed)
        samples = gathered(model, training, settings.steps, settings.skipped)
        # Samples that another fit has gathered count as if this one had.
        began = time.process_time() - samples.seconds
        return cls(samples, settings.of_samples(samples), settings.readout, began)

    @property
    def static(self) -> bool:
        """Whether coordinates follow from the inputs, as of a mechanism: there are no steps."""
        return self.samples.model.kind == "ae"

    @property
    def constant(self) -> bool:
        """Whether there are constant terms; a vehicle that is not steered runs straight on."""
        return self.samples.shape is None

    @cached_property
    def input_scale(self) -> np.ndarray:
        """Magnitudes (inputs,) of the inputs."""
        scale = np.max([np.abs(run.inputs).max(axis=0) for run in self.samples.runs], axis=0)
        return np.where(scale > 0.0, scale, 1.0)

    @cached_property
    def paths(self) -> list[np.ndarray]:
        """Coordinates (samples, r) of each run."""
        return [self.coordinates.of(run.deviations, run.inputs) for run in self.samples.runs]

    @cached_property
    def inputs(self) -> list[np.ndarray]:
        """Standardised inputs at both ends of each step (samples - 1, 2 inputs) of each run."""
        return [both_ends(run.inputs / self.input_scale) for run in self.samples.runs]

    @cached_property
    def steps(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Coordinates (samples, r), inputs and coordinates a step later, of all runs."""
        following = thinned([z[1:] for z in self.paths])
        return thinned([z[:-1] for z in self.paths]), thinned(self.inputs), following

    @cached_property
    def regression(self) -> tuple[np.ndarray, np.ndarray]:
        """Arguments (samples, v) and results (samples, m): what changes in a step.

        Of a mechanism they are standardised inputs and the coordinates.
        """
        if self.static:
            scaled = thinned([run.inputs for run in self.samples.runs]) / self.input_scale
            return scaled, thinned([run.deviations for run in self.samples.runs])
        now, inputs, following = self.steps
        return np.hstack([now, inputs]), following - now

    def with_residual(self, regressor: Any, samples: slice | np.ndarray) -> "LearnedModel":
        """The model of a linear regression, and a regressor of what it leaves at some samples."""
        linear, size = self.fit_residual(regressor, samples)
        if self.static:
            return self.model(lambda _, u: linear.predict(u) + size * regressor.predict(u))
        return self.model(predicted((linear, 1.0), (regressor, size)))

    def fit_residual(self, regressor: Any, samples: slice | np.ndarray) -> tuple[Any, np.ndarray]:
        """Fit a regressor to what a linear regression leaves; this, and the sizes (m,) of that."""
        from sklearn.linear_model import LinearRegression

        arguments, results = self.regression
        linear = LinearRegression(fit_intercept=self.constant).fit(arguments, results)
        left = results - linear.predict(arguments)
        size = left.std(axis=0)
        size[size == 0.0] = 1.0
        regressor.fit(arguments[samples], left[samples] / size)
        return linear, size

    def model(self, path: Path) -> "LearnedModel":
        """The model of learned paths, with what follows from its coordinates."""
        from sklearn.linear_model import LinearRegression
        from sklearn.pipeline import make_pipeline
        from sklearn.preprocessing import PolynomialFeatures

        samples, readout, z = self.samples, None, thinned(self.paths)
        inputs = thinned([run.inputs for run in samples.runs])
        if not self.static:
            arguments = np.hstack([z, inputs / self.input_scale])
            values = thinned([run.values for run in samples.runs])
            features = PolynomialFeatures(self.readout, include_bias=False)
            linear = LinearRegression(fit_intercept=self.constant)
            readout = make_pipeline(features, linear).fit(arguments, values)
        largest = np.abs(z).max(axis=0)
        online = inputs[:, len(samples.model.inputs) :]
        low, high = np.append(-largest, online.min(axis=0)), np.append(largest, online.max(axis=0))
        return LearnedModel(
            samples.model,
            self.coordinates,
            path,
            readout,
            time_step=samples.spacing,
            input_scale=self.input_scale,
            middle=0.5 * (low + high),
            reach=MARGIN * np.maximum(0.5 * (high - low), SLACK * np.abs(high)),
            offline=OfflineCost(time.process_time() - self.began, samples.evaluations),
        )


def both_ends(inputs: np.ndarray) -> np.ndarray:
    """Inputs (steps, 2 inputs) at both ends of the steps between samples (steps + 1, inputs)."""
    return np.hstack([inputs[:-1], inputs[1:]])


@dataclass(frozen=True, eq=False)
class LearnedModel(ShortRepr):
    """What a general learner has learned from training runs, run by the library that fitted it."""

    model: Any  # The full one.
    coordinates: Coordinates
    path: Path
    # `RunSamples.values` per coordinates and standardised inputs; none of a mechanism.
    readout: Any
    time_step: float  # In s.
    input_scale: np.ndarray  # Magnitudes of the inputs (inputs,).
    # Middle of coordinates and online parameters in training, and how far a trusted run may go.
    middle: np.ndarray
    reach: np.ndarray
    offline: OfflineCost
    # Inputs and start of a run as bytes -> its path, see `in_step`.
    known: dict[bytes, np.ndarray] = field(default_factory=dict)

    @cached_property
    def shape(self) -> VehicleShape | None:
        """Of a vehicle."""
        return shape_of(self.model)

    @property
    def order(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates.forward)

    def for_model(self, model: Any) -> "LearnedModel":
        """The same for a model whose online parameters are others."""
        return replace(self, model=model)

    def in_step(self, runs: Sequence[tuple[Any, Excitation, Start]]) -> "LearnedModel":
        """The same, with the paths of some runs (model, maneuver, start) known."""
        if self.model.kind == "ae":
            return self
        starts, inputs = [], []
        for model, maneuver, start in runs:
            checked = checked_maneuver(maneuver, model.definition)
            _, z, u = self.for_model(model)._begun(checked, model.start(start))
            starts.append(z)
            inputs.append(u)
        paths = paths_in_step(self.path, starts, inputs)
        return replace(self, known=dict(zip(map(_key, starts, inputs), paths, strict=True)))

    def best_approximation(self, states: np.ndarray) -> None:
        """States are no linear function of the coordinates: there is no subspace."""

    def simulate(self, maneuver: Excitation, start: Start) -> Trajectory:
        """A run at the maneuver's output times, between steps by cubic splines."""
        model = self.model
        maneuver = checked_maneuver(maneuver, model.definition)
        times, inputs = maneuver.recorded_inputs
        counts = np.zeros(len(model.counts), dtype=np.int64)
        if model.kind == "ae":
            model.check_start(start)
            path, seconds = timed(lambda: self.path(np.zeros(0), inputs / self.input_scale))
            return model.trajectory(times, inputs, path, counts.tolist(), seconds)
        state = model.start(start)
        (steps, z), seconds = timed(lambda: self._path(maneuver, state))
        failure = ""
        if len(z) < len(steps):
            failure = f"the learned equations have diverged at t = {steps[len(z)]:.4g} s"
        reached = times <= steps[len(z) - 1] + 1e-9
        used = online_inputs(model, inputs)
        table = _splined(steps[: len(z)], z)(np.minimum(times, steps[len(z) - 1]))
        values = self.readout.predict(np.hstack([table, used / self.input_scale]))
        values[~reached] = np.nan
        if model.kind != "structural":
            values = self._states(times, values, state)
        run = model.trajectory(times, inputs, values, counts, seconds, failure)
        # The error of a vehicle's run is estimated afterwards.
        if run.status != "ok" or estimates(model):
            return run
        known = np.hstack([table, used[:, len(model.inputs) :]])
        beyond = (known - self.middle) / np.where(self.reach > 0.0, self.reach, 1.0)
        names = [f"component {i + 1}" for i in range(self.order)] + [*model.definition.online]
        trust = trust_of(times, beyond, names)
        return run.judged(trust) if trust.indicator > 1.0 else run

    def _path(self, maneuver: Excitation, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Times of all steps of a run, and the coordinates of those that are reached."""
        times, z, inputs = self._begun(maneuver, state)
        path = self.known.get(_key(z, inputs))
        if path is None:
            (path,) = paths_in_step(self.path, [z], [inputs])
        with np.errstate(invalid="ignore"):
            sound = (np.abs(path) < LARGEST).all(axis=1)
        return times, path[: len(path) if sound.all() else max(int(np.argmin(sound)), 1)]

    def _begun(self, maneuver: Excitation, state: np.ndarray) -> tuple[np.ndarray, ...]:
        """Times of all steps, coordinates (r,) at the start, inputs (steps, 2 inputs)."""
        model, count = self.model, int(np.ceil(maneuver.duration / self.time_step - 1e-9))
        times = self.time_step * np.arange(max(count, 1) + 1)
        inputs = online_inputs(model, maneuver.at(np.minimum(times, maneuver.duration)))
        z = np.zeros(self.order)
        if model.kind != "structural":
            deviation = deviations_of(model, self.shape, state[None])
            z = self.coordinates.of(deviation, inputs[:1])[0]
        return times, z, both_ends(inputs / self.input_scale)

    def _states(self, times: np.ndarray, values: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Full states (samples, 2 n): heading and position of a vehicle follow by quadratures."""
        if not (shape := self.shape):
            states = values + self.model.start()
        else:
            turn, *speeds = (values[:, -3:] + [0.0, shape.speed, 0.0]).T
            x, y, psi = start[self.model.planar]
            heading = psi + _integral(times, turn)
            velocity = (speeds[0] + 1j * speeds[1]) * np.exp(1j * heading)
            place = x + 1j * y + _integral(times, velocity)
            planar = np.column_stack([place.real, place.imag, heading])
            states = shape.states(values[:, :-3] + shape.reference, planar)
        states[0] = start
        return states


def _key(start: np.ndarray, inputs: np.ndarray) -> bytes:
    """All that a path follows from."""
    return start.tobytes() + inputs.tobytes()


def _splined(times: np.ndarray, values: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Cubic splines through values (samples, ...); of a single sample that value."""
    if len(times) < 2:
        return lambda wanted: np.repeat(values, len(wanted), axis=0)
    return CubicSpline(times, values)


def _integral(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Integrals (samples,) from the first time on of values, no numbers from where these are."""
    count = int(np.isfinite(values).sum())
    integral = values.copy()
    integral[:1] = 0.0
    if count > 1:
        times, values = times[:count], values[:count]
        integral[:count] = CubicSpline(times, values).antiderivative()(times)
    return integral
