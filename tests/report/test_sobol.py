"""Boxes of Sobol indices that ship, and their figure."""

import pytest

import vehiclemor.online.sobol as online
from vehiclemor.errors import InputError
from vehiclemor.report import sobol
from vehiclemor.report.figures import sobol as drawing
from vehiclemor.report.figures.catalogue import find
from vehiclemor.report.sobol import SobolFile, sobol_dataset
from vehiclemor.resources import data_folder, data_names
from vehiclemor.simulation.build import build
from vehiclemor.simulation.sensitivities import components
from vehiclemor.study.objectives import OBJECTIVES
from vehiclemor.toml_files import read_toml

SMALL = """
title = "Two hard points"
model = "double_wishbone"
maneuver = "sine_travel"
samples = 2
objectives = ["bump_steer"]
box = { "tie_rod_inner.z" = [-0.125, -0.115], "tie_rod_outer.z" = [-0.125, -0.115] }

[[models]]
label = "full order"
method = "full_order"
"""


@pytest.mark.parametrize("name", data_names("sobol"))
def test_boxes_hold_the_cars_own_values(name):
    declared = read_toml(data_folder() / "sobol" / f"{name}.toml", SobolFile)
    assert declared.model == name
    assert set(declared.objectives) <= OBJECTIVES.keys()
    for own in components(build(name), list(declared.box)):
        low, high = declared.box[own.label]
        assert low < own.value < high


def test_the_figure_is_drawn_of_stored_indices(tmp_path, monkeypatch):
    (tmp_path / "sobol").mkdir()
    (tmp_path / "sobol" / "double_wishbone.toml").write_text(SMALL)
    monkeypatch.setattr(sobol, "data_folder", lambda: tmp_path)
    first = sobol_dataset("double_wishbone", tmp_path / "results")
    monkeypatch.setattr(online, "sobol_indices", None)
    assert sobol_dataset("double_wishbone", tmp_path / "results").identical(first)
    (entry,) = find("sobol-double_wishbone", tmp_path / "results")
    figure = entry.draw({})
    (axis,) = figure.axes
    heights = [bar.get_height() for bar in axis.patches]
    for name in ("total_order", "first_order"):
        assert first[name].values.ravel() == pytest.approx(heights[:2])
        heights = heights[2:]
    doubted = first.assign(untrusted=("model", [0.25]))
    monkeypatch.setattr(drawing, "sobol_dataset", lambda *_: doubted)
    text = entry.draw({}).legends[0].get_texts()[0].get_text()
    assert text.endswith("s, 25 % untrusted)")


def test_other_models_have_no_box(tmp_path):
    with pytest.raises(InputError, match="declares a box"):
        sobol_dataset("quarter_car", tmp_path)
