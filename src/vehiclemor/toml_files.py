"""The border to TOML files: one clear line for whatever is wrong with a file."""

import re
import tomllib
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, ValidationError

from vehiclemor.arguments import complaint, quoted
from vehiclemor.exceptions import FileError
from vehiclemor.files import read_regular

# Bytes of a file, characters of a line in it, and parts of a key: the parser takes a time that
# grows with their square.
MOST_BYTES, LONGEST, MOST_PARTS = 1_000_000, 1000, 8
# Things that are wrong with a file, of which all are named.
MOST_NAMED = 3
PART = r"""\.[ \t]*+(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+"""
LONG_KEY = re.compile(f"(?:{PART}){{{MOST_PARTS}}}")
Schema = TypeVar("Schema", bound="FileSchema")


def _line(text: str) -> str:
    if not (text.strip() and text.isprintable()):
        raise ValueError(f"{quoted(text)} is not a line of text")
    if len(text) > LONGEST:
        raise ValueError(f"a text of {len(text)} characters; the longest has {LONGEST}")
    return text


def _number_or_text(value: object) -> object:
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"is {quoted(value)}, neither a number nor a text")
    return value


Line = Annotated[str, AfterValidator(_line)]
Value = Annotated[int | float | str, BeforeValidator(_number_or_text)]


class FileSchema(BaseModel):
    """Base of the schemas of data files: frozen, strict, no unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


def read_toml(path: Path, schema: type[Schema]) -> Schema:
    """Read and validate a TOML file; `FileError` if it is missing, unreadable or does not fit."""
    return fitting(path, toml_content(path), schema)


def toml_content(path: Path) -> dict[str, Any]:
    """What a TOML file says; `FileError` if it is missing or unreadable."""
    try:
        text = read_regular(path, MOST_BYTES).decode()
        if LONG_KEY.search(text):
            raise ValueError(f"a key has more than {MOST_PARTS} parts")
        return tomllib.loads(text)
    except RecursionError:
        raise FileError(f"{path}: tables or lists are nested too deeply") from None
    except FileNotFoundError:
        raise FileError(f"{path}: no such file") from None
    except OSError as error:
        raise FileError(f"{path}: can't be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise FileError(f"{path}: not a text file in UTF-8") from None
    # A number of thousands of digits is no TOML error, but no number either; nor is "\0" a path.
    except ValueError as error:
        raise FileError(f"{path}: not a valid TOML file: {error}") from None


def fitting(path: Path, content: dict[str, Any], schema: type[Schema]) -> Schema:
    """The content of a file, validated; `FileError` if it does not fit."""
    try:
        return schema.model_validate(content)
    except ValidationError as error:
        lines = []
        for wrong in error.errors()[:MOST_NAMED]:
            where, message = ".".join(map(str, wrong["loc"])) or "top level", complaint(wrong)
            lines.append(f"{where}{'' if message.startswith('is ') else ':'} {message}")
        more = error.error_count() - len(lines)
        ending = f" (and {more} more)" if more else ""
        raise FileError(f"{path}: {'; '.join(lines)}{ending}") from None
