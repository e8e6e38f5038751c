"""What a name stands for: model, method, maneuver, study, or the schema of a file."""

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from vehiclemor.files import data_names
from vehiclemor.inputs.excitation import FACTORS
from vehiclemor.multibody.definition import DESIGN_START, STATE_KINDS, ModelDefinition
from vehiclemor.parameters import ParameterFile, load_parameters, parameter_path
from vehiclemor.reduction.interface import never_refused
from vehiclemor.reduction.model_file import training_of
from vehiclemor.reduction.reduced_model import shipped_folder
from vehiclemor.registry import component, names, unknown
from vehiclemor.simulation.build import build_derived
from vehiclemor.study.plans.loading import is_study, load_studies, study_path
from vehiclemor.study.plans.study_file import CollectionFile, GridFile, ProtocolFile
from vehiclemor.toml_files import read_toml

Description = dict[str, Any]
# Name -> what its tables are of -> class that reads such a file.
SCHEMAS: dict[str, dict[str, type[BaseModel]]] = {
    "study-schema": {
        f"keys of {schema.kind}": schema for schema in (GridFile, ProtocolFile, CollectionFile)
    },
    "parameter-schema": {"keys": ParameterFile},
}
TYPES = {"string": "text", "boolean": "true or false", "array": "list", "object": "table"}
KINDS = {
    "ae": "algebraic equations Phi(q; u) = 0",
    "ode": "ordinary differential equations x' = f(x, u)",
    "dae": "differential equations with constraints, stabilised",
    "structural": "sparse matrices M q'' + D q' + K q, and forces at ports",
}
UNKNOWN = "known once the model has been simulated"
QUANTITIES = ("inputs", "optional_inputs", "outputs", *STATE_KINDS)
QUANTITIES += ("equations", "constraints", "ports")


def description(name: str) -> Description:
    """What a name stands for; lists of dictionaries are the rows of tables."""
    known = {
        **dict.fromkeys(names("model"), _model),
        **dict.fromkeys(names("method"), _method),
        **dict.fromkeys(names("maneuver"), _maneuver),
        **dict.fromkeys(data_names("studies"), _study),
        **dict.fromkeys(SCHEMAS, schema_description),
    }
    known |= {name: _maneuver} if name.partition(":")[0] in names("maneuver") else {}
    describe = _study if is_study(name) else known.get(name)
    if describe is None:
        raise unknown("name", name, known)
    return describe(name)


def _model(name: str) -> Description:
    """Kind, parameters, starts, inputs, outputs and states of a model, and what reduces it."""
    definition: ModelDefinition = component("model", name)
    path = definition.parameter_file or parameter_path(name)
    parameters = load_parameters(name, definition.parameters, path)
    accepted = {method: _accepts(method, definition)[0] for method in names("method")}
    # Initial conditions, as far as they are known without deriving the model.
    if model := build_derived(name):
        starts = list(model.starts)
    elif definition.kind in ("ae", "structural"):
        starts = [DESIGN_START]
    else:
        starts = [UNKNOWN] if definition.solved else list(definition.starts(parameters.values()))
    shipped, file = {}, shipped_folder() / f"{name}.nc"
    if file.exists():
        shipped["reduced model that ships"] = training_of(file, definition.inputs)
    declared = zip(definition.parameters.items(), parameters.entries.values(), strict=True)
    return {
        "model": name,
        "summary": definition.summary,
        "kind": f"{definition.kind}: {KINDS[definition.kind]}",
        "maneuver": definition.maneuver,
        "starts": starts,
        "methods": [method for method, answer in accepted.items() if answer == "yes"],
        f"methods that may fit ({UNKNOWN})": [m for m, a in accepted.items() if a == "?"],
        **shipped,
        **{kind: _quantities(definition, kind) for kind in QUANTITIES},
        "parameter file": str(path),
        "parameters": [
            {"name": parameter, "value": entry.value, "unit": entry.unit}
            | {"bounds": _bounds(limits.above, limits.at_least, limits.at_most)}
            | {"meaning": entry.description, "status": entry.status, "source": entry.source}
            for (parameter, limits), entry in declared
        ],
        "sources": [
            {"source": key, "licence": source.licence, "text": source.text}
            for key, source in read_toml(path, ParameterFile).completed().sources.items()
        ],
    }


def _quantities(definition: ModelDefinition, kind: str) -> list[dict[str, Any]]:
    rows = []
    for q in getattr(definition, kind):
        row = {"name": q.name, "unit": q.unit, "meaning": q.long_name}
        if q.default is not None:
            low, high = definition.validity.get(q.name, (None, None))
            row |= {"default": q.default, "bounds": _bounds(None, low, high)}
        rows.append(row)
    return rows


def _accepts(method_name: str, definition: ModelDefinition) -> tuple[str, str]:
    """Whether a method reduces a model (`yes`, `no`, `?`) without deriving it, and the reason."""
    method = component("method", method_name)
    by_kind = definition.kind not in method.settings or method.refusal is never_refused
    model = definition if by_kind else build_derived(definition.name)
    if model is None:
        return "?", UNKNOWN
    accepted, reason = method.accepts(model)
    return "yes" if accepted else "no", reason


