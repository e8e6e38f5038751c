"""Compiled kernels of the high-fidelity vehicle in other coordinates than its own."""

import numpy as np

from vehiclemor.codegen.derivation import Derivation
from vehiclemor.models.definition import ModelDefinition
from vehiclemor.models.high_fidelity.forms import INDEPENDENT
from vehiclemor.registry import component
from vehiclemor.simulation.build import compiled, hoisted_constants, solved_parameters
from vehiclemor.simulation.dynamic import DynamicModel


def independent_kernels(model: DynamicModel) -> tuple[Derivation, np.ndarray]:
    """Kernels over the 14 independent coordinates, and their constants of a ready model."""
    made, _ = compiled(INDEPENDENT.name, INDEPENDENT)
    return made, hoisted_constants(made, model.parameters, free_lengths(model))


def free_lengths(model: DynamicModel) -> list[float]:
    """Free lengths of the springs in m, with which the design position is the equilibrium."""
    definition: ModelDefinition = component("model", model.name)
    values = model.parameters.values()
    solved = solved_parameters(definition, values, model.parameters, model.equations)
    return [solved[name] for name in definition.solved]
