"""Whether a method reduces a model, as far as that is known without deriving the model."""

from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.reduction.interface import never_refused
from vehiclemor.registry import component
from vehiclemor.simulation.build import build_derived

UNKNOWN = "known once the model has been simulated"


def accepts(method_name: str, definition: ModelDefinition) -> tuple[str, str]:
    """`yes`, `no` or `?`, and the reason."""
    method = component("method", method_name)
    by_kind = definition.kind not in method.settings or method.refusal is never_refused
    model = definition if by_kind else build_derived(definition.name)
    if model is None:
        return "?", UNKNOWN
    accepted, reason = method.accepts(model)
    return "yes" if accepted else "no", reason
