"""A study, a protocol, a collection and a model of somebody else's: tables and figures."""

import json
import re
from operator import itemgetter
from pathlib import Path

import numpy as np
import pytest

import vehiclemor as vm
from tests.plugin.installation import registered
from tests.report.figure_texts import checked
from vehiclemor.cli import main
from vehiclemor.netcdf_file import read_dataset
from vehiclemor.registry import component, names
from vehiclemor.report import comparison
from vehiclemor.report.comparison import nominal, study_comparison, unseen
from vehiclemor.report.figures.result_plot import draw, pictures_of, plot_result
from vehiclemor.report.figures.theme import styled
from vehiclemor.report.labels import tabled_outputs
from vehiclemor.report.results import ERRORS, grid_rows
from vehiclemor.study.run import run_studies

pytestmark = pytest.mark.usefixtures("plug_in_package")
STUDY = """
title = "My car, my method"
model = "quarter_car"
training = "nominal"
start = ["equilibrium", "dropped"]
grid = { frequency_factor = [0.8, 1.0, 1.3], fastest = [20.0, 1000.0] }
methods = [
    { method = "full_order" },
    { method = "replay" },
    { method = "quarter_car_modes", label = "mine" },
]
"""
PROTOCOL = """
title = "My car, my method, roads that it has not seen"
model = "quarter_car"
bounds.tire_force = { measure = "rms", bound = 20.0 }
training = [{ maneuver = "quarter_car_road" }]
validation = [{ maneuver = "quarter_car_road", frequency = [1.2] }]
targets = [{ against = "equal accuracy", ratio = 2.0 }]
failure_rate = 0.01
methods = [
    { label = "full order", method = "full_order", role = "full order" },
    { method = "replay", role = "baseline" },
    { label = "mine", method = "quarter_car_modes", candidates = [{ fastest = 1000.0 }] },
]
[[test]]
maneuver = "quarter_car_road"
frequency = [0.9, 1.1]
start = ["equilibrium", "dropped"]
"""


@pytest.fixture(scope="module")
def place(plug_in_package, tmp_path_factory):
    """A folder with a study, a protocol and a collection of both, and their results."""
    folder = tmp_path_factory.mktemp("mine")
    (folder / "mine.toml").write_text(STUDY)
    (folder / "road.toml").write_text(PROTOCOL)
    members = ", ".join(f'"{folder / name}.toml"' for name in ("mine", "road"))
    (folder / "both.toml").write_text(f'title = "both"\nstudies = [{members}]\n')
    return folder


@pytest.fixture
def said(place, capsys, monkeypatch):
    """Run a command on the results folder: exit status and what it prints."""
    monkeypatch.setenv("COLUMNS", "80")

    def run(*arguments):
        status = main([*map(str, arguments), "--results", str(place / "results")])
        out = capsys.readouterr().out
        assert "--json" in arguments or all(len(line) <= 80 for line in out.splitlines())
        return status, out

    return run


def test_a_study_is_compared_by_method_start_and_output(place, said):
    status, text = said("compare", place / "mine.toml")
    assert status == 0
    assert "start dropped: tire force, N" in text
    status, text = said("compare", place / "mine.toml", "--json")
    rows = {(r["label"], r["start"], r["output"]): r for r in json.loads(text)}
    data = read_dataset(place / "results" / "studies" / "mine.nc")
    assert len(rows) == 3 * 2 * data.sizes["output"]
    for (method, start, output), row in rows.items():
        errors = data["rms_error"].sel({"label": method, "start": start, "output": output})
        # What a method doesn't have makes no further runs.
        assert row["runs"] == (6 if method == "mine" else 3)
        assert row["failed"] == 0
        assert row["largest"] == float(errors.max())
        assert row["median"] == pytest.approx(float(errors.median()), rel=1e-12)
        at = dict(part.rsplit(" ", 1) for part in row["largest_at"].split(", ") if part)
        if at:
            chosen = errors.sel({k: float(v) for k, v in at.items()})
            np.testing.assert_array_equal(chosen, row["largest"])


def test_failed_runs_are_counted_and_have_no_part_in_the_errors(place, said):
    said("compare", place / "mine.toml")
    data = read_dataset(place / "results" / "studies" / "mine.nc")
    data["status"] = data["status"].astype(object)
    there = {"label": "mine", "start": "dropped", "frequency_factor": 1.3, "fastest": 20.0}
    before = {(r["label"], r["start"], r["output"]): r for r in grid_rows(data)}
    data["status"].loc[there] = "diverged"
    after = {(r["label"], r["start"], r["output"]): r for r in grid_rows(data)}
    row = after["mine", "dropped", "tire_force"]
    assert (row["failed"], row["failures"], row["runs"]) == (1, "1 diverged", 6)
    assert np.isfinite(row["largest"])
    assert row["largest"] <= before["mine", "dropped", "tire_force"]["largest"]
    figure = plot_result(data, None, "errors")
    assert "a run has failed" in [text.get_text() for text in figure.legends[0].get_texts()]
    checked(figure)
    # What a protocol would not trust has the status ok, a mark and a remark.
    data["warned"].loc[there | {"frequency_factor": 1.0}] = True
    # The template's method reads no training: a mark that it could have.
    data["in_training"].loc[there | {"frequency_factor": 1.0}] = True
    data["remark"] = data["remark"].astype(object)
    data["remark"].loc[there | {"frequency_factor": 1.0}] = "not driven; not to be trusted on Mars"
    data["remark"].loc[there | {"frequency_factor": 0.8}] = "not driven"
    now = {(r["label"], r["start"], r["output"]): r["warned"] for r in grid_rows(data)}
    more = {key[:2] for key, count in now.items() if count != before[key]["warned"]}
    assert more == {("mine", "dropped")}
    data["status"][:] = "diverged"
    assert {row["failures"] for row in grid_rows(data)} == {"3 diverged", "6 diverged"}


