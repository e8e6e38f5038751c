"""Which model the closed forms of this folder are of."""

from vehiclemor.models.high_fidelity.definition import DEFINITION
from vehiclemor.simulation.model import Model


def no_closed_forms(model: Model) -> str:
    """Why a model is not the one whose constraints have been solved by hand."""
    known = DEFINITION.name
    return "" if model.name == known else f"closed forms are known for {known} alone"
