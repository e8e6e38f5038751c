"""A model as it is declared, with the values and sources of its parameters."""

from collections.abc import Iterable, Mapping
from pathlib import Path

from vehiclemor.multibody.definition import DESIGN_START, ModelDefinition
from vehiclemor.multibody.quantities import Quantity
from vehiclemor.parameters import ParameterFile, ParameterSet, load_parameters, parameter_path
from vehiclemor.registry import component, names
from vehiclemor.report.description.acceptance import UNKNOWN, accepts
from vehiclemor.report.description.schema import bounds
from vehiclemor.simulation.build import build_derived
from vehiclemor.toml_files import read_toml

KINDS = {
    "ae": "algebraic equations Phi(q; u) = 0",
    "ode": "ordinary differential equations x' = f(x, u)",
    "dae": "differential equations with constraints, stabilised",
}


def model_description(
    name: str, overrides: Mapping[str, object] | None, parameter_file: Path | None
) -> dict[str, object]:
    """Kind, parameters, starts, inputs, outputs and states of a model, and what reduces it."""
    definition: ModelDefinition = component("model", name)
    path = parameter_file or definition.parameter_file or parameter_path(name)
    parameters = load_parameters(name, definition.parameters, path, overrides)
    accepted = {method: accepts(method, definition)[0] for method in names("method")}
    return {
        "model": name,
        "summary": definition.summary,
        "kind": f"{definition.kind}: {KINDS[definition.kind]}",
        "maneuver": definition.maneuver,
        "starts": _starts(definition, parameters),
        "methods": [method for method, answer in accepted.items() if answer == "yes"],
        f"methods that may fit ({UNKNOWN})": [m for m, a in accepted.items() if a == "?"],
        "parameter file": str(path),
        "parameters": _parameters(definition, parameters),
        "sources": [
            {"source": key, "licence": source.licence, "text": source.text}
            for key, source in read_toml(path, ParameterFile).sources.items()
        ],
        "inputs": _quantities(definition.inputs),
        "outputs": _quantities(definition.outputs),
        "coordinates": _quantities(definition.coordinates),
        "speeds": _quantities(definition.speeds),
        "equations": _quantities(definition.equations),
        "constraints": _quantities(definition.constraints),
    }


def _starts(definition: ModelDefinition, parameters: ParameterSet) -> list[str]:
    """Names of the initial conditions, as far as they are known without deriving the model."""
    model = build_derived(definition.name)
    if model is not None:
        return list(model.starts)
    if definition.kind == "ae":
        return [DESIGN_START]
    return [UNKNOWN] if definition.solved else list(definition.starts(parameters.values()))


def _parameters(definition: ModelDefinition, parameters: ParameterSet) -> list[dict[str, object]]:
    return [
        {
            "name": name,
            "value": entry.value,
            "unit": entry.unit,
            "bounds": bounds(declared.above, declared.at_least, declared.at_most),
            "meaning": entry.description,
            "status": entry.status,
            "source": entry.source,
        }
        for (name, declared), entry in zip(
            definition.parameters.items(), parameters.entries.values(), strict=True
        )
    ]


def _quantities(quantities: Iterable[Quantity]) -> list[dict[str, str]]:
    return [{"name": q.name, "unit": q.unit, "meaning": q.long_name} for q in quantities]
