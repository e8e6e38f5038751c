"""Models of general learners: training data, fitted equations of few coordinates, one loop."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from pydantic import Field

from vehiclemor.arguments import check_shapes, require
from vehiclemor.codegen.loops import Loop, loops
from vehiclemor.inputs.checks import checked_maneuver
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.reduction.interface import OfflineCost, installed
from vehiclemor.reduction.learned.learned_loops import Equations
from vehiclemor.reduction.learned.samples import (
    Samples,
    States,
    components,
    gathered,
    online_inputs,
)
from vehiclemor.reduction.settings import SHORTEST, Settings
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.trust import trust_of
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.run_timer import timed
from vehiclemor.simulation.trajectory import Start, Trajectory

# Runge-Kutta steps: longest as a multiple of the fastest linear time, and how many a sample at
# most.
STABLE, MOST_STEPS = 2.0, 50
# Relative singular values that least squares leave out.
CUT = 1e-10
# How far a run may leave the samples of training, which lie apart, as a multiple of their range;
# and part of a parameter by which it may leave the one value of training.
MARGIN, SLACK = 1.1, 0.05

Terms = Sequence[tuple[int, ...]]


class LearnedSettings(Settings):
    """What all general learners share."""

    rank: int = Field(
        4, ge=1, le=100, description="principal components, at most; a mechanism has none"
    )
    steps: int = Field(1, ge=1, le=100, description="samples in the time between output times")
    skipped: float = Field(
        0.0, ge=0.0, le=100.0, description="first seconds of a run that are not learned from"
    )


def monomials(arguments: int, degree: int, constant: bool) -> Terms:
    """Products of up to so many of the arguments, as numbers from 1 on; () is the constant."""
    orders = range(0 if constant else 1, degree + 1)
    numbers = range(1, arguments + 1)
    return [term for order in orders for term in combinations_with_replacement(numbers, order)]


def columns(terms: Terms, values: np.ndarray) -> np.ndarray:
    """Monomials (samples, terms) of arguments (samples, arguments)."""
    padded = np.column_stack([np.ones(len(values)), values])
    products = [np.prod(padded[:, list(term)], axis=1) for term in terms]
    return np.column_stack(products) if products else np.empty((len(values), 0))


def polynomials(terms: Terms, coefficients: np.ndarray, arguments: int) -> Equations:
    """Polynomials as equations: coefficients (terms, m)."""
    return Equations(
        _table(terms),
        np.ascontiguousarray(coefficients),
        widths=np.zeros(0, dtype=np.int64),
        weights=np.zeros(0),
        lengths=np.zeros(arguments),
        centres=np.zeros((0, arguments)),
        heights=np.zeros((0, coefficients.shape[1])),
    )


def stable_step(equations: Equations, r: int, longest: float) -> float:
    """The longest step in s, over an integer, that is stable for linear rates of r components."""
    linear = np.zeros((r, r))
    for term, row in zip(equations.terms, equations.coefficients, strict=True):
        if 0 < term[0] <= r <= len(row) and not term[1:].any():
            linear[term[0] - 1] = row[:r]
    fastest = np.abs(np.linalg.eigvals(linear)).max()
    return longest / float(np.clip(np.ceil(longest * fastest / STABLE), 1, MOST_STEPS))


@dataclass(frozen=True, eq=False)
class TrainingData:
    """Samples of the training runs for a regression, and the model of fitted equations."""

    samples: Samples
    # Components per deviation (r, n) and back (n, r).
    forward: np.ndarray
    back: np.ndarray
    discrete_time: bool  # Whether changes in one step are learned; else rates.
    began: float  # `time.process_time()` at the beginning of the fit.

    @classmethod
    def of(
        cls,
        model: Any,
        training: Training,
        settings: LearnedSettings,
        discrete_time: bool,
        library: str,
    ) -> "TrainingData":
        """From training runs; `InputError` if the package of the library is missing."""
        with installed(library):
            import_module(library)
        samples = gathered(model, training, settings.steps, settings.skipped)
        # Samples that another fit has gathered count as if this one had.
        began = time.process_time() - samples.seconds
        return cls(samples, *components(samples, settings.rank), discrete_time, began)

    @cached_property
    def input_scale(self) -> np.ndarray:
        """Magnitudes (inputs,) of the inputs."""
        scale = np.abs(self.samples.inputs).max(axis=0)
        return np.where(scale > 0.0, scale, 1.0)

    @cached_property
    def coordinates(self) -> tuple[np.ndarray, np.ndarray]:
        """Components (samples, r) of the samples, and of those that follow."""
        s = self.samples
        return s.deviations @ self.forward.T, s.next_deviations @ self.forward.T

    @cached_property
    def inputs(self) -> np.ndarray:
        """Standardised inputs; of one-step models those of the sample that follows too."""
        s, scale = self.samples, self.input_scale
        more = [s.next_inputs / scale] if self.discrete_time else []
        return np.hstack([s.inputs / scale, *more])

    @cached_property
    def regression(self) -> tuple[np.ndarray, np.ndarray]:
        """Standardised arguments (samples, v - 1) and results (samples, m).

        The first r results are rates of the components or, of one-step models, their changes; then
        come psi', U, V of a vehicle, beyond those of straight running.  Of a mechanism the results
        are the coordinates.
        """
        s, (z, following) = self.samples, self.coordinates
        if s.states.model.kind == "ae":
            return self.inputs, s.deviations
        results = following - z if self.discrete_time else s.rates @ self.forward.T
        return np.hstack([z, self.inputs]), np.hstack([results, s.motion])

    def least_squares(self, terms: Terms, values: np.ndarray, arguments: np.ndarray) -> np.ndarray:
        """Coefficients (terms, m) of values (samples, m)."""
        return np.linalg.lstsq(columns(terms, arguments), values, rcond=CUT)[0]

    @cached_property
    def linear(self) -> tuple[Equations, np.ndarray]:
        """Linear equations by least squares, and their residuals (samples, m)."""
        arguments, results = self.regression
        terms = monomials(arguments.shape[1], 1, self.samples.constant)
        coefficients = self.least_squares(terms, results, arguments)
        residuals = results - columns(terms, arguments) @ coefficients
        return polynomials(terms, coefficients, arguments.shape[1]), residuals

    def with_motion(self, terms: Terms, coefficients: np.ndarray) -> Equations:
        """Polynomials with these coefficients of rates (terms, r); psi', U, V in the same terms."""
        arguments, results = self.regression
        motion = self.least_squares(terms, results[:, coefficients.shape[1] :], arguments)
        return polynomials(terms, np.hstack([coefficients, motion]), arguments.shape[1])

    @cached_property
    def residual_scale(self) -> np.ndarray:
        """Magnitudes (m,) of the residuals of linear equations; 1 of rounding."""
        sizes = self.linear[1].std(axis=0)
        return np.where(sizes > CUT * np.abs(self.regression[1]).max(initial=0.0), sizes, 1.0)

    def model(self, equations: Equations, observables: Terms = ()) -> "LearnedModel":
        """The model of fitted equations; `observables` are monomials of the first components."""
        samples = self.samples
        if samples.states.shape:
            equations = self._with_straight_running(equations)
        time_step = samples.spacing
        if not self.discrete_time:
            time_step = stable_step(equations, len(self.forward), samples.spacing)
        return LearnedModel(
            samples.states,
            forward=self.forward,
            back=self.back,
            equations=equations,
            time_step=time_step,
            discrete_time=self.discrete_time,
            input_scale=self.input_scale,
            observables=_table(observables),
            outputs=self._output_coefficients(),
            ranges=self._ranges(),
            offline=OfflineCost(time.process_time() - self.began, samples.evaluations),
        )

    def _with_straight_running(self, equations: Equations) -> Equations:
        """Equations of a vehicle with the speed of straight running added to U."""
        shape = self.samples.states.shape
        assert shape is not None
        straight = np.zeros((1, equations.coefficients.shape[1]))
        straight[0, -2] = shape.speed
        return equations._replace(
            terms=np.vstack([equations.terms, np.zeros_like(equations.terms[:1])]),
            coefficients=np.vstack([equations.coefficients, straight]),
        )

    def _output_coefficients(self) -> np.ndarray:
        """Coefficients (components + inputs + 1, outputs) of a structure's outputs."""
        samples = self.samples
        if samples.states.model.kind != "structural":
            return np.zeros((0, 0))
        # The forces at the ports are in the accelerations: they are no function of motion.
        inputs = samples.inputs / self.input_scale
        arguments = np.hstack([self.coordinates[0], inputs, np.ones((len(inputs), 1))])
        return np.linalg.lstsq(arguments, samples.outputs, rcond=CUT)[0]

    def _ranges(self) -> np.ndarray:
        """Least and largest value (values, 2) of each component and each online parameter."""
        largest = np.abs(self.coordinates[0]).max(axis=0, initial=0.0)
        online = self.samples.inputs[:, len(self.samples.states.model.inputs) :]
        parameters = np.column_stack([online.min(axis=0), online.max(axis=0)])
        return np.vstack([np.column_stack([-largest, largest]), parameters])


