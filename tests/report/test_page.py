"""The report as a page: alone in its file, escaped, with every error, status and setting."""

import json
import re
from xml.etree import ElementTree

import pytest

import vehiclemor as vm
from vehiclemor.cli import main
from vehiclemor.exceptions import InputError
from vehiclemor.netcdf_file import read_dataset
from vehiclemor.report.unseen import method_rows

HOSTILE = "</title></script><script>alert(1)</script> & \"x\" 'y' --> <!-- ${z} {{ 1 + 1 }}"
STUDY = f"""
title = {json.dumps(HOSTILE)}
model = "double_wishbone"
training = "nominal"
keep = "metrics"
grid = {{ frequency_factor = [0.9, 1.0, 1.2] }}
methods = [
    {{ method = "pod", settings = {{ rank = 3 }} }},
    {{ method = "replay", label = {json.dumps(HOSTILE)} }},
]
"""


def texts(page, tag):
    return ["".join(element.itertext()) for element in page.iter(tag)]


def table(page, heading):
    """Rows of the table with this heading, as dictionaries."""
    for element in page.iter("table"):
        heads, *rows = ([value(cell) for cell in row] for row in element.iter("tr"))
        if heading in heads:
            return [dict(zip(heads, row, strict=True)) for row in rows if len(row) == len(heads)]
    raise AssertionError(heading)


def value(cell):
    (number,) = [element.get("value") for element in cell.iter("data")] or [None]
    return "".join(cell.itertext()) if number is None else float(number)


@pytest.fixture(scope="module")
def made(tmp_path_factory, small_protocol):
    """Folder of results, and the text of the report of all of them."""
    folder = tmp_path_factory.mktemp("page")
    (folder / "my hostile.toml").write_text(STUDY)
    names = [str(folder / "my hostile.toml"), str(small_protocol)]
    out = ["--results", str(folder), "--out", str(folder / "a.html")]
    assert main(["report", *names, *out]) == 0
    return folder, (folder / "a.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def read(made):
    # A page is XML but for the elements that are never closed.
    text = re.sub(r"<(meta|hr|img)\b([^>]*)>", r"<\1\2/>", made[1])
    return ElementTree.fromstring(text)  # noqa: S314 - our own


def dataset_of(folder, name):
    return read_dataset(folder / "studies" / f"{name}.nc")


def test_the_file_is_whole_and_loads_nothing(read):
    every = list(read.iter())
    links = [element.get("href")[1:] for element in every if element.get("href")]
    assert links == [element.get("id") for element in every if element.get("id")]
    assert not any(re.search(r"\s", link) for link in links)
    pictures = [element.get("src") for element in every if element.get("src")]
    assert len(pictures) == 2
    assert all(picture.startswith("data:image/svg+xml;base64,") for picture in pictures)
    (policy,) = [element.get("content") for element in every if element.get("http-equiv")]
    assert policy == "default-src 'none'; style-src 'unsafe-inline'; img-src data:"


@pytest.mark.parametrize("call", [vm.write_report, vm.figures])
def test_two_files_of_one_name_are_refused(tmp_path, monkeypatch, call):
    monkeypatch.chdir(tmp_path)
    files = [tmp_path / folder / "figure-11.toml" for folder in "ab"]
    for file in files:
        file.parent.mkdir()
        file.write_text(STUDY)
    for several in (files, [files[0], "figure-11"]):
        with pytest.raises(InputError, match="have one name, figure-11"):
            call(several)
    assert len(list(tmp_path.iterdir())) == 2


def test_hostile_titles_are_texts(read):
    assert not list(read.iter("script"))
    assert HOSTILE in texts(read, "h2")
    assert any(row["method"] == HOSTILE for row in table(read, "largest RMS"))


def test_provenance_and_settings_stand_there(made, read):
    dataset = dataset_of(made[0], "my hostile")
    assert json.loads(texts(read, "pre")[0]) == json.loads(dataset.attrs["configuration"])
    for name in ("versions", "kernel_hash"):
        assert str(dataset.attrs[name]) in texts(read, "dd")


def test_a_protocol_shows_its_methods_and_targets(made, read):
    dataset = dataset_of(made[0], "unseen")
    expected = {row["label"]: row for row in method_rows(dataset)}
    row = expected["fixed basis"]
    label = "fixed basis (chosen)"
    (errors,) = (own for own in table(read, "worst error") if own["method"] == label)
    (costs,) = (own for own in table(read, "times faster") if own["method"] == label)
    assert (float(errors["missed"]), errors["worst error"]) == (row["misses"], row["score"])
    assert costs["call, us"] == row["seconds"]
    targets = table(read, "target for fixed basis")
    assert {own["verdict"] for own in targets} <= {"met", "missed", "not comparable"}
