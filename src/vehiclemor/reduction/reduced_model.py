"""A model in use, reduced or full: an object that is built once, then run, stepped and asked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.arguments import real_array
from vehiclemor.exceptions import InputError, blamed
from vehiclemor.files import data_folder
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.inputs.maneuver import registered
from vehiclemor.reduction import model_file
from vehiclemor.reduction.error_estimate import NOT_ESTIMATED, checked_bounds, estimates
from vehiclemor.reduction.fallback import run_of
from vehiclemor.reduction.interface import FittedModel, Method, lower_rank
from vehiclemor.reduction.settings import Value
from vehiclemor.reduction.training import own_speed, training_summary
from vehiclemor.reduction.trust import InputRange
from vehiclemor.reduction.validation import for_model, validated
from vehiclemor.registry import choice, component
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.checks import check_positive, checked_array, checked_path, checked_time
from vehiclemor.simulation.linear_model import LinearModel
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.stepping import SHORTEST
from vehiclemor.simulation.trajectory import Names, Start, Trajectory, Trust, output_names

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, eq=False)
class ReducedOrderModel(ShortRepr):
    """A model that a method has reduced, or the full one behind the same names.

    Attributes
    ----------
    model, method, settings
        The full model, the registered name of the method and all of its settings.
    training
        Scenarios that it has been trained on; of a loaded model the content of each.
    reduced
        What the method's fit gave.
    input_range
        Range of the inputs of its training, in which a run is known whose model has learnt from
        them and has no other ranges.
    """

    repr_fields = ("model", "method", "settings", "states", "inputs", "output_names")

    model: Model
    method: str
    settings: Mapping[str, Value]
    training: tuple[Any, ...]
    reduced: FittedModel
    input_range: InputRange | None = None

    def __str__(self) -> str:
        lines = [f"{self._name}, order {self.reduced.order}", self._lower_rank]
        if self.input_range is not None:
            runs = self.__getstate__()["training"]
            sizes, inputs = self.input_range.largest, self.model.definition.inputs
            covered = training_summary(self.method, runs, sizes, inputs)
            lines += [f"{name}: {text}" for name, text in covered.items()]
        return "\n  ".join(filter(None, lines))

    @cached_property
    def _lower_rank(self) -> str:
        return lower_rank(self.settings, self.reduced)

    @cached_property
    def states(self) -> tuple[str, ...]:
        """Names of the states; empty for a model that can't be stepped."""
        return tuple(self._stepped.states) if hasattr(self.reduced, "step") else ()

    @cached_property
    def _stepped(self) -> Any:
        """What fit gave, as a function of states; `InputError` if it is none."""
        if not hasattr(self.reduced, "step"):
            raise InputError(f"{self.method} has no state: it gives whole runs alone")
        return self.reduced

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self.model.inputs

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.model.outputs

    @property
    def parameters(self) -> dict[str, Any]:
        """Name -> value of the model's parameters, SI units."""
        return self.model.parameters.values()

    def simulate(
        self,
        maneuver: str | Excitation | None = None,
        start: Start | None = None,
        *,
        outputs: Names = None,
        times: Any = None,
        bounds: Mapping[str, Any] | None = None,
        trust: str = "estimate",
    ) -> Trajectory:
        """A run at the maneuver's output times.

        Of a vehicle or mechanism its error is estimated (`ErrorEstimate`): beyond a bound it is
        `untrusted`.

        Parameters
        ----------
        maneuver
            A maneuver or its registered name; by default that of the model.
        start
            Initial condition of the full model, by name or as a state (n,); its first by default.
        outputs, times
            What of it is recorded, see `Trajectory.chosen`.
        bounds
            Output -> largest error in its unit, or (`max` or `rms`, that); by default the model's.
        trust
            `estimate`, or `off`: the run is not judged.
        """
        chosen = self.model.definition.maneuver if maneuver is None else maneuver
        if isinstance(chosen, str):
            chosen = registered(chosen)
        first = self.model.starts[0] if start is None else start
        off = choice("trust", trust, ("estimate", "off")) == "off"
        own = None if bounds is None else self.checked_bounds(bounds, off)
        with blamed(f"method {self.method!r}: simulate", self.reduced):
            names = None if outputs is None else output_names(outputs)
            estimate = not (off or self._method.own_limits)
            run = run_of(self.reduced, (chosen, first), names, own, estimate)
        # It is off, too short, or nothing is bounded.
        unknown = estimate and run.trust is None and run.finished and estimates(run.model)
        remarks = run.remark, self._lower_rank, NOT_ESTIMATED if off or unknown else ""
        # A copy would take a twentieth of a short run.
        run.__dict__.update(method=self.method, maneuver=chosen.name)
        run.__dict__["remark"] = "; ".join(filter(None, remarks))
        if not (off or run.trust) and self._range is not None:
            run = run.judged(self._range.trust(self.model, chosen, own_speed(self.model) or 0.0))
        return run if times is None else run.chosen(times=times)

    def checked_bounds(self, bounds: Mapping[str, Any], off: bool = False) -> dict[str, Any]:
        """Bounds of `simulate` by output; `InputError` if one is wrong, or none can be judged."""
        if off:
            raise InputError("bounds: runs with trust='off' are not judged")
        if self._method.own_limits:
            raise InputError(f"bounds: errors of these runs by {self.method} are not estimated")
        return checked_bounds(self.model, bounds)

    def for_parameters(self, parameters: Mapping[str, object]) -> ReducedOrderModel:
        """The model with other parameters, reduced by a method that learns from no run.

        Parameters
        ----------
        parameters
            Name -> value in SI units of what differs from this model.

        Raises
        ------
        VehiclemorError
            If a parameter is wrong, the model can't stand, or the method is trained on runs.
        """
        from vehiclemor.simulation.build import reparametrised

        model = reparametrised(self.model, parameters)
        settings = validated(self._method, model.kind, self.settings)
        reduced = for_model(self._method, self.reduced, model, settings)
        return replace(self, model=model, reduced=reduced)

    @cached_property
    def _method(self) -> Method:
        return component("method", self.method)

    @cached_property
    def _range(self) -> InputRange | None:
        """Known inputs, if the method does not judge its runs."""
        return self._method.known_range(self.model, self.settings, lambda: self.input_range)

    def dataset(self, run: Trajectory) -> xr.Dataset:
        """A run as a labelled dataset, with units."""
        return run.dataset()

    def state(self, start: Start | None = None, inputs: Any = None) -> np.ndarray:
        """State (dim,) of a start of the full model, as `simulate` begins with it.

        Of a projected model it lies in the subspace, and so does what a step gives; `outputs` and
        `full_state` take a state as it is.  Of a method that fits slow motion (`slow_manifold`,
        `guarded`) it is the slow part; runs are recorded from the start itself.

        Parameters
        ----------
        start
            By name or as a state (n,) of the full model; its first by default.
        inputs
            At that time (inputs,); zero by default.
        """
        chosen = self.model.starts[0] if start is None else start
        u = np.zeros(len(self.inputs)) if inputs is None else self._inputs(inputs)
        return self._stepped.begin(chosen, u)

    def step(
        self, state: Any, inputs: Any, dt: float, time: float = 0.0, next_inputs: Any = None
    ) -> np.ndarray:
        """State (dim,) after dt s: one compiled call.

        Parameters
        ----------
        state
            As `state` or a step gives it (dim,).
        inputs
            Held for all of the step (inputs,), or at its beginning.
        dt
            Length of the step in s.
        time
            At the beginning in s: models with control periods have another basis in each.
        next_inputs
            At the end of the step; the inputs go there linearly.

        Raises
        ------
        InputError
            If an argument is wrong.
        ConvergenceError
            If the equations can't be solved.
        """
        check_positive("dt", dt, SHORTEST)
        time = checked_time(time)
        ends = None if next_inputs is None else self._inputs(next_inputs, "next_inputs")
        return self._stepped.step(self._state(state), self._inputs(inputs), dt, time, ends)

    def rhs(self, state: Any, inputs: Any, time: float = 0.0) -> np.ndarray:
        """Time derivative (dim,) of a state; `InputError` if it isn't finite."""
        rates = self._stepped.rates(self._state(state), self._inputs(inputs), checked_time(time))
        if not np.isfinite(rates).all():
            raise InputError(f"the derivative of {self._name} is not finite at this state")
        return rates

    def jacobian(
        self,
        state: Any,
        inputs: Any,
        with_respect_to: str | Sequence[str] = "state",
        of: str = "rhs",
        time: float = 0.0,
    ) -> np.ndarray:
        """Analytic derivatives (results, columns) at a state, inputs and time.

        Of a function with a kink, as where a wheel lifts off, it is the derivative on one side.

        Parameters
        ----------
        with_respect_to
            `state`, `inputs`, or names of the model's parameters, of which each component has a
            column; a reduced model has them only where its equations are those of the model.
        of
            `rhs` or `outputs`; of a kinematic model `outputs` or `coordinates`.

        Raises
        ------
        InputError
            If an argument is wrong, or the model has no such derivatives.
        """
        x, u = self._state(state), self._inputs(inputs)
        return self._stepped.sensitivities(x, u, checked_time(time), with_respect_to, of)

    def linearise(self, state: Any = None, inputs: Any = None) -> LinearModel:
        """Linear model at a state, that of the first start by default, and inputs, 0 by default."""
        u = self._inputs([0.0] * len(self.inputs) if inputs is None else inputs)
        x = self.state(None, u) if state is None else self._state(state)
        point = x, u, self.rhs(x, u), self.outputs(x, u)
        return LinearModel.of(self, self.states, point)

    def full_state(self, state: Any, inputs: Any) -> np.ndarray:
        """State (n,) of the full model, or states (samples, n) of as many."""
        states, u, single = self._samples(state, inputs)
        full = self._stepped.decode(states, u)
        return full[0] if single else full

    def outputs(self, state: Any, inputs: Any) -> np.ndarray:
        """Outputs (outputs,) at a state, or (samples, outputs) along states (samples, dim)."""
        states, u, single = self._samples(state, inputs)
        if hasattr(self._stepped, "outputs"):
            outputs = self._stepped.outputs(states, u)
            return outputs[0] if single else outputs
        full = self._stepped.decode(states, u)
        if not single:
            return self.model.values_at("outputs", full, u)
        outputs = np.empty(len(self.model.outputs))
        self.model.kernels.call("outputs", full[0], u[0], self.model.constants, outputs)
        return outputs

    def trust(self, state: Any, inputs: Any) -> Trust:
        """How far a state, or states (samples, dim), go in what the model knows.

        A model that does not judge itself knows the inputs that it was trained on, and the full
        one the ranges of validity of inputs and outputs that it declares.
        """
        states, u, _ = self._samples(state, inputs)
        if left := self._left_validity(states, u):
            return Trust(np.inf, 0.0, left)
        trust = self._stepped.trust(states, u)
        if trust is None and self._range is not None:
            trust = self._range.trust_of_inputs(self.inputs, u)
        return trust or Trust(0.0)

    def _left_validity(self, states: np.ndarray, inputs: np.ndarray) -> str:
        """Which input or output is beyond what the full model declares, if one is."""
        validity = self.model.definition.validity
        columns = dict(zip(self.inputs, inputs.T, strict=True))
        if not validity.keys().isdisjoint(self.output_names):
            outputs = self.outputs(states, inputs).T
            columns = dict(zip(self.output_names, outputs, strict=True)) | columns
        for name, (low, high) in validity.items():
            # A run that does not drive an optional input has no values of it.
            values = columns.get(name, np.zeros(0))
            wrong = values[~((values >= low) & (values <= high))]
            if len(wrong):
                return f"{name} is {wrong[0]:.4g}; the model holds from {low:g} to {high:g}"
        return ""

    def save(self, path: str | Path, overwrite: bool = False) -> Path:
        """Write it into one netCDF file, which `load` reads.

        Raises
        ------
        InputError
            If the path is taken and not to be overwritten, or the method makes something that can't
            be written.
        VehiclemorError
            If the file can't be written; then there is none, or the old one.
        """
        return model_file.write(self, path, overwrite)

    def __getstate__(self) -> dict[str, Any]:
        """What a copy takes along: of the training what a file keeps, a maneuver may be local."""
        training = tuple(getattr(scenario, "content", scenario) for scenario in self.training)
        return super().__getstate__() | {"training": training}

    def _samples(self, state: Any, inputs: Any) -> tuple[np.ndarray, np.ndarray, bool]:
        """States and inputs by sample, and whether it is but one."""
        try:
            states = real_array(state)
        except TypeError as error:
            raise InputError(f"state: {error}") from None
        if states.ndim < 2:
            return self._state(state)[None], self._inputs(inputs)[None], True
        states = checked_path(states, self._dim, "states")
        if not len(states):
            raise InputError("states are none: one sample is needed at least")
        return states, checked_path(inputs, len(self.inputs), "inputs", len(states)), False

    def _state(self, state: Any) -> np.ndarray:
        return checked_array(state, self._dim, "state", self._name)

    def _inputs(self, inputs: Any, name: str = "inputs") -> np.ndarray:
        return checked_array(inputs, len(self.model.inputs), name, self._name)

    @cached_property
    def _dim(self) -> int:
        return len(self._stepped.states)

    @cached_property
    def _name(self) -> str:
        return f"{self.model.name} by {self.method}"


def load(path: Any) -> ReducedOrderModel:
    """A reduced model from the file that its `save` has written; nothing is fitted.

    Raises
    ------
    FileError
        If the file is missing, damaged or something else, or does not fit what is installed.
    """
    return ReducedOrderModel(**model_file.read(path))


def rom(model: str) -> ReducedOrderModel:
    """The reduced model of a car, a suspension or a truck that ships with the package.

    It is the one that the model's protocol has chosen for unseen inputs, see `compare()`;
    `InputError` if none ships for a model of this name.
    """
    known = {path.stem: path for path in shipped_folder().glob("*.nc")}
    return load(known[choice("reduced model that ships", model, known)])


def shipped_folder() -> Path:
    """Folder of the models that ship, each under the name of the full model."""
    return data_folder() / "reduced"