def _table(terms: Terms) -> np.ndarray:
    """Monomials (terms, degree) as numbers of their factors, filled up by zeros."""
    degree = max(map(len, terms), default=1) or 1
    table = np.zeros((len(terms), degree), dtype=np.int64)
    for row, term in zip(table, terms, strict=True):
        row[: len(term)] = term
    return table


@dataclass(frozen=True, eq=False)
class LearnedModel(ShortRepr):
    """Equations that a general learner has fitted to training runs."""

    states: States
    # Components per deviation of these (r, n) and back (n, r).
    forward: np.ndarray
    back: np.ndarray
    equations: Equations  # Of components and standardised inputs, see `TrainingData`.
    # In s; whether the equations give what changes in a step, or rates.
    time_step: float
    discrete_time: bool
    input_scale: np.ndarray  # Magnitudes of the inputs (inputs,).
    # Monomials (coordinates, degree) of the components that are coordinates; none: components.
    observables: np.ndarray
    outputs: np.ndarray  # Coefficients (components + inputs + 1, outputs) of a structure's outputs.
    # Least and largest value in training of each component and online parameter; a run beyond is
    # not trusted.
    ranges: np.ndarray
    offline: OfflineCost

    @property
    def model(self) -> Any:
        """The full model."""
        return self.states.model

    def check_sizes(self) -> None:
        """Raise `ValueError` if the equations are none of these coordinates and inputs."""
        arguments, m = self.equations.sizes
        static, inputs = self.model.kind == "ae", len(self.input_scale)
        if static:
            require((arguments, m) == (inputs, len(self.model.coordinates)), "equations")
        else:
            inputs *= 1 + self.discrete_time
            sizes = self.order + inputs, self.order + self.states.planar
            require((arguments, m) == sizes, "equations")
        require(SHORTEST <= self.time_step < np.inf, "time_step")
        r, online = len(self.forward), len(self.model.definition.online)
        check_shapes("ranges", (self.ranges, r + online, 2))
        require(len(self.input_scale) == len(self.model.inputs) + online, "input_scale")
        require(self.forward.shape == self.back.T.shape, "components")
        if not static and self.model.kind != "structural":
            n = len(self.states.of(self.model.start()[None])[0])
            check_shapes("components", (self.forward, r, n), (self.back, n, r))
        elif self.model.kind == "structural":
            rows = r + len(self.input_scale) + 1
            check_shapes("outputs", (self.outputs, rows, len(self.model.outputs)))
        require(bool(((self.observables >= 0) & (self.observables <= r)).all()), "observables")

    @property
    def order(self) -> int:
        """Number of coordinates: components, or monomials of them."""
        return len(self.observables) or len(self.forward)

    def for_model(self, model: Any) -> "LearnedModel":
        """The same equations for a model whose online parameters are others."""
        return replace(self, states=States.of_model(model))

    def simulate(self, maneuver: Excitation, start: Start) -> Trajectory:
        """A run at the maneuver's output times, between steps by linear interpolation."""
        table, run = self._run(maneuver, start)
        if self.model.kind == "ae" or run.status != "ok":
            return run
        r = len(self.forward)
        online = online_inputs(self.model, run.inputs)[:, len(self.model.inputs) :]
        (low, high), values = self.ranges.T, np.hstack([table[:, :r], online])
        reach = MARGIN * np.maximum(0.5 * (high - low), SLACK * np.abs(high))
        used = np.abs(values - 0.5 * (low + high)) / np.where(reach > 0.0, reach, 1.0)
        names = [f"component {i + 1}" for i in range(r)] + [*self.model.definition.online]
        trust = trust_of(run.times, used, names)
        return run.judged(trust) if trust.indicator > 1.0 else run

    def _run(self, maneuver: Excitation, start: Start) -> tuple[np.ndarray, Trajectory]:
        """Coordinates and quadratures at the output times, and the run."""
        model = self.model
        maneuver = checked_maneuver(maneuver, model.definition)
        times, inputs = maneuver.recorded_inputs
        nothing = np.zeros(len(model.counts), dtype=np.int64)
        if model.kind == "ae":
            model.check_start(start)
            path, seconds = timed(lambda: self._values(inputs / self.input_scale))
            return path[:, :0], model.trajectory(times, inputs, path, nothing.tolist(), seconds)
        initial_state = model.start(start)
        (path, reached), seconds = timed(lambda: self._path(maneuver, initial_state))
        step_times = self.time_step * np.arange(len(path))
        late = times > step_times[reached - 1] + 1e-9
        failure = ""
        if reached < len(path):
            failure = f"the learned equations have diverged at t = {step_times[reached]:.4g} s"
        table = np.column_stack([np.interp(times, step_times, column) for column in path.T])
        table[late & bool(failure)] = np.nan
        r = len(self.forward)
        if model.kind == "structural":
            u = online_inputs(model, inputs) / self.input_scale
            return table, Trajectory.of(
                times=times,
                inputs=inputs,
                coordinates=inputs[:, :0],
                speeds=inputs[:, :0],
                outputs=np.column_stack([table[:, :r], u, np.ones(len(u))]) @ self.outputs,
                counts=dict.fromkeys(model.counts, 0),
                seconds=seconds,
                status="diverged" if failure else "ok",
                message=failure,
                names=model.outputs,
                model=model,
            )
        states = self.states.back(table[:, :r] @ self.back.T, table[:, self.order :])
        states[0] = initial_state
        return table, model.trajectory(times, inputs, states, nothing, seconds, failure)

    def best_approximation(self, states: np.ndarray) -> np.ndarray | None:
        """Full states (samples, 2 n) in the span of the components."""
        if self.model.kind in ("ae", "structural"):
            return None
        deviations = self.states.of(states) @ self.forward.T @ self.back.T
        planar = np.array([self.states.planar_of(state) for state in states])
        return self.states.back(deviations, planar)

    def _values(self, arguments: np.ndarray) -> np.ndarray:
        """Results (samples, m) at standardised arguments (samples, v - 1)."""
        results = np.empty((len(arguments), self.equations.coefficients.shape[1]))
        v = np.column_stack([np.ones(len(arguments)), arguments])
        learned_loop("evaluated")(self.equations, v, self._buffer(0), results)
        return results

    def _path(self, maneuver: Excitation, state: np.ndarray) -> tuple[np.ndarray, int]:
        """Coordinates and quadratures at all steps of a run, and how many rows are reached."""
        steps = max(int(np.ceil(maneuver.duration / self.time_step - 1e-9)), 1)
        halves = 0.5 * self.time_step * np.arange(2 * steps + 1)
        inputs = maneuver.at(np.minimum(halves, maneuver.duration))
        scaled = online_inputs(self.model, inputs) / self.input_scale
        path = np.empty((steps + 1, self.equations.coefficients.shape[1]))
        path[0] = self._encoded(state)
        discrete, buffer = int(self.discrete_time), self._buffer(path.shape[1])
        reached = learned_loop("march")(
            self.equations, self.order, self.time_step, discrete, scaled, path, buffer
        )
        return path, reached

    def _encoded(self, state: np.ndarray) -> np.ndarray:
        """Coordinates of a full state, then heading and position."""
        if self.model.kind == "structural":
            return np.zeros(self.order)
        z = self.states.of(state[None]) @ self.forward.T
        if len(self.observables):
            z = np.prod(np.column_stack([[1.0], z])[:, self.observables], axis=2)
        return np.concatenate([z[0], self.states.planar_of(state)])

    def _buffer(self, size: int) -> np.ndarray:
        layers = 2 * max(self.equations.widths.tolist(), default=0)
        return np.empty(5 * size + len(self.equations.lengths) + 1 + layers)


def learned_loop(name: str) -> Loop:
    """A compiled loop of learned equations."""
    return loops(("reduction.learned.learned_loops",), ("march", "evaluated"))[name]
