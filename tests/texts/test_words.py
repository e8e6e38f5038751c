"""Retired names and phrases stay out of source, help and pages; CHANGELOG is exempt."""

import re

import pytest

from tests.texts.markdown import ROOT, TEXTS

CHANGELOG = ROOT / "CHANGELOG.md"
FOLDERS = ("src", "examples", "data/plugin_template", "data/studies")
# Help on the command line is made of docstrings.
FILES = [
    *TEXTS,
    *(
        path
        for name in FOLDERS
        for end in ("py", "toml")
        for path in (ROOT / name).rglob(f"*.{end}")
    ),
]
# Words of the project that the field has others for; spaces may be line breaks.
PHRASES = (
    "silent miss(es)?",
    "in silence",
    "missed silently",
    "runs? (is|are) flagged",
    "flagged runs?",
    "set aside",
    "lifting",
    "lifted to (the )?full",
    "projection windows?",
    "effective rank",
    "boxes? of cars",
    "cars in the box",
    "which (is|are) ours",
    "that are ours",
    "nothing old is taken for new",
    "whoever writes",
    "whoever wants",
    "does not trust itself",
    "trusts itself",
    "of one's own",
    "the worse of two starts",
    "strongest full-order solver",
    "tried and left",
    "as it tells",
    "told in one line",
    "is told to",
    "status of a cell",
    "cells? of status",
    "cells? of a study",
    "cells a second",
    "finished cells",
    "a cell's (key|name|file)",
    "one file a cell",
    "what a model can tell",
)


def retired() -> list[str]:
    """Names in the first column of the table of the changelog."""
    _, _, table = CHANGELOG.read_text(encoding="utf-8").partition("## Retired names\n")
    rows = re.findall(r"^\| (.*?) \| ", table.partition("\n## ")[0], re.MULTILINE)
    return [name for row in rows for name in re.findall(r"`([^`]+)`", row)]


def pattern(name: str) -> re.Pattern[str]:
    """A whole name; with brackets behind it a call, with a slash a path."""
    call = r"\(" if name.endswith("()") else r"(?!\w)"
    return re.compile(r"(?<![\w/])" + re.escape(name.removesuffix("()")) + call)


def found(words: re.Pattern[str]) -> list[str]:
    """Files and lines that hold these words."""
    places = []
    for path in FILES:
        text = path.read_text(encoding="utf-8")
        for match in words.finditer(text):
            line = text.count("\n", 0, match.start()) + 1
            places.append(f"{path.relative_to(ROOT)}, line {line}")
    return places


def test_the_table_of_retired_names_is_read():
    assert {"ProjectionWindows", "lift()", "run.time", "errors.py"} <= set(retired())
    assert len(retired()) == len(set(retired())) > 30
    assert pattern("lift()").search("def lift(x):")
    assert not pattern("run.time").search("run.times")


@pytest.mark.parametrize("name", retired())
def test_a_retired_name_does_not_come_back(name):
    assert found(pattern(name)) == []


@pytest.mark.parametrize("phrase", PHRASES)
def test_a_retired_phrase_does_not_come_back(phrase):
    assert len(PHRASES) <= 40
    assert found(re.compile(rf"\b{phrase}\b".replace(" ", r"\s+"), re.IGNORECASE)) == []
