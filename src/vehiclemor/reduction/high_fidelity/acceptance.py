"""Which model the closed forms of this folder are of."""

from vehiclemor.models.high_fidelity.definition import NAME
from vehiclemor.simulation.model import Model


def has_closed_forms(model: Model) -> tuple[bool, str]:
    """Whether a model is the one whose constraints have been solved by hand."""
    return model.name == NAME, f"closed forms are known for {NAME} alone"
