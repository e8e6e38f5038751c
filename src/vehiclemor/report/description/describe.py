"""A description of whatever a name stands for: model, method, maneuver, study or file schema."""

from collections.abc import Mapping
from pathlib import Path

from vehiclemor.arguments import quoted
from vehiclemor.errors import InputError
from vehiclemor.registry import names, unknown
from vehiclemor.report.description.maneuver import maneuver_description
from vehiclemor.report.description.method import method_description
from vehiclemor.report.description.model import model_description
from vehiclemor.report.description.schema import SCHEMAS, schema_description
from vehiclemor.report.description.study import study_description
from vehiclemor.resources import data_names

Description = dict[str, object]


def description(
    name: str,
    parameters: Mapping[str, object] | None = None,
    parameter_file: Path | None = None,
) -> Description:
    """What a name stands for; lists of dictionaries are the rows of tables.

    Raises
    ------
    InputError
        If nothing has that name, or a parameter is wrong.
    """
    if not isinstance(name, str):
        raise InputError(f"name is {quoted(name)}, not a text")
    if name in names("model"):
        return model_description(name, parameters, parameter_file)
    known = {
        **dict.fromkeys(names("method"), method_description),
        **dict.fromkeys(names("maneuver"), maneuver_description),
        **dict.fromkeys(data_names("studies"), study_description),
        **dict.fromkeys(SCHEMAS, schema_description),
    }
    if name.endswith(".toml"):
        return study_description(name)
    if name not in known:
        raise unknown("name", name, {*known, *names("model")})
    return known[name](name)
