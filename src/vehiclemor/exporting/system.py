"""What is exported: a system in straight-line functions, with names, units, values and starts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import version

import numpy as np

from vehiclemor.exporting.straight_line import StraightLine
from vehiclemor.multibody.quantities import Quantity
from vehiclemor.short_repr import ShortRepr

# Who has written it.
TOOL = f"vehiclemor {version('vehiclemor')}"
# Function -> names of its arguments, in order, and of its result.
SIGNATURES = {
    "constants": ("p", "c"),
    "derivative": ("x", "u", "c", "dx"),
    "outputs": ("x", "u", "c", "y"),
}
# Derivatives along seeds of the arguments: what the results change by.
SEED = "_seed"
TANGENTS = {
    f"{name}_tangent": (*given, *(f"{argument}{SEED}" for argument in given), f"{result}_change")
    for name, (*given, result) in SIGNATURES.items()
}
TRUST = Quantity("trust_indicator", "1", "how far it goes: beyond 1 the reduced model isn't known")


@dataclass(frozen=True, eq=False)
class ExportedSystem(ShortRepr):
    """A system x' = f(x, u, c(p)), y = g(x, u, c(p))."""

    repr_fields = ("name", "summary")

    # Of the model, or of the model and the method; one line.
    name: str
    summary: str
    # Quantities in order; of a reduced model nothing is a parameter, its numbers are in the code.
    states: tuple[Quantity, ...]
    inputs: tuple[Quantity, ...]
    outputs: tuple[Quantity, ...]
    parameters: tuple[Quantity, ...]
    values: np.ndarray  # Of the parameters.
    starts: Mapping[str, np.ndarray]  # Name -> state; the default first.
    # `constants` of the array `p`, `derivative` and `outputs` of the arrays `x`, `u` and `c`.
    functions: Mapping[str, StraightLine]
    # Makes the derivatives of these functions, by the same names, see `TANGENTS`.
    tangents: Callable[[], Mapping[str, StraightLine]]
    # What `entry(row, place)` reads, a number at row + place; empty if there is none.
    table: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def sizes(self) -> dict[str, int]:
        """Array -> number of floats."""
        constants = len(self.functions["constants"].results)
        counts = len(self.states), len(self.inputs), constants, len(self.parameters)
        return dict(zip("xucp", counts, strict=True))

    @cached_property
    def acting(self) -> set[int]:
        """Numbers of the parameters that rates or outputs depend on; others shape the start."""
        constants, rates, outputs = (self.functions[name] for name in SIGNATURES)
        used = sorted(rates.read("c") | outputs.read("c"))
        of_these = [constants.results[place] for place in used]
        return StraightLine(constants.operations, of_these).read("p")
