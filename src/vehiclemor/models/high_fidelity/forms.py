"""Other forms of the high-fidelity vehicle's equations, derived when they are first asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from vehiclemor.models.equations import DynamicEquations


class Form(NamedTuple):
    """Equations in other coordinates, under a name of their own; the parameters are the model's.

    Attributes
    ----------
    derive
        Derives the equations; parameters, and constants if there are more, stay symbols.
    """

    name: str
    derive: Callable[[], DynamicEquations]


def _independent() -> DynamicEquations:
    from vehiclemor.models.high_fidelity import independent

    return independent.derive()


def _frozen_inertia() -> DynamicEquations:
    from vehiclemor.models.high_fidelity import frozen_inertia

    return frozen_inertia.derive()


# Exact, in 14 coordinates; and these with the inertia of the design position.
INDEPENDENT = Form("high_fidelity_independent", _independent)
FROZEN_INERTIA = Form("high_fidelity_frozen_inertia", _frozen_inertia)
