"""A method as it is declared: settings by kind of model, presets, and the models it accepts."""

from collections.abc import Mapping

from vehiclemor.reduction.interface import Method
from vehiclemor.registry import component, names
from vehiclemor.report.description.acceptance import accepts
from vehiclemor.report.description.schema import rows


def method_description(name: str) -> dict[str, object]:
    """Summary, reference, settings and presets by kind of model, and the models it accepts."""
    method: Method = component("method", name)
    presets = [
        {"preset": preset, "kind": kind, "changes": _changes(values)}
        for kind in method.settings
        for preset, values in method.presets_of(kind).items()
    ]
    models = []
    for model in names("model"):
        accepted, reason = accepts(name, component("model", model))
        models.append({"model": model, "accepted": accepted, "reason": reason})
    settings: dict[str, object] = {}
    for declared in dict.fromkeys(method.settings.values()):
        kinds = [kind for kind, of_kind in method.settings.items() if of_kind is declared]
        settings[f"settings, kind {' and '.join(kinds)}"] = rows(declared.model_json_schema())
    reference = f"doi:{method.reference}" if method.reference else ""
    head = {"method": name, "summary": method.summary, "reference": reference}
    return {**head, **settings, "presets": presets, "models": models}


def _changes(values: Mapping[str, object]) -> str:
    return ", ".join(f"{key}={value}" for key, value in values.items()) or "the defaults"
