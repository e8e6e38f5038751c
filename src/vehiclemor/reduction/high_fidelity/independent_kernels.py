"""Compiled kernels of the high-fidelity vehicle in other coordinates than its own."""

from typing import TYPE_CHECKING

import numpy as np

from vehiclemor.codegen.derivation import Derivation
from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.registry import component
from vehiclemor.simulation.build import compiled
from vehiclemor.simulation.constants import hoisted_constants, solved_parameters
from vehiclemor.simulation.dynamic import DynamicModel

if TYPE_CHECKING:
    from vehiclemor.symbolic.program import Program


def independent_kernels(model: DynamicModel) -> tuple[Derivation, np.ndarray]:
    """Kernels over the 14 independent coordinates, and their constants of a ready model."""
    made, _ = compiled("high_fidelity_independent", _derive)
    return made, hoisted_constants(made, model.parameters.flat(), free_lengths(model))


def _derive() -> "Program":
    # Imported here: equations that were derived before are read from disk, without SymPy.
    from vehiclemor.multibody.high_fidelity import independent

    return independent.derive()


def free_lengths(model: DynamicModel) -> list[float]:
    """Free lengths of the springs in m, with which the design position is the equilibrium."""
    definition: ModelDefinition = component("model", model.name)
    solved = solved_parameters(definition, model.parameters.flat(), model.equations)
    return [solved[name] for name in definition.solved]
