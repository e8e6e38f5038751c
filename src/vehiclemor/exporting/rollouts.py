"""Many runs at once by fixed steps, in this process."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from vehiclemor.arguments import loop_array, number, real_array, within
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.loops import loops
from vehiclemor.codegen.operations import LANES, Kernel, Listing
from vehiclemor.exceptions import InputError
from vehiclemor.exporting import rollout_loops
from vehiclemor.exporting.ros2 import solve_function
from vehiclemor.exporting.straight_line import FUNCTIONS, OPERATORS, StraightLine, evaluated
from vehiclemor.exporting.systems import ExportedSystem
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.evaluation import address_of

ROLLOUT_LOOPS = ("exporting.rollout_loops",)
# Arrays of functions -> arguments of kernels.
ARGUMENTS = {"x": "_x", "u": "_u", "r": "_u", "c": "_constants"}
# Shortest and longest time between samples of inputs, in s.
PERIODS = 1e-6, 3600.0


class Rollouts(ShortRepr):
    """Many runs of a system by fixed steps, as a function.

    Nothing is judged: a run that diverges is not a number from there on, and no limit of validity
    is watched.

    Attributes
    ----------
    name, outputs
        Of the system.
    step
        Longest step in s.
    """

    repr_fields = ("name", "outputs", "step")

    def __init__(self, system: ExportedSystem, step: float, integrator: str) -> None:
        if system.dynamics is None:
            raise InputError(f"{system.name} has no states: `simulate_many` runs it")
        self.name, self.step = system.name, step
        self.outputs = tuple(quantity.name for quantity in system.outputs)
        self._states, self._inputs = len(system.states), len(system.inputs)
        dynamics = self._dynamics = system.dynamics
        sizes = system.sizes | {"r": len(system.states)}
        functions = {"few_outputs": system.functions["outputs"]}
        if integrator == "ros2":
            functions["solve"] = solve_function(system, step)
        kernels = Kernels(lane_kernel(name, f, sizes) for name, f in functions.items())
        addresses = [address_of(dynamics.kernels, "derivative", LANES)]
        addresses += [kernels.address(name, LANES) for name in ("few_outputs", "solve")]
        self._addresses = np.array(addresses, dtype=np.int64)

    def __call__(self, states: Any, inputs: Any, period: float) -> np.ndarray:
        """Outputs (runs, samples, outputs) at the samples of the inputs.

        Parameters
        ----------
        states
            Of the model as `state` and `step` give them: (n,) for all runs, or (runs, n).
        inputs
            (runs, samples) of a model with one input, else (runs, samples, inputs); SI units,
            linear between samples.
        period
            Time in s between samples; it takes the fewest equal steps that are short enough.

        Raises
        ------
        InputError
            If an argument is wrong.
        """
        period = within("period", number("period", period), PERIODS, " s")
        inputs = self._array(inputs, "inputs")
        if inputs.ndim == 2 and self._inputs == 1:
            inputs = inputs[:, :, None]
        if inputs.ndim != 3 or inputs.shape[2] != self._inputs or not inputs.size:
            wanted = f"(runs, samples, {self._inputs})"
            raise InputError(f"inputs have shape {inputs.shape}, {self.name} needs {wanted}")
        runs, samples, _ = inputs.shape
        states = self._array(states, "states")
        if states.shape not in ((self._states,), (runs, self._states)):
            wanted = f"({self._states},) or ({runs}, {self._states})"
            raise InputError(f"states have shape {states.shape}, {self.name} needs {wanted}")
        # Kernels take no fewer runs.
        rows = np.resize(np.arange(runs), max(runs, LANES))
        states = np.broadcast_to(states, (runs, self._states))[rows]
        results = np.empty((len(rows), samples, len(self.outputs)))
        widest = max(self._states, self._inputs, len(self.outputs))
        steps = max(math.ceil(period / self.step - 1e-9), 1)
        loops(ROLLOUT_LOOPS, ("rollouts",))["rollouts"](
            states,
            loop_array(inputs[rows]),
            self._addresses,
            self._dynamics.constants,
            period,
            steps,
            np.zeros((rollout_loops.VECTORS, LANES, widest)),
            results,
        )
        return results[:runs]

    def __getstate__(self) -> dict[str, Any]:
        """None: machine code has addresses, which a copy must not share."""
        raise InputError("rollouts can't be copied: export the model in each process")

    def _array(self, given: Any, name: str) -> np.ndarray:
        try:
            array = real_array(given)
        except TypeError as error:
            raise InputError(f"{name}: {error}") from None
        if not np.isfinite(array).all():
            raise InputError(f"{name} are not finite")
        return array


def lane_kernel(name: str, function: StraightLine, sizes: Mapping[str, int]) -> Kernel:
    """A function of a system as a kernel; sizes are those of its arrays."""
    listing = Listing()
    arrays = {}
    for array, argument in ARGUMENTS.items():
        arrays[array] = [listing.entry(argument, i) for i in range(sizes[array])]
    kinds = *OPERATORS, *FUNCTIONS, "select"
    functions: dict[str, Any] = {kind: partial(listing.new, kind) for kind in kinds}
    for part, kind in enumerate(("sin", "cos")):
        functions[kind] = lambda a, part=part: listing.parts(listing.new("sincos", a), 2)[part]
    functions["max"] = lambda a, b: listing.new("select", listing.new(">=", a, b), a, b)
    for index, value in enumerate(evaluated(function, arrays, functions)):
        listing.store(index, value)
    return listing.kernel(name, [*dict.fromkeys(ARGUMENTS.values()), "_result"])
