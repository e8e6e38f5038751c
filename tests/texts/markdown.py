"""README and the pages of the site, taken apart."""

import re
import shlex
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
GENERATED = DOCS / "study-file-reference.md"
TEXTS = [ROOT / "README.md", *sorted({*DOCS.glob("*.md")} - {GENERATED})]
NAMES = [str(path.relative_to(ROOT)) for path in TEXTS]
FENCED = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)


class Block(NamedTuple):
    """A fenced block, and the line above it."""

    language: str
    content: str
    above: str


def blocks(path: Path) -> list[Block]:
    text = path.read_text(encoding="utf-8")
    found = FENCED.finditer(text)
    return [Block(m[1], m[2], text[: m.start()].rstrip().rpartition("\n")[2]) for m in found]


def console_commands(path: Path) -> list[list[str]]:
    """Commands of the `console` blocks, in order."""
    lines = "".join(b.content for b in blocks(path) if b.language == "console").splitlines()
    return [shlex.split(line[2:], comments=True) for line in lines if line.startswith("$ ")]


def inline_commands(path: Path) -> list[list[str]]:
    """Commands of this package in running text; capitals stand for what a reader puts there."""
    prose = FENCED.sub("", path.read_text(encoding="utf-8"))
    spans = (" ".join(span.split()) for span in re.findall(r"`([^`]+)`", prose))
    commands = [shlex.split(span) for span in spans if span.startswith("vehiclemor ")]
    return [words for words in commands if not any(w.isupper() and len(w) > 1 for w in words)]
