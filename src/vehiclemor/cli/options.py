"""Options that commands share, and how their texts become values, before anything is computed."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any, get_args

from cyclopts import Parameter, Token, convert

from vehiclemor.arguments import file_path, quoted
from vehiclemor.exceptions import InputError
from vehiclemor.files import replaceable

# A bound is missed, where that is asked for; a simulation, a study, a plug-in or the machine has
# failed.
MISSED, FAILED = 1, 1
All = Annotated[bool, Parameter(name="--all")]
Json = Annotated[bool, Parameter(name="--json", help="Print JSON.")]
Results = Annotated[Path, Parameter(help="Results folder.")]
Jobs = Annotated[int, Parameter(help="Number of processes, for what is missing.")]
Seed = Annotated[
    int | None,
    Parameter(help="Samples fresh test runs of protocols, for an audit with separate results."),
]
# One value or several, at least one: separated by spaces, or behind the same option again.
Several = Parameter(consume_multiple=1)
Settings = Annotated[
    list[str] | None,
    Several,
    Parameter(name="--set", help="key=value, one or several: settings of the method."),
]
Parameters = Annotated[
    list[str] | None,
    Several,
    Parameter(
        name="--parameter",
        help="name=value, one or several: parameters of the model in SI units, a point as x,y,z or "
        "one component as name.z=value. `vehiclemor show MODEL` has names, units and bounds.",
    ),
]


def strict(wanted: Any, tokens: Sequence[Token]) -> Any:
    """Value of an option; 1.5 is no integer, and an empty text no path."""
    for token in tokens:
        name, text = token.keyword or "argument", token.value
        if int in (wanted, *get_args(wanted)) and not text.strip().removeprefix("-").isdecimal():
            raise InputError(f"{name}: {quoted(text)} is not a whole number")
        if Path in (wanted, *get_args(wanted)):
            file_path(name, text)
    return convert(wanted, tokens)


def check_names(option: str, names: Iterable[str]) -> None:
    """Raise `InputError` if commas separate names."""
    for name in names:
        if "," in name and not Path(name).exists():
            spaced = name.replace(",", " ")
            raise InputError(f"{option} {quoted(name)}: spaces separate names, {option} {spaced}")


def key_values(option: str, given: Iterable[str] | None) -> dict[str, Any]:
    """Key -> an integer, a number, numbers that commas separate as a list, or text."""
    values: dict[str, Any] = {}
    for text in given or ():
        key, separator, value = text.partition("=")
        if not separator or not key:
            raise InputError(f"{option} {text!r} is not key=value")
        if key in values:
            raise InputError(f"{option} {key} is given twice")
        values[key] = _parsed(value)
    return values


def _parsed(text: str) -> object:
    for kind in (int, float, lambda text: [*map(float, text.split(","))]):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def new_file(option: str, path: Path, endings: Sequence[str]) -> Path:
    """A file that can be written, by its ending and its folder; `InputError` if it can't."""
    if not file_path(option, path).parent.is_dir():
        raise InputError(f"{option} {path}: the folder {path.parent} does not exist")
    if path.suffix.lower() not in endings:
        raise InputError(f"{option} {path}: the file ends with {' or '.join(endings)}")
    return path


def result_file(option: str, path: Path) -> Path:
    """As `new_file`, of a result: one that stands there is replaced, but nothing else."""
    from vehiclemor.netcdf_file import is_result

    return replaceable(new_file(option, path, (".nc",)), "result of vehiclemor", is_result)


def picture_file(option: str, path: Path) -> Path:
    """As `new_file`, of a picture: one that stands there is replaced, but nothing else."""
    from vehiclemor.report.figures.theme import FORMATS, picture_path

    return picture_path(new_file(option, path, [f".{ending}" for ending in FORMATS]))
