"""The page on the paper's method names functions of the code: they are where it says."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROWS = re.findall(
    r"^\|.*\| `([\w/]+\.py)` \| (`.*`) \|$",
    (ROOT / "docs" / "method.md").read_text(encoding="utf-8"),
    re.MULTILINE,
)


@pytest.mark.parametrize(("file", "functions"), ROWS)
def test_functions_are_in_their_files(file, functions):
    source = (ROOT / "src" / "vehiclemor" / file).read_text(encoding="utf-8")
    for name in re.findall(r"`([\w.]+)`", functions):
        assert re.search(rf"(def|class) {name.split('.')[-1]}\b", source), name


def test_the_table_has_rows():
    assert len(ROWS) > 8
