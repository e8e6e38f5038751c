"""Where numbers stand in README and handbook: fragments that `numbers.toml` declares."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from vehiclemor import VehiclemorError
from vehiclemor.toml_files import FileSchema, read_toml

ROOT = Path(__file__).resolve().parents[1]
# {expression | format}
PLACE = re.compile(r"\{([^{}|]+)\|([^{}|]+)\}")
PRINTED = r"(-?\d[\d.]*(?:e-?\d+)?|nan|inf)"
DECIMAL = re.compile(r"(?<![\w.-])\d+(?:\.\d+(?:e-?\d+)?|e-?\d+)(?![\w.]*\w)")
# Code and addresses hold no measurements.
UNREAD = re.compile(r"```.*?```|`[^`]*`|\]\([^)]*\)|<[^>]*>", re.DOTALL)


class Fragments(FileSchema):
    """Parts of a text with `{expression | format}` in place of numbers."""

    file: str
    texts: list[str]


class Verbatim(FileSchema):
    """Parts of a text whose numbers no stored study gives, and where they come from."""

    file: str
    source: str
    texts: list[str]


class Manifest(FileSchema):
    """Schema of `paper/numbers.toml`.

    Attributes
    ----------
    sources
        Short name -> study, or kind of a table and its model.
    varying
        Sources whose numbers depend on the clock, or on rounding.
    """

    sources: dict[str, str]
    varying: list[str]
    fragments: list[Fragments]
    verbatim: list[Verbatim]


class Printed(NamedTuple):
    """A number in a text: where it stands, and what it should be."""

    file: str
    span: tuple[int, int]
    text: str
    expression: str
    form: str


def manifest() -> Manifest:
    """The manifest, validated."""
    return read_toml(ROOT / "paper" / "numbers.toml", Manifest)


def printed_numbers(declared: Manifest) -> Iterator[Printed]:
    """Every number of a fragment, where it stands in the texts."""
    for part in declared.fragments:
        text = (ROOT / part.file).read_text(encoding="utf-8")
        for fragment in part.texts:
            match = only_match(part.file, text, fragment)
            for group, place in enumerate(PLACE.finditer(fragment), 1):
                expression, form = place[1].strip(), place[2].strip()
                yield Printed(part.file, match.span(group), match[group], expression, form)


def only_match(file: str, text: str, fragment: str) -> re.Match[str]:
    """Where a fragment stands in a text, which has it once."""
    found = matches(text, fragment)
    if len(found) != 1:
        raise VehiclemorError(f"{file} has {len(found)} times, not once: {fragment.strip()!r}")
    return found[0]


def matches(text: str, fragment: str) -> list[re.Match[str]]:
    """Where a fragment stands in a text, whatever its numbers and its line ends are."""
    words: list[str] = []
    end = 0
    fragment = fragment.strip()
    for place in PLACE.finditer(fragment):
        words += [_flexible(fragment[end : place.start()]), PRINTED]
        end = place.end()
    return list(re.finditer("".join([*words, _flexible(fragment[end:])]), text))


def _flexible(words: str) -> str:
    return r"\s+".join(re.escape(word) for word in re.split(r"\s+", words))


def rendered(value: float, form: str) -> str:
    """A number as the texts print it: 5.6e-5, not 5.6e-05."""
    text = f"{round(value) if form == 'd' else value:{form}}"
    return re.sub(r"e([+-])0*(\d)", lambda m: f"e{m[1].replace('+', '')}{m[2]}", text)


def rewritten(text: str, numbers: Iterable[tuple[Printed, str]]) -> str:
    """A text with other numbers in the places of its fragments."""
    # Fragments may overlap: each place is written once.
    places = {number.span: new for number, new in numbers}
    for (first, last), new in sorted(places.items(), reverse=True):
        text = text[:first] + new + text[last:]
    return text


def uncovered(declared: Manifest, file: str) -> list[str]:
    """Decimal numbers of a text that no fragment and no verbatim part holds."""
    text = (ROOT / file).read_text(encoding="utf-8")
    spans = [number.span for number in printed_numbers(declared) if number.file == file]
    for part in declared.verbatim:
        if part.file == file:
            spans += [match.span() for words in part.texts for match in matches(text, words)]
    spans += [code.span() for code in UNREAD.finditer(text)]
    return [
        f"{file}, line {text.count(chr(10), 0, match.start()) + 1}: {match[0]}"
        for match in DECIMAL.finditer(text)
        if not any(first <= match.start() and match.end() <= last for first, last in spans)
    ]
