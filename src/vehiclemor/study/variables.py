"""Variables of result files with their units and meanings, from `data/results/variables.toml`."""

from collections.abc import Mapping
from functools import cache

from vehiclemor.resources import data_folder
from vehiclemor.toml_files import FileSchema, read_toml


class VariablesFile(FileSchema):
    """Schema of `data/results/variables.toml`."""

    variables: dict[str, list[str]]
    dimensions: dict[str, str]


@cache
def _declared() -> VariablesFile:
    return read_toml(data_folder() / "results" / "variables.toml", VariablesFile)


def variables(found: Mapping[str, object], *dimensions: str) -> dict[str, tuple]:
    """Values with unit and meaning, on dimensions and on the quantity that their unit goes with."""
    result: dict[str, tuple] = {}
    for name, values in found.items():
        unit, meaning, *clock = _declared().variables[name]
        quantity = unit.removeprefix("see ").removesuffix("_unit")
        own = () if quantity == unit else (quantity,)
        attributes = ({"units": unit} if unit else {}) | {"long_name": meaning}
        attributes |= {"clock": clock[0]} if clock else {}
        result[name] = ((*dimensions, *own), values, attributes)
    return result


def meaning_of(dimension: str) -> str:
    """What a dimension of a grid is."""
    return _declared().dimensions.get(dimension, dimension.replace("_", " "))
