"""Keys of a file, or settings of a method, from the pydantic class that parses them."""

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from vehiclemor.parameters import ParameterFile
from vehiclemor.study.plans.protocol_file import ProtocolFile
from vehiclemor.study.plans.study_file import StudyFile

SCHEMAS: dict[str, type[BaseModel]] = {
    "study-schema": StudyFile,
    "protocol-schema": ProtocolFile,
    "parameter-schema": ParameterFile,
}
WORDS = {"string": "text", "boolean": "true or false", "array": "list", "object": "table"}


def schema_description(name: str) -> dict[str, Any]:
    """Every key of a file: type, default and meaning."""
    schema = SCHEMAS[name].model_json_schema()
    tables = {key: rows(part) for key, part in schema.get("$defs", {}).items()}
    return {"schema": name, "summary": _line(schema), "keys": rows(schema), **tables}


def rows(schema: Mapping[str, Any]) -> list[dict[str, object]]:
    """A row for each key of an object's JSON schema."""
    required = schema.get("required", ())
    return [
        {
            "name": key,
            "type": words(part),
            "default": "required" if key in required else part.get("default"),
            "meaning": part.get("description", ""),
        }
        for key, part in schema["properties"].items()
    ]


def words(part: Mapping[str, Any]) -> str:
    """Type and bounds of a value in words."""
    if "$ref" in part:
        return part["$ref"].rpartition("/")[2]
    if "enum" in part:
        return ", ".join(map(str, part["enum"]))
    if one := part.get("anyOf") or part.get("oneOf"):
        choices = [words(choice) for choice in one if choice != {"type": "null"}]
        # Every integer is a number.
        return " or ".join(c for c in choices if c != "integer" or "number" not in choices)
    kind = part.get("type", "value")
    for container, key in (("array", "items"), ("object", "additionalProperties")):
        if kind == container:
            inside = part.get(key)
            return f"{WORDS[kind]} of {words(inside)}" if isinstance(inside, dict) else WORDS[kind]
    largest = part.get("maximum", part.get("exclusiveMaximum"))
    limits = bounds(part.get("exclusiveMinimum"), part.get("minimum"), largest)
    return f"{WORDS.get(kind, kind)} {limits}".rstrip()


def bounds(above: float | None, at_least: float | None, at_most: float | None) -> str:
    """Bounds of a number in words; empty if there are none."""
    if at_least is not None and at_most is not None:
        return f"{at_least:g} to {at_most:g}"
    limits = ((">", above), (">=", at_least), ("<=", at_most))
    return ", ".join(f"{sign} {limit:g}" for sign, limit in limits if limit is not None)


def _line(schema: Mapping[str, Any]) -> str:
    """What a class says of itself, without the markup of docstrings."""
    return " ".join(schema["description"].replace("`", "").split())
