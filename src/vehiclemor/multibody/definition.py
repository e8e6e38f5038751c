"""What a model is, in one declaration: built-in models and plug-ins are instances of one class."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.arguments import line_of_text, quoted
from vehiclemor.exceptions import InputError, did_you_mean
from vehiclemor.multibody.quantities import (
    DEFAULTS,
    ErrorBound,
    InputChoice,
    Quantity,
    integral_of,
)
from vehiclemor.parameters import Declared
from vehiclemor.short_repr import ShortRepr

if TYPE_CHECKING:
    from vehiclemor.symbolic.program import Program

    # Of SciPy's arrays no types are known.
    csc_array = Any

# Algebraic equations; ordinary differential equations; those with constraints; sparse matrices.
KINDS = ("ae", "ode", "dae", "structural")
# Quantities that are states, in their order.
STATE_KINDS = ("coordinates", "speeds", "further_states")
# A mechanism without forces has no equilibrium to find: the name stands for its design position,
# so that studies can name the same start for every kind of model.
DESIGN_START = "equilibrium"
# Values of the parameters by name: scalars as floats, points as arrays (3,).
Values = Mapping[str, Any]
# Values of the solved parameters, state (2 n,), inputs -> time derivative (2 n,) of the state.
Derivative = Callable[[list[float], np.ndarray, np.ndarray], np.ndarray]


def _unset(values: Values) -> Any:
    raise NotImplementedError(f"not declared for this kind of model: {sorted(values)}")


def _nothing_to_check(values: Values) -> None:
    del values


def _nothing_solved(values: Values, derivative: Derivative) -> dict[str, float]:
    del values, derivative
    return {}


@dataclass(frozen=True, eq=False)
class Structure:
    """Matrices of a structure with n coordinates, p ports and some outputs.

        M q'' + (W W' + d K) q' + K q = load + B f(w, w', u),   w = B' q

    Springs, dampers and tires act between few points.  Their forces f are the law of the ports,
    which is declared as other equations are.  Outputs are those of the motion about the static
    state, but for the forces: y = Cq (q - q0) + Cv q' + Ca q'' + Cf f.
    """

    # M and K (n, n), symmetric; K without what acts at the ports.
    mass: csc_array
    stiffness: csc_array
    damping_time: float  # d in s, of damping that is proportional to K.
    # W (n, k): few linear dampers, by their deflections times the root of their rates.
    dampers: csc_array
    ports: csc_array  # B (n, p): deflections of the ports are w = B' q.
    load: np.ndarray  # Weight (n,) in N and N m.
    # Cq, Cv, Ca (outputs, n) and Cf (outputs, p).
    outputs: tuple[csc_array, csc_array, csc_array, csc_array]

    def with_port_springs(self, stiffness: np.ndarray) -> csc_array:
        """K (n, n) with springs of these stiffnesses (p,) at the ports."""
        return self.stiffness + self.ports @ (stiffness[:, None] * self.ports.T)

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return len(self.load)


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelDefinition(ShortRepr):
    """Declaration of a model; its entry point names an instance.

    It holds no symbols: `derive` imports what it needs when it is called, so that a model that was
    derived before starts without SymPy.

    Attributes
    ----------
    name, kind, summary
        Registered name; `ae`, `ode`, `dae` (constraints stabilised) or `structural`; one line.
    maneuver
        Name of the nominal maneuver.
    coordinates, speeds, inputs, outputs
        Quantities in order; inputs are those of every run.  A state is the coordinates and, after
        them, as many speeds; models of kind `ae` have no speeds.  Coordinates of a structure have
        no names: there are none.
    further_states
        States of first order, which follow the speeds (kind `ode`).
    equations
        Residual equations with their units (kind `ae`).
    constraints
        Constraints with their units (kind `dae`).
    ports
        Deflections of the ports with their units (kind `structural`).
    structure
        Parameters -> matrices (kind `structural`).
    online
        Parameters that may differ between runs of one reduced model, which keeps its basis then
        (kind `structural`).
    parameters
        Name -> unit, size and bounds.
    parameter_file
        Values with their sources; the package's own data by default.
    joints
        Names of the moving points and directions that the function `joints` returns (kind `ae`).
    optional_inputs
        Inputs with defaults.  A run that names them drives them: they follow the others then.
    choice
        Which of these are driven, and which are parameters; see `driving`.
    derive
        Derives the program of the equations; parameters stay symbols.  With optional inputs it is
        a function of the choice, whose default is `DEFAULTS`.
    check
        Raises `GeometryError` where no such vehicle can exist.
    design_coordinates
        Parameters -> coordinates (n,) at which all inputs are zero (kind `ae`).
    travel_limit
        Wheel travel in m up to which the limits of reach are looked for (kind `ae`).
    stops
        Coordinate -> largest magnitude in its unit that the mechanism may reach (kind `ae`).
    starts
        Parameters and what was solved -> initial states (2 n,) by name, the default first (`ode`
        and `dae`).
    solved
        Names of kernel parameters that an equilibrium determines; they follow the declared ones.
    solve_equilibrium
        (parameters, derivative) -> values of `solved`, and of what else `starts` needs.
    cyclic
        States that the right-hand side does not depend on.
    planar
        Position on the road (two names) and heading: all else moves alike wherever the vehicle is.
    heading_pairs
        Pairs of states that are components in space: they turn with the heading, and so does a
        frozen Jacobian.  Empty where the states are components in the vehicle.
    error_scale
        State -> magnitude in its unit below which its errors count absolutely, 1 by default.
    validity
        Output or input -> (smallest, largest) value in its unit at which the model means anything.
        A run that leaves that of an output has diverged, an input beyond its range is refused.
    standstill
        Outputs that are the forward and the lateral speed: where the first falls below its range
        and the second is as small, the vehicle has stopped, and the run has not diverged.
    loads
        Outputs that are zero where a wheel has left the road.
    slips
        Outputs that are the slip ratios of the wheels.
    error_bounds
        Output -> bound by which reduced models judge their runs.
    wheelbase
        Parameters -> distance of the axles in m, of a vehicle.
    tabled_outputs
        Outputs whose errors are listed in tables, all by default.
    main_outputs
        Those of them that are printed beside the times and drawn, by default the first three.

    Raises
    ------
    InputError
        If the declaration contradicts itself.

    Notes
    -----
    The program of kind `ae` has functions over `q` (n) and `u`: `residual` (n), `residual_jacobian`
    (n x (n + 1): Jacobian, then residual), `newton_step` (n), `outputs`, and `joints` (points x 3).

    That of the other kinds has functions over `x` (2 n) and `u`: `derivative` (2 n) and `outputs`;
    further states follow in both.  Mechanical models without further states have also
    `second_order` (n x (n + 1): mass matrix M and forces F of M q'' = F in the coordinates, forces
    of constraints included), and `speeds` (n: the speeds where x holds the rates of the coordinates
    in their place).  Models with c constraints have `descriptor` ((n + c) x (n + 1): mass matrix
    and applied forces, less inertial ones, below them Jacobian and right side of the stabilised
    constraints on q'') and `violations` (c x 2: constraints and their rates).
    """

    repr_fields = ("name", "kind", "summary")

    name: str
    kind: str
    summary: str
    maneuver: str
    coordinates: tuple[Quantity, ...]
    inputs: tuple[Quantity, ...]
    outputs: tuple[Quantity, ...]
    parameters: Mapping[str, Declared]
    derive: Callable[..., Program]
    optional_inputs: tuple[Quantity, ...] = ()
    choice: InputChoice = DEFAULTS
    speeds: tuple[Quantity, ...] = ()
    further_states: tuple[Quantity, ...] = ()
    equations: tuple[Quantity, ...] = ()
    joints: tuple[str, ...] = ()
    constraints: tuple[Quantity, ...] = ()
    ports: tuple[Quantity, ...] = ()
    structure: Callable[[Values], Structure] = _unset
    online: tuple[str, ...] = ()
    parameter_file: Path | None = None
    check: Callable[[Values], None] = _nothing_to_check
    design_coordinates: Callable[[Values], np.ndarray] = _unset
    travel_limit: float = 0.5
    stops: Mapping[str, float] = field(default_factory=dict)
    starts: Callable[[Values], dict[str, np.ndarray]] = _unset
    solved: tuple[str, ...] = ()
    solve_equilibrium: Callable[[Values, Derivative], dict[str, float]] = _nothing_solved
    cyclic: tuple[str, ...] = ()
    planar: tuple[str, ...] = ()
    heading_pairs: tuple[tuple[str, str], ...] = ()
    error_scale: Mapping[str, float] = field(default_factory=dict)
    validity: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    standstill: tuple[str, ...] = ()
    loads: tuple[str, ...] = ()
    slips: tuple[str, ...] = ()
    error_bounds: Mapping[str, ErrorBound] = field(default_factory=dict)
    wheelbase: Callable[[Values], float] | None = None
    tabled_outputs: tuple[str, ...] = ()
    main_outputs: tuple[str, ...] = ()

    @cached_property
    def states(self) -> tuple[str, ...]:
        """Names of the coordinates and, after them, of the speeds and of further states."""
        return tuple(quantity.name for quantity in self.state_quantities)

    @property
    def state_quantities(self) -> tuple[Quantity, ...]:
        """Coordinates, speeds and further states."""
        return (*self.coordinates, *self.speeds, *self.further_states)

    def __post_init__(self) -> None:
        """Refuse what contradicts itself, so that a plug-in's author reads one clear line."""
        for text in ("name", "summary"):
            line_of_text(f"{text} of a model", getattr(self, text))
        self._require(self.kind in KINDS, f" is of kind {self.kind!r}; allowed: {', '.join(KINDS)}")
        for kind in (*STATE_KINDS, "inputs", "optional_inputs", "outputs"):
            quantities = getattr(self, kind)
            have_units = all(isinstance(quantity, Quantity) for quantity in quantities)
            self._require(have_units, f": {kind} must be quantities with units")
            names = [quantity.name for quantity in quantities]
            optional = kind in ("speeds", "further_states", "optional_inputs") or (
                kind == "coordinates" and self.kind == "structural"
            )
            complete = len(set(names)) == len(names) and bool(names or optional)
            self._require(complete, f": {kind} are missing or named twice: {names}")
        self._check_optional_inputs()
        for name, declared in self.parameters.items():
            has_unit = isinstance(declared, Declared)
            self._require(has_unit, f": parameter {name!r} is not declared by a unit")
        of_kind, n, speeds = f" of kind {self.kind}", len(self.coordinates), len(self.speeds)
        needed = {"ae": "design_coordinates", "structural": "structure"}.get(self.kind, "starts")
        self._require(getattr(self, needed) is not _unset, f"{of_kind} declares no {needed}")
        expected = 0 if self.kind == "ae" else n
        counts = f"{n} coordinates and {speeds} speeds, not {expected}"
        self._require(speeds == expected, f"{of_kind} has {counts}")
        allowed = self.kind == "ode" or not self.further_states
        self._require(allowed, f"{of_kind} has further_states; only kind ode has any")
        has_heading = len(self.planar) == 3 or not self.heading_pairs
        self._require(has_heading, " has heading_pairs, but no heading in planar")
        outputs = {q.name for q in self.outputs}
        self._known("stops", self.stops, (q.name for q in self.coordinates))
        self._known("cyclic", self.cyclic, self.states)
        self._known("planar", self.planar, self.states)
        self._known("heading_pairs", (n for pair in self.heading_pairs for n in pair), self.states)
        self._known("error_scale", self.error_scale, self.states)
        self._known("online", self.online, self.parameters)
        inputs = {q.name for q in (*self.inputs, *self.optional_inputs)}
        self._known("validity", self.validity, outputs | inputs)
        self._known("standstill", self.standstill, outputs)
        self._known("loads", self.loads, outputs)
        self._known("slips", self.slips, outputs)
        self._known("error_bounds", self.error_bounds, outputs)
        self._known("tabled_outputs", self.tabled_outputs, outputs)
        self._known("main_outputs", self.main_outputs, self.tabled_outputs or outputs)

    def _check_optional_inputs(self) -> None:
        """Refuse optional inputs without a default, and names that stand for something else."""
        chosen = {*self.choice.driven, *self.choice.constant}
        taken = {*self.parameters, *(q.name for q in self.inputs)} - chosen
        for name, default in ((q.name, q.default) for q in self.optional_inputs):
            has_default = default is not None and math.isfinite(default)
            self._require(has_default, f": the optional input {name!r} has no default")
            twice = f": {name!r} is an optional input and another one, or a parameter"
            self._require(name not in taken, twice)

    def _known(self, where: str, names: Iterable[str], known: Iterable[str]) -> None:
        allowed = set(known)
        for name in names:
            if name not in allowed:
                hint = did_you_mean(name, allowed)
                raise InputError(f"model {self.name!r}: {where} names {name!r}; {hint}")

    def _require(self, fits: bool, what: str) -> None:
        if not fits:
            raise InputError(f"model {self.name!r}{what}")


# --- optional inputs: which ones a run drives, which ones are parameters instead ------------------


def driving(definition: ModelDefinition, names: Iterable[str]) -> ModelDefinition:
    """The declaration with the optional inputs among these names as inputs too.

    With the height of a road its rate is driven.  An input that was a parameter is driven then.
    """
    named = {*names}
    driven = {*definition.choice.driven, *named}
    driven |= {q.name for q in definition.optional_inputs if integral_of(q.name) in named}
    return _with_choice(definition, driven, {*definition.choice.constant} - driven)


def with_overrides(definition: ModelDefinition, overrides: Mapping[str, object]) -> ModelDefinition:
    """The declaration in which each optional input with a value here is a parameter."""
    if not isinstance(overrides, Mapping):
        raise InputError(f"parameters must be a mapping of values by name, not {quoted(overrides)}")
    names = {quantity.name for quantity in definition.optional_inputs}
    return with_constants(definition, names.intersection(overrides))


def with_constants(definition: ModelDefinition, names: Iterable[str]) -> ModelDefinition:
    """The declaration with optional inputs as parameters; `InputError` if there is none such."""
    optional = {quantity.name for quantity in definition.optional_inputs}
    for name in names:
        if name not in optional:
            hint = did_you_mean(name, optional)
            raise InputError(f"{name!r} is not an optional input of {definition.name}; {hint}")
    constant = {*definition.choice.constant, *names}
    return _with_choice(definition, {*definition.choice.driven} - constant, constant)


def _with_choice(
    definition: ModelDefinition, driven: set[str], constant: set[str]
) -> ModelDefinition:
    names = [quantity.name for quantity in definition.optional_inputs]
    ordered = (tuple(n for n in names if n in chosen) for chosen in (driven, constant))
    return _chosen(definition, InputChoice(*ordered))


@lru_cache(maxsize=64)
def _chosen(definition: ModelDefinition, choice: InputChoice) -> ModelDefinition:
    """The declaration of a choice; the same object for the same arguments, as caches need it."""
    if choice == definition.choice:
        return definition
    optional = {quantity.name: quantity for quantity in definition.optional_inputs}
    every_run = (quantity for quantity in definition.inputs if quantity.name not in optional)
    parameters = {
        name: declared for name, declared in definition.parameters.items() if name not in optional
    }
    for name in choice.constant:
        low, high = definition.validity.get(name, (None, None))
        quantity = optional[name]
        parameters[name] = Declared(
            quantity.unit, at_least=low, at_most=high, default=quantity.default
        )
    return replace(
        definition,
        inputs=(*every_run, *(optional[name] for name in choice.driven)),
        parameters=parameters,
        choice=choice,
    )
