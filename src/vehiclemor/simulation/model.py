"""What every model that is ready to run offers, whatever its kind."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from vehiclemor.codegen.kernels import BareKernel, Kernels
from vehiclemor.exceptions import InputError
from vehiclemor.inputs.columns import listed
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.inputs.maneuver import registered
from vehiclemor.multibody.definition import ModelDefinition, driving
from vehiclemor.parameters import ParameterSet
from vehiclemor.registry import choice
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.checks import checked_array
from vehiclemor.simulation.evaluation import (
    CONSTANTS,
    PLACES,
    By,
    at_samples,
    components,
    constant_derivatives,
    directional,
    parameter_names,
    partial,
    solved_parameters,
)
from vehiclemor.simulation.trajectory import COUNTS, EVALUATIONS, Names, Start, Trajectory

NEEDED_FOR = {
    "second_order": "equations of motion can't be projected in the coordinates, nor weighed by "
    "energy",
    "speeds": "rates of the coordinates can't be turned into speeds",
    "descriptor": "there are no equations before elimination",
    "violations": "there are no constraints",
}


@dataclass(frozen=True, eq=False)
class Model(ShortRepr):
    """A model with one parameter set, as studies, methods and reports see it.

    A state is the coordinates and, after them, the speeds and further states; kinematic models have
    coordinates alone.

    Attributes
    ----------
    definition, equations, parameters
        What was declared of it, what was derived, its validated parameter set.
    kernel_hash
        Hash of the source of kernels and loops, whatever compiles it.
    constants
        Hoisted constants of the parameter set.
    initial
        Start -> state (n,); the default first.
    rebuilt
        (model, declaration) -> the model with another choice of inputs, cached.
    """

    repr_fields = ("name", "kind", "coordinates", "inputs", "outputs", "starts")
    loops: ClassVar[Sequence[str]]  # Modules of the loops that run it.
    reference: ClassVar[tuple[str, float]]  # Solver and tolerance by default.

    definition: ModelDefinition
    equations: Kernels
    parameters: ParameterSet
    kernel_hash: str
    constants: np.ndarray
    initial: Mapping[str, np.ndarray]
    rebuilt: Callable[[Any, ModelDefinition], Any]

    def __post_init__(self) -> None:
        """Methods share it: what a plug-in writes into it is refused."""
        for array in (self.constants, *self.initial.values()):
            array.flags.writeable = False

    @property
    def name(self) -> str:
        """Registered name."""
        return self.definition.name

    @property
    def summary(self) -> str:
        """One line."""
        return self.definition.summary

    @property
    def kind(self) -> str:
        """One of `KINDS`."""
        return self.definition.kind

    @cached_property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return tuple(q.name for q in self.definition.coordinates)

    @cached_property
    def speeds(self) -> tuple[str, ...]:
        """Names of the speeds."""
        return tuple(q.name for q in self.definition.speeds)

    @cached_property
    def further_states(self) -> tuple[str, ...]:
        """Names of the states of first order behind the speeds."""
        return tuple(q.name for q in self.definition.further_states)

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return tuple(q.name for q in self.definition.inputs)

    @cached_property
    def inputs_at_rest(self) -> np.ndarray:
        """Inputs (number of inputs,) of a run that drives nothing: their defaults, else 0."""
        return np.array([quantity.default or 0.0 for quantity in self.definition.inputs])

    @cached_property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(q.name for q in self.definition.outputs)

    @cached_property
    def parameter_values(self) -> np.ndarray:
        """All components of the parameters, then what was solved for: `p` of what is exported."""
        flat = self.parameters.flat()
        solved = solved_parameters(self.definition, flat, self.equations)
        values = np.append(flat, [solved[name] for name in self.definition.solved])
        values.flags.writeable = False
        return values

    @property
    def starts(self) -> tuple[str, ...]:
        """Names of the initial conditions, the default first."""
        return tuple(self.initial)

    @property
    def counts(self) -> Mapping[str, str]:
        """What its solvers count: name -> meaning."""
        return COUNTS[self.kind]

    @property
    def evaluations(self) -> str:
        """Name of the count that tells how often its equations were evaluated."""
        return EVALUATIONS[self.kind]

    @property
    def operation_counts(self) -> dict[str, dict[str, int]]:
        """Operations of each generated function, by kind and in total."""
        return self.equations.operations

    @property
    def kernels(self) -> Kernels:
        """Kernels of the equations, each compiled when it is first used."""
        return self.equations

    @cached_property
    def _undriven(self) -> frozenset[str]:
        """Names of optional inputs that no run of this model drives."""
        optional = (quantity.name for quantity in self.definition.optional_inputs)
        return frozenset(optional).difference(self.inputs)

    @cached_property
    def _driven_models(self) -> dict[tuple[str, ...], Any]:
        # To look one up for each run would take as long as a step.
        return {}

    def driving(self, names: str | Sequence[str]) -> Self:
        """The model whose runs drive the optional inputs among these names too, cached."""
        names = listed(names)
        for name in names:
            choice("input", name, (*self.inputs, *self._undriven))
        return self._with_driven(names)

    def driven_as(self, other: Model) -> Self:
        """The model whose runs drive the optional inputs that those of another one drive."""
        return self._with_driven(other.inputs)

    def _with_driven(self, names: Sequence[str]) -> Self:
        if self._undriven.isdisjoint(names):
            return self
        return self.rebuilt(self, driving(self.definition, names))

    def driven_by(self, maneuver: Any) -> Self:
        """The model that also has the optional inputs of a maneuver, or of one of this name."""
        if not self._undriven:
            return self
        if isinstance(maneuver, str):
            maneuver = registered(maneuver)
        if not isinstance(maneuver, Excitation):
            return self
        names = maneuver.inputs
        if names not in self._driven_models:
            self._driven_models[names] = self._with_driven(names)
        return self._driven_models[names]

    def start(self, name: Start | None = None) -> np.ndarray:
        """State (n,) of an initial condition, the first by default, or a copy of the one given."""
        if not isinstance(name, str | None):
            return self._state(name, "start").copy()
        name = self.starts[0] if name is None else choice("start", name, self.initial)
        return self.initial[name].copy()

    @abstractmethod
    def simulate(
        self,
        maneuver: Excitation,
        start: Start | None = None,
        times: np.ndarray | None = None,
        solver: str | None = None,
        tolerance: float | None = None,
        outputs: Names = None,
    ) -> Trajectory:
        """Full-order solution; where None, the model's first start, output times and defaults.

        Parameters
        ----------
        maneuver
            Its inputs are the model's.
        start
            Named initial condition, or a state (n,) of a model of motion.
        times
            Increasing times (samples,) in s; of a structure some of the maneuver's output times.
        solver
            Of kinematic models `newton`: fresh Jacobians, generated elimination, started at the
            previous sample; `newton_lanes`: started at a quadratic extrapolation, the samples in
            vector lanes, and `newton` where that fails.  Of structures `generalised_alpha`.  Of
            others one of the integrators: `dopri5`, Dormand-Prince 5(4), the default; `rodas4`,
            Rosenbrock method of order 4, a fresh Jacobian in every step; `etdrk4`, exponential
            Runge-Kutta method of order 4 with one Jacobian, that of straight running, for all runs
            of similar models.
        tolerance
            Largest component of the last step of an iteration (rad or m), 1e-12 by default; of
            structures largest error of an output by the step size, as part of the output's range;
            else largest local error of a state relative to its typical size plus its magnitude.
        outputs
            Names of outputs, coordinates or speeds to keep, see `Trajectory.chosen`.
        longest_step, begin
            Of models of kind `ode` or `dae` alone, in s: the longest step, unlimited by default,
            and when the run begins with the start, in mid-maneuver if not at 0.

        Raises
        ------
        InputError
            If an argument is wrong, or an input isn't finite or leaves the range of validity.
        UnreachableError
            If a mechanism can't reach a height; the reachable range is named.
        ConvergenceError
            If the solution fails, or leaves the model's range of validity.
        """

    def outputs_at(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Outputs (samples, number of outputs) along a path of states and inputs."""
        return self.values_at("outputs", states, inputs, finite=True)

    def values_at(
        self, function: str, states: np.ndarray, inputs: np.ndarray, finite: bool = False
    ) -> np.ndarray:
        """Results (samples, size) of a function of the equations along a path."""
        self.require(function)
        sizes = len(self.definition.states), len(self.inputs), self.equations.shapes[function][0]
        return at_samples(self.kernels, function, self.constants, (states, inputs), sizes, finite)

    def jacobian(self, state: Any, u: Any, with_respect_to: By = "state") -> np.ndarray:
        """Analytic derivatives (results, columns) at a state and inputs; at a kink on one side.

        Parameters
        ----------
        with_respect_to
            `state`, `inputs`, or names of parameters: a column for each component of each, in
            order, of models with other values of it.

        Raises
        ------
        InputError
            If an argument is wrong, or the derivatives aren't finite.
        """
        del state, u, with_respect_to
        raise InputError(f"{self.name} has no named states; reduce it for Jacobians")

    def require(self, *functions: str) -> None:
        """Raise `InputError` if the model's equations lack one of these functions."""
        for name in functions:
            if (name := str(name)) not in self.equations.shapes:
                needed = NEEDED_FOR.get(name, f"it has {', '.join(self.equations.shapes)}")
                raise InputError(f"{self.name} has no {name}: {needed}")

    def evaluated(self, function: str, state: Any, u: Any) -> np.ndarray:
        """Result of a function of the equations at a state (n,) and inputs, or `InputError`."""
        self.require(function)
        result = np.empty(self.equations.shapes[function])
        state, u = self._state(state, "q" if self.kind == "ae" else "x"), self._inputs(u)
        self.kernels.call(function, state, u, self.constants, result)
        return result

    def bare(self, function: str) -> BareKernel:
        """`rhs`, `outputs` or another function for integrators of others, see `BareKernel`."""
        function = "derivative" if str(function) == "rhs" else function
        self.require(function)
        return self.kernels.bare(function, self.constants)

    def jacobian_of(self, function: str, state: Any, u: Any, by: By) -> np.ndarray:
        """Analytic derivatives of a function of the equations, see `jacobian`.

        `InputError` if an argument is wrong, or the derivatives aren't finite.
        """
        self.require(function)
        names, size = parameter_names(by), math.prod(self.equations.shapes[function])
        state, u = self._state(state, "q" if self.kind == "ae" else "x"), self._inputs(u)
        arrays = state, u, self.constants
        if names:
            directions = self.constant_derivatives(names)
            derivatives = directional(self.kernels, function, arrays, size, CONSTANTS, directions).T
        else:
            assert isinstance(by, str)
            derivatives = partial(self.kernels, function, arrays, size, PLACES[by])
        if not np.isfinite(derivatives).all():
            raise InputError(f"the derivatives of {self.name} are not finite at this state")
        return derivatives

    def constant_derivatives(self, names: Sequence[str]) -> np.ndarray:
        """Derivatives (components, constants) of the constants by parameters, cached."""
        for name in names:
            if name not in self._constant_derivatives:
                numbers = components(self.definition, name)
                arguments = self.definition, self.equations, self.parameter_values, numbers
                self._constant_derivatives[name] = constant_derivatives(*arguments)
        return np.concatenate([self._constant_derivatives[name] for name in names])

    @cached_property
    def _constant_derivatives(self) -> dict[str, np.ndarray]:
        return {}

    def _state(self, state: Any, name: str) -> np.ndarray:
        return checked_array(state, len(self.definition.states), name, self.name)

    def _inputs(self, u: Any) -> np.ndarray:
        return checked_array(u, len(self.inputs), "u", self.name)