def test_a_protocol_is_judged_by_its_own_targets(place, said):
    # Four runs can't exclude a rate of 1 %, however fast they are.
    status, text = said("compare", place / "both.toml")
    assert status == 0
    assert said("compare", place / "both.toml", "--check")[0] == 1
    assert re.search(r"failure rate below +0.01\*? +0.527 +missed", text)
    rows = vm.compare(str(place / "road.toml"), place / "results")
    assert set(rows["study"]) == {"road"}
    assert set(rows["label"][rows["kind"] == "target"]) == {"mine"}


def test_figures_of_a_study_and_a_protocol(place, capsys):
    results = place / "results"
    data = run_studies(str(place / "both.toml"), results)
    kinds = {name: pictures_of(dataset) for name, dataset in data.items()}
    assert kinds == {"mine": ["errors", "histories"], "road": ["pareto"]}
    with styled():
        figure = draw(data["mine"], "errors")
        checked(figure)
    assert "mine" in " ".join(text.get_text() for text in figure.legends[0].get_texts())
    folders = ["--results", results, "--out", place / "figures"]
    assert main(["figures", "--only", str(place / "road.toml"), *map(str, folders)]) == 0
    written = [Path(line) for line in capsys.readouterr().out.splitlines()]
    assert [path.name for path in written] == [
        f"figure-road-pareto.{suffix}" for suffix in ("pdf", "svg", "png")
    ]
    assert all(path.stat().st_size > 10_000 for path in written)
    assert main(["plot", str(place / "road.toml"), *map(str, folders[:2])]) == 2
    assert "figures --only" in capsys.readouterr().err


CAR = "quarter_car"
METHODS = {"full_order", "full_order_strongest", "replay", "pod", "pod_literal", "fixed_basis"}
# Quick to fit; one that accepts no car, one of the plug-in, and one that a test registers.
FEW = ("fixed_basis", "full_order", "mine", "path_map", "pod", "quarter_car_modes", "replay")


@pytest.fixture(autouse=True)
def few_methods(monkeypatch):
    def few(kind):
        return [name for name in names(kind) if kind != "method" or name in FEW]

    monkeypatch.setattr(comparison, "names", few)


def test_a_model_is_compared_by_every_method_and_output(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(comparison, "FACTORS", (0.8, 1.0, 1.2))
    monkeypatch.setitem(comparison.POINTS, "test", [[0.9, 1.0], [1.3, 1.0]])
    assert main(["compare", CAR, "--results", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert main(["compare", CAR, "--json", "--results", str(tmp_path)]) == 0
    rows = json.loads(capsys.readouterr().out)
    key = itemgetter("study", "label", "start", "output")
    errors = {key(row): row["largest"] for row in rows if row["kind"] == ERRORS}
    assert {label for _, label, _, _ in errors} == METHODS | {"quarter_car_modes"}
    assert all(words in printed for words in METHODS)
    for output in tabled_outputs(component("model", CAR)):
        full, replayed = (
            errors[f"{CAR}-perturbed", label, "equilibrium", output]
            for label in ("full_order_strongest", "replay")
        )
        # The reference is more accurate than the integrator that is compared.
        assert 0.0 < full < 1e-2 * replayed
        assert errors[f"{CAR}-nominal", "replay", "equilibrium", output] == 0.0
    unseen = {row["label"]: row for row in rows if row["kind"] == "method"}
    assert {"replay", "pod", "fixed basis", "strongest 1e-2"} <= set(unseen)
    assert unseen["replay"]["score"] > 1.0
    # More accurate with a tighter tolerance, whatever the model.
    scores = [unseen[f"full order {t}"]["score"] for t in ("1e-3", "1e-6")]
    assert scores[1] < scores[0]
    known = {"nominal": ["errors", "histories"], "perturbed": ["errors"]}
    for name, kinds in known.items():
        data = read_dataset(tmp_path / "studies" / f"{CAR}-{name}.nc")
        assert pictures_of(data) == kinds


def test_a_plug_ins_method_stands_beside_the_others(tmp_path):
    with registered("method", "mine", "vehiclemor.reduction.methods.pod:FIXED_BASIS"):
        table = study_comparison(nominal(CAR, tmp_path), tmp_path).set_index("label")
        assert 'method = "mine"' in Path(unseen(CAR, tmp_path)).read_text()
    assert list(table.loc["mine", "largest"]) == list(table.loc["fixed_basis", "largest"])
