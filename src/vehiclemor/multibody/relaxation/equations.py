"""Equations of the vehicle with relaxation: those of the 14-DOF vehicle by another law of slip."""

from functools import partial

from vehiclemor.multibody.components import body
from vehiclemor.multibody.components.slip import relaxed_slip
from vehiclemor.multibody.independent_suspension.equations import derive_with
from vehiclemor.multibody.quantities import DEFAULTS, InputChoice
from vehiclemor.multibody.relaxation.definition import DEFINITION
from vehiclemor.symbolic.program import Program


def derive(choice: InputChoice = DEFAULTS) -> Program:
    """Derive state derivatives and outputs; parameters stay symbols."""
    states = body.symbols(DEFINITION.further_states)
    wheels = zip(states[:4], states[4:], strict=True)
    laws = [partial(relaxed_slip, deflections=deflections) for deflections in wheels]
    return derive_with(choice, DEFINITION.parameters, laws, states)
