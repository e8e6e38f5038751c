"""How far a study is: counts of what is stored, reasons, and an estimate of the rest."""

import math
from dataclasses import replace

import pytest

import vehiclemor as vm
from tests.study.small import small_study
from vehiclemor.cli import main
from vehiclemor.reduction.methods import replay
from vehiclemor.study import workers
from vehiclemor.study.run import run_studies
from vehiclemor.study.store import cell_path, read_cell, write_cell

GRID = """
keep = "metrics"
training = "nominal"
grid = { rank = [2, 3], frequency_factor = [1.0, 1.1], amplitude_factor = [1.0, 3.0] }
"""


@pytest.fixture
def study(tmp_path):
    return small_study(tmp_path, GRID, "pod", "replay")


def told(capsys, study, out) -> str:
    assert main(["status", str(study), "--results", str(out)]) == 0
    return " ".join(capsys.readouterr().out.split())


def test_a_study_is_followed_from_nothing_to_its_end(study, tmp_path, capsys, monkeypatch):
    out = tmp_path / "out"
    assert "0 of 12 cells done, 12 to do (time unknown)" in told(capsys, study, out)
    assert not out.exists()
    assert math.isnan(vm.status(study, out)["small"].seconds_left)
    run_studies(str(study), out)
    monkeypatch.setattr(workers, "evaluate", None)
    found = vm.status(study, out)["small"]
    assert (found.cells, found.done, found.to_do, found.seconds_left) == (12, 12, 0, 0.0)
    # Messages differ in the time at which the wheel does not reach its height.
    ((kind, message), runs), *others = found.failed.items()
    assert (kind, runs, others) == ("unreachable", 6, [])
    assert "out of reach" in message
    assert found.ends["ok", ""] == 6
    assert found.result == out / "studies" / "small.nc"
    assert "12 of 12 cells done" in told(capsys, study, out)
    for path in sorted((out / "cells").glob("??/*"))[:3]:
        path.unlink()
    (cell,) = sorted((out / "cells").glob("??/*"))[:1]
    cell.write_bytes(b"spoiled")
    assert "8 of 12 cells done, 4 to do (about" in told(capsys, study, out)


def test_a_bug_is_to_do_again_and_named(study, tmp_path, monkeypatch, capsys):
    def broken(*_):
        raise ZeroDivisionError("in a plug-in")

    monkeypatch.setattr(replay, "METHOD", replace(replay.METHOD, check=broken))
    run_studies(str(study), tmp_path)
    found = vm.status(study, tmp_path)["small"]
    assert (found.done, found.to_do) == (8, 4)
    ((message, runs),) = [(m, n) for (kind, m), n in found.failed.items() if kind == "error"]
    assert runs == 4
    assert "ZeroDivisionError: in a plug-in" in message
    assert message[:60] in told(capsys, study, tmp_path)


def test_seconds_left_are_those_of_each_method_without_its_first_use(study, tmp_path):
    run_studies(str(study), tmp_path)
    cells = {"pod": [], "replay": []}
    for path in sorted((tmp_path / "cells").glob("??/*")):
        title = read_cell(tmp_path, path.stem).attributes["title"]
        cells[title.split()[0]].append(path.stem)
    seconds = {"pod": [9.0, 0.2, 0.3, 0.1, 0.4], "replay": [5.0, 0.01]}
    for method, known in seconds.items():
        for key, each in zip(cells[method], known, strict=False):
            write_cell(read_cell(tmp_path, key).dataset(), tmp_path, key, each)
        for key in cells[method][len(known) :]:
            cell_path(tmp_path, key).unlink()
    found = vm.status(study, tmp_path)["small"]
    assert (found.done, found.to_do) == (7, 5)
    assert found.seconds_left == pytest.approx(3 * 0.25 + 2 * 0.01)
    # Of a method that has finished nothing they are those of all.
    for key in cells["replay"]:
        cell_path(tmp_path, key).unlink(missing_ok=True)
    left = vm.status(study, tmp_path)["small"].seconds_left
    assert left == pytest.approx((3 + len(cells["replay"])) * 0.25)


def test_a_protocol_is_told_of_up_to_its_choice(tmp_path, protocol_text):
    path = tmp_path / "small.toml"
    path.write_text(protocol_text)
    found = vm.status(path, tmp_path)["small"]
    assert (found.cells, found.done) == (6, 0)
    assert "tested" in found.later


def test_a_file_in_the_place_of_the_results_is_one_line(study, capsys):
    assert main(["status", str(study), "--results", str(study)]) == 2
    assert str(study) in capsys.readouterr().err
