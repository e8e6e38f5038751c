"""Parameter sets: every value with its unit, source and status, validated on loading."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from vehiclemor.arguments import quoted, real_array
from vehiclemor.exceptions import FileError, InputError, did_you_mean
from vehiclemor.files import data_folder
from vehiclemor.short_repr import ShortRepr
from vehiclemor.toml_files import FileSchema, Line, read_toml

# No road vehicle has a part farther than this from its origin (m).
LARGEST_LENGTH = 20.0
# Components of a point, as they follow its name after a full stop.
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Declared:
    """What a model says about one of its parameters.

    Attributes
    ----------
    unit
        SI unit; `1` for a pure number.
    size
        1: a scalar, given as a number; 3: a point, given as a list.
    above, at_least, at_most
        Bounds of every component, in the unit; no bound where None.
    default
        Value of an optional input that is a parameter; None of a parameter that files have.
    """

    unit: str
    size: int = 1
    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    default: float | None = None


def point() -> Declared:
    """Declaration of a point of a vehicle, in m."""
    return Declared("m", size=3, at_least=-LARGEST_LENGTH, at_most=LARGEST_LENGTH)


class Source(FileSchema):
    """Where values come from, and under which licence they are used."""

    text: str = Field(description="the publication or file, so that readers can get it")
    licence: str = Field(description="under which its values are used")


class Parameter(FileSchema):
    """One entry of a parameter file."""

    value: float | list[float] = Field(description="a number, or a point [x, y, z]")
    unit: str = Field(description="the SI unit that the model declares")
    source: str = Field(description="one of `sources`")
    status: Literal["published", "derived", "assumed"] = Field(
        description="as the source has it, computed from that, or chosen"
    )
    symbol: str = Field(description="in the notation")
    description: str = Field(description="what it is")


class ParameterFile(FileSchema):
    """Schema of `data/parameters/*.toml`."""

    model: str = Field(description="registered name")
    extends: str = Field(
        "", description="model whose public data hold what is missing here; none by default"
    )
    title: Line = Field(description="one line")
    sources: dict[str, Source] = Field(description="key -> where values come from")
    parameters: dict[str, Parameter] = Field(description="name -> value; all that the model needs")

    def completed(self) -> ParameterFile:
        """The file with the sources and parameters of the file that it extends."""
        if not self.extends:
            return self
        base = read_toml(parameter_path(self.extends), ParameterFile)
        sources = {**base.sources, **self.sources}
        parameters = {**base.parameters, **self.parameters}
        return self.model_copy(update={"sources": sources, "parameters": parameters})


@dataclass(frozen=True)
class ParameterSet(ShortRepr):
    """Validated parameters of one model, SI units."""

    model: str  # Name of the model.
    entries: dict[str, Parameter]  # Name -> entry, in the order that the model declares.

    def __getitem__(self, name: str) -> np.ndarray:
        """Value of a parameter as an array, shape () or (3,)."""
        return np.array(self.entries[name].value, dtype=float)

    def values(self) -> dict[str, np.ndarray]:
        """All values by name."""
        return {name: self[name] for name in self.entries}

    def flat(self) -> np.ndarray:
        """All components in one array, in declared order."""
        values = (entry.value for entry in self.entries.values())
        return np.array([c for v in values for c in (v if isinstance(v, list) else (v,))], float)


def parameter_path(model: str) -> Path:
    """File with the public data for a model."""
    return data_folder() / "parameters" / f"{model}.toml"


def load_parameters(
    model: str,
    expected: Mapping[str, Declared],
    path: Path | None = None,
    overrides: Mapping[str, object] | None = None,
) -> ParameterSet:
    """Load and validate the parameters of a model, by default its public data.

    `expected` are declarations by name; overrides are values in SI units by name, where `name.z` is
    one component of a point.  `FileError` if the file is unreadable, for another model, incomplete,
    or has a wrong unit or value; `InputError` if an override names no parameter or does not fit.
    """
    path = path or parameter_path(model)
    content = read_toml(path, ParameterFile).completed()
    if content.model != model:
        raise FileError(f"{path}: parameters of model {content.model!r}, not of {model!r}")
    in_file = {name: declared for name, declared in expected.items() if declared.default is None}
    for name in [*in_file, *content.parameters]:
        if name not in content.parameters:
            raise FileError(f"{path}: parameters.{name} is missing")
        if name not in in_file:
            raise FileError(f"{path}: parameters.{name} is not a parameter of {model}")
    entries = {name: content.parameters[name] for name in in_file}
    for name, entry in entries.items():
        declared, where = in_file[name], f"{path}: parameters.{name}"
        if entry.unit != declared.unit:
            raise FileError(f"{where}.unit: {entry.unit!r} is not the SI unit {declared.unit!r}")
        if entry.source not in content.sources:
            raise FileError(f"{where}.source: {entry.source!r} is not listed under sources")
        if complaint := _complaint(entry.value, declared):
            raise FileError(f"{where}: {complaint}")
    parameters = ParameterSet(model, entries)
    return overridden(parameters, expected, {} if overrides is None else overrides)


def _optional_input(name: str, declared: Declared) -> Parameter:
    """The entry of an optional input that is a parameter, at its default."""
    return Parameter(
        value=float(declared.default or 0.0),
        unit=declared.unit,
        source="default",
        status="assumed",
        symbol=name,
        description="optional input that is constant",
    )


def overridden(
    parameters: ParameterSet, expected: Mapping[str, Declared], overrides: Mapping[str, object]
) -> ParameterSet:
    """The expected parameters, those that are missing at defaults, with some values replaced.

    `InputError` if a name, shape or value is wrong.
    """
    model = parameters.model
    entries = {
        name: parameters.entries.get(name) or _optional_input(name, declared)
        for name, declared in expected.items()
    }
    for given, value in overrides.items():
        name, axis = parameter_and_axis(model, expected, given)
        number = _number_or_list(value, given)
        if axis is not None:
            point = np.atleast_1d(entries[name].value).tolist()
            if isinstance(number, list):
                raise InputError(f"parameter {given}: a number is needed, not a list")
            point[axis] = number
            number = point
        if complaint := _complaint(number, expected[name]):
            raise InputError(f"parameter {name}: {complaint}")
        entries[name] = entries[name].model_copy(
            update={"value": number, "status": "assumed", "source": "override"}
        )
    return ParameterSet(model, entries)


def parameter_and_axis(
    model: str, expected: Mapping[str, Declared], name: str
) -> tuple[str, int | None]:
    """A parameter, and the number of the component if it is one of a point, such as `joint.z`.

    `InputError` if the model has no such parameter.
    """
    point, _, axis = str(name).partition(".")
    declared = expected.get(name, expected.get(point))
    if declared is None:
        hint = did_you_mean(point, expected)
    elif name == point:
        return name, None
    elif declared.size == len(AXES) and axis in AXES:
        return point, AXES.index(axis)
    else:
        has = "is a number" if declared.size == 1 else f"has the components {', '.join(AXES)}"
        hint = f"{point} {has}"
    raise InputError(f"{quoted(name)} is not a parameter of {model}; {hint}")


def _number_or_list(value: object, name: str) -> float | list[float]:
    try:
        array = real_array(value)
    except (TypeError, ValueError):
        array = None
    if array is None or array.ndim > 1:
        raise InputError(f"parameter {name}: {quoted(value)} is not a number or list of numbers")
    return array.tolist()


def _complaint(value: float | list[float], declared: Declared) -> str:
    """What is wrong with a value of a parameter; empty if nothing is."""
    components = value if isinstance(value, list) else [value]
    if declared.size == 1 and isinstance(value, list):
        return f"a number is needed, not a list of {len(value)}"
    if len(components) != declared.size:
        return f"a point has 3 components (x, y, z), not {len(components)}"
    unit = "" if declared.unit == "1" else f" {declared.unit}"
    for number in components:
        if not math.isfinite(number):
            return f"{number} is not finite"
        if declared == point() and abs(number) > LARGEST_LENGTH:
            return f"{number} m is outside +-{LARGEST_LENGTH:g} m (is it in millimetres?)"
        if declared.above is not None and not number > declared.above:
            return f"{number:g}{unit} is not above {declared.above:g}"
        if declared.at_least is not None and number < declared.at_least:
            return f"{number:g}{unit} is below the smallest allowed {declared.at_least:g}{unit}"
        if declared.at_most is not None and number > declared.at_most:
            return f"{number:g}{unit} is above the largest allowed {declared.at_most:g}{unit}"
    return ""