def _method(name: str) -> Description:
    """Summary, reference, settings and presets by kind of model, and the models it accepts."""
    method = component("method", name)
    settings: Description = {}
    for declared in dict.fromkeys(method.settings.values()):
        kinds = [kind for kind, of_kind in method.settings.items() if of_kind is declared]
        settings[f"settings, kind {' and '.join(kinds)}"] = _keys(declared.model_json_schema())
    answers = {model: _accepts(name, component("model", model)) for model in names("model")}
    return {
        "method": name,
        "summary": method.summary,
        "reference": f"doi:{method.reference}" if method.reference else "",
        **settings,
        "presets": [
            {"preset": preset, "kind": kind, "changes": _listed(changes) or "the defaults"}
            for kind in method.settings
            for preset, changes in method.presets_of(kind).items()
        ],
        "models": [{"model": m, "accepted": a, "reason": r} for m, (a, r) in answers.items()],
    }


def _listed(settings: Mapping[str, object]) -> str:
    return ", ".join(f"{key}={value}" for key, value in settings.items())


def _maneuver(name: str) -> Description:
    """Summary, duration, ranges of the inputs, factors, and the models that it drives."""
    maneuver = component("maneuver", name)
    models = {model: component("model", model).inputs for model in names("model")}
    driven = {m: i for m, i in models.items() if tuple(q.name for q in i) == maneuver.inputs}
    units = [q.unit for q in next(iter(driven.values()), ())] or [""] * len(maneuver.inputs)
    signals = zip(maneuver.inputs, units, maneuver.at(maneuver.times).T, strict=True)
    return {
        "maneuver": name,
        "summary": maneuver.summary,
        "duration": f"{maneuver.duration:g} s, {maneuver.samples} output times",
        "break points": [f"{time:g} s" for time in maneuver.break_points],
        "models": list(driven),
        "inputs": [
            {"name": i, "unit": unit, "smallest": float(s.min()), "largest": float(s.max())}
            for i, unit, s in signals
        ],
        "parameters": [
            {"name": f"{factor} factor", "default": 1.0, "bounds": _bounds(None, *limits)}
            for factor, limits in FACTORS.items()
        ],
    }


def _study(name: str) -> Description:
    """File, title and number of runs of a study, or of the members of a collection."""
    path = study_path(name)
    rows = [
        {"study": member, "runs": study.points, "summary": study.title}
        for member, study in load_studies(name).items()
    ]
    return {"study": path.stem, "file": str(path), "studies": rows}


def schema_description(name: str) -> Description:
    """Every key of a file, from the classes that parse it: type, default and meaning."""
    summaries: list[str] = []
    tables: dict[str, list[dict[str, object]]] = {}
    parts: dict[str, list[dict[str, object]]] = {}
    for title, file in SCHEMAS[name].items():
        schema = file.model_json_schema()
        # Without the markup of docstrings.
        summaries += schema["description"].replace("`", "").split()
        tables[title] = _keys(schema)
        for key, part in schema.get("$defs", {}).items():
            parts[key] = _keys(part)
    return {"schema": name, "summary": " ".join(summaries), **tables, **parts}


def _keys(schema: Mapping[str, Any]) -> list[dict[str, object]]:
    """A row for each key of an object's JSON schema."""
    required = schema.get("required", ())
    return [
        {"name": key, "type": _type(part)}
        | {"default": "required" if key in required else part.get("default")}
        | {"meaning": part.get("description", "")}
        for key, part in schema["properties"].items()
    ]


def _type(part: Mapping[str, Any]) -> str:
    """Type and bounds of a value as text."""
    if "$ref" in part:
        return part["$ref"].rpartition("/")[2]
    if "enum" in part:
        return ", ".join(map(str, part["enum"]))
    if one := part.get("anyOf") or part.get("oneOf"):
        choices = [_type(choice) for choice in one if choice != {"type": "null"}]
        # Every integer is a number.
        return " or ".join(c for c in choices if c != "integer" or "number" not in choices)
    kind = part.get("type", "value")
    inside = part.get({"array": "items", "object": "additionalProperties"}.get(kind, ""))
    if isinstance(inside, dict):
        return f"{TYPES[kind]} of {_type(inside)}"
    if kind in ("array", "object"):
        return TYPES[kind]
    largest = part.get("maximum", part.get("exclusiveMaximum"))
    limits = _bounds(part.get("exclusiveMinimum"), part.get("minimum"), largest)
    return f"{TYPES.get(kind, kind)} {limits}".rstrip()


def _bounds(above: float | None, at_least: float | None, at_most: float | None) -> str:
    """Bounds of a number as text; empty if there are none."""
    if at_least is not None and at_most is not None:
        return f"{at_least:g} to {at_most:g}"
    limits = ((">", above), (">=", at_least), ("<=", at_most))
    return ", ".join(f"{sign} {limit:g}" for sign, limit in limits if limit is not None)
