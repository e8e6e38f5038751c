"""A plug-in's model gets what a built-in one has, from its declaration alone."""

import json
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest
from regenerate import model_tables

from vehiclemor import registry
from vehiclemor.cli import main
from vehiclemor.registry import component
from vehiclemor.report.comparison import study_comparison
from vehiclemor.report.default_studies import nominal, unseen
from vehiclemor.report.figures import theme
from vehiclemor.report.labels import tabled_outputs

pytestmark = pytest.mark.usefixtures("plug_in_package")
CAR = "quarter_car"
METHODS = {"full_order", "full_order_strongest", "replay", "pod", "pod_literal", "fixed_basis"}


@pytest.fixture(scope="module")
def folder(plug_in_package, tmp_path_factory):
    return tmp_path_factory.mktemp("results")


@pytest.fixture(scope="module")
def tables(folder):
    return model_tables(CAR, folder)


def test_errors_have_every_method_and_output(tables):
    assert set(tables) == {"costs", "errors", "operations", "spectrum"}
    errors = tables["errors"].set_index(["study", "label", "start", "output"])["largest"]
    assert set(tables["errors"]["label"]) >= METHODS
    for output in tabled_outputs(component("model", CAR)):
        full, replayed = (
            errors.loc[f"{CAR}-perturbed", label, "equilibrium", output]
            for label in ("full_order", "replay")
        )
        # The reference is more accurate than the integrator that is compared.
        assert 0.0 < full < 1e-3 * replayed
        assert errors.loc[f"{CAR}-nominal", "replay", "equilibrium", output] == 0.0


def test_comparison_names_every_method(folder, capsys):
    assert main(["compare", CAR, "--results", str(folder)]) == 0
    printed = capsys.readouterr().out
    for words in METHODS:
        assert words in printed
    assert main(["compare", CAR, "--json", "--results", str(folder)]) == 0
    rows = json.loads(capsys.readouterr().out)
    unseen = {row["label"]: row for row in rows if row["kind"] == "method"}
    assert {"replay", "pod", "fixed basis", "strongest 2e-3"} <= set(unseen)
    assert unseen["replay"]["score"] > 1.0
    # More accurate with a tighter tolerance, whatever the model.
    scores = [unseen[f"full order {t}"]["score"] for t in ("1e-3", "1e-6")]
    assert scores[1] < scores[0]


def test_figures_are_those_of_every_model(folder, tmp_path, capsys, monkeypatch):
    # One picture of each figure is enough here.
    monkeypatch.setattr(theme, "FORMATS", ("png",))
    names = [f"{kind}-{CAR}" for kind in ("histories", "errors", "map", "pareto")]
    arguments = ["--results", str(folder), "--out", str(tmp_path), "--only", ",".join(names)]
    assert main(["figures", *arguments]) == 0
    written = capsys.readouterr().out.split()
    assert written == [str(tmp_path / f"figure-{name}.png") for name in names]
    assert all(np.fromfile(path, dtype=np.uint8).size > 10_000 for path in written)


def test_a_plug_ins_method_stands_beside_the_others(tmp_path, monkeypatch):
    real = registry._entries
    known = real("method")
    mine = EntryPoint("mine", known["fixed_basis"].value, registry.GROUPS["method"])
    entries = {"method": {**known, "mine": mine}}
    monkeypatch.setattr(registry, "_entries", lambda kind: entries.get(kind) or real(kind))
    table = study_comparison(nominal(CAR, tmp_path), tmp_path).set_index("label")
    assert list(table.loc["mine", "largest"]) == list(table.loc["fixed_basis", "largest"])
    assert 'method = "mine"' in Path(unseen(CAR, tmp_path)).read_text()
