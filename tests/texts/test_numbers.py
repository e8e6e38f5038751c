"""Numbers in README and handbook are those of the facts, and none stands outside of a fragment."""

import json

import facts
import fragments
import numpy as np
import pytest
import xarray as xr
from fragments import Fragments, Manifest, Verbatim

from tests.texts.markdown import NAMES
from vehiclemor import VehiclemorError

DECLARED = fragments.manifest()
# The other is generated.
MEASURED = [name for name in NAMES if not name.endswith("study-schema.md")]


def test_every_number_in_a_text_is_its_fact_and_has_an_origin():
    stored = facts.stored_facts()
    printed = list(fragments.printed_numbers(DECLARED))
    for number in printed:
        value = stored["facts"][number.expression]["value"]
        assert number.text == fragments.rendered(value, number.form), number
    assert {number.expression for number in printed} == set(stored["facts"])
    sources = {source for number in printed for source in facts.sources_of(number.expression)}
    assert sources == set(stored["sources"]) == set(DECLARED.sources)
    assert set(DECLARED.varying) <= sources
    for source, origin in stored["sources"].items():
        assert origin["results"] == DECLARED.sources[source]
        assert origin["date"]
        assert origin["commit"]


def test_no_measured_number_stands_outside_of_a_fragment():
    assert [wrong for n in MEASURED for wrong in fragments.uncovered(DECLARED, n)] == []
    for part in DECLARED.verbatim:
        text = (fragments.ROOT / part.file).read_text(encoding="utf-8")
        assert part.source
        for words in part.texts:
            assert fragments.matches(text, words), f"{part.file}: {words}"


@pytest.fixture
def page(tmp_path, monkeypatch):
    """A small project: one text, one fragment, results of one study."""
    monkeypatch.setattr(fragments, "ROOT", tmp_path)
    monkeypatch.setattr(facts, "ROOT", tmp_path)
    monkeypatch.setattr(facts, "FACTS", tmp_path / "facts.json")
    (tmp_path / "page.md").write_text("pitch 9.9e-9\nrad at r = 3 over 7 ways\n")
    texts = [
        "pitch {[s: rms_error; pod; rank=3] | .1e} rad at r = 3",
        "over {count([s: status] == 'ok') | d} ways",
        "{[s: rms_error; pod; rank=3] | .1e} rad at r = 3 over",
    ]
    part = Fragments(file="page.md", texts=texts)
    declared = Manifest(sources={"s": "study"}, varying=[], fragments=[part], verbatim=[])
    data = xr.Dataset(
        {
            "rms_error": (("rank", "method"), [[0.1, 0.2], [4.26e-5, 0.3]], {"units": "rad"}),
            "status": (("rank", "method"), [["ok", "ok"], ["ok", "diverged"]]),
        },
        {"rank": [2, 3], "method": ["pod", "replay"]},
    )
    monkeypatch.setattr(facts, "manifest", lambda: declared)
    monkeypatch.setattr(facts, "load", lambda *_: data)
    monkeypatch.setattr(facts, "stored_files", lambda *_: [tmp_path / "page.md"])
    return tmp_path, declared


def test_the_script_writes_numbers_and_leaves_words_and_line_ends(page):
    folder, _ = page
    assert facts.measure(folder, 1, stored_only=False) == []
    assert (folder / "page.md").read_text() == "pitch 4.3e-5\nrad at r = 3 over 3 ways\n"
    known = json.loads((folder / "facts.json").read_text())["facts"]
    assert known["[s: rms_error; pod; rank=3]"] == {"value": 4.26e-5, "unit": "rad"}


def test_what_is_not_stored_stays_and_is_named(page, monkeypatch):
    folder, _ = page
    facts.measure(folder, 1, stored_only=False)
    monkeypatch.setattr(facts, "stored_files", lambda *_: [folder / "absent.nc"])
    before = (folder / "page.md").read_text(), (folder / "facts.json").read_text()
    (line,) = facts.measure(folder, 1, stored_only=True)
    assert "study" in line
    assert ((folder / "page.md").read_text(), (folder / "facts.json").read_text()) == before


@pytest.mark.parametrize(
    ("text", "times"), [("pitch\n", 0), ("pitch 1 rad at r = 3, pitch 2 rad at r = 3\n", 2)]
)
def test_a_fragment_that_is_gone_or_ambiguous_is_named(page, text, times):
    folder, declared = page
    (folder / "page.md").write_text(text)
    with pytest.raises(VehiclemorError, match=rf"{times} times.*pitch"):
        list(fragments.printed_numbers(declared))


def test_a_decimal_outside_of_fragments_is_found(page):
    folder, declared = page
    with (folder / "page.md").open("a") as file:
        file.write(
            "off by 0.37 m, `0.1 s`, [5.5](a-1.2.md), at most 4e-3, version 1.2.3, after 0.5 s\n"
        )
    condition = Verbatim(file="page.md", source="condition", texts=["after 0.5 s"])
    declared = declared.model_copy(update={"verbatim": [condition]})
    found = fragments.uncovered(declared, "page.md")
    assert found == [f"page.md, line 3: {number}" for number in ("0.37", "5.5", "4e-3")]


def test_a_wrong_query_or_a_missing_result_is_named(page, tmp_path, monkeypatch):
    data = {"s": facts.load()}
    for labels, word in (("; pdo", "pdo"), ("; rank=4", "rank=4"), ("", "no number")):
        with pytest.raises(VehiclemorError, match=word):
            facts.evaluate(f"[s: rms_error{labels}]", data)
    monkeypatch.undo()
    with pytest.raises(VehiclemorError, match="tox -e bench"):
        facts.load("benchmark", tmp_path, 1)


@pytest.mark.parametrize(
    ("value", "form", "text"),
    [(5.6e-5, ".1e", "5.6e-5"), (25.0, "d", "25"), (4e7, ".0e", "4e7"), (0.3, ".2f", "0.30")],
)
def test_numbers_are_printed_as_the_texts_have_them(value, form, text):
    assert fragments.rendered(np.float64(value), form) == text
