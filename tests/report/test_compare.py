"""Comparison, costs, tables and figures."""

import json

import numpy as np
import pytest

from vehiclemor.cli import main
from vehiclemor.report.compare import COLUMNS, comparison
from vehiclemor.report.costs import cost_table
from vehiclemor.report.figures.catalogue import FIGURES
from vehiclemor.report.published import load_published
from vehiclemor.report.regenerate import regenerate_figures
from vehiclemor.report.tables import latex, markdown, regenerate_tables
from vehiclemor.study.run import run_studies

GRID = """
title = "a small stand-in for the grid"
model = "double_wishbone"
training = "nominal"
keep = "metrics"
[grid]
frequency_factor = [0.8, 1.0, 1.3]
amplitude_factor = [0.9, 1.0, 1.2]
rank = [3]
[[methods]]
method = "pod"
[[methods]]
method = "replay"
"""


@pytest.fixture(scope="module")
def rows(results_folder):
    return comparison("paper", results_folder)


def test_every_published_number_has_a_row(rows):
    published = [
        number.value
        for number in load_published().numbers.values()
        if number.kind in ("rms_error", "time_reduction")
    ]
    for value in published:
        assert (rows["published"] == value).any()
    assert set(rows["verdict"]) <= {"met", "missed", "not_comparable"}
    assert rows["reason"].str.len().min() > 0
    assert list(rows.columns) == list(COLUMNS)


def test_verdicts_follow_from_the_numbers(rows):
    errors = rows[rows["item"].str.contains("RMS error") & rows["reproduced"].notna()]
    assert len(errors) == 4
    for row in errors.to_dict("records"):
        assert (row["verdict"] == "met") == (row["reproduced"] <= row["published"])
        assert row["replay"] == 0.0
        assert row["floor"] > 0.0
        assert "nominal-only" in row["reason"]
        assert "never published" in row["reason"]
    claims = [c for c in load_published().claims.values() if c.model == "double_wishbone"]
    for claim in claims:
        if claim.kind != "setup":
            assert rows["item"].str.contains(claim.statement, regex=False).any()
    absent = rows[rows["model"] != "double_wishbone"]
    assert (absent["verdict"] == "not_comparable").all()


def test_published_bounds_of_the_suspension_are_met(rows):
    errors = rows[rows["item"].str.contains("RMS error") & rows["reproduced"].notna()]
    assert (errors["verdict"] == "met").all()
    default = errors[errors["item"].str.contains("default")]
    assert (default["reproduced"] <= 1.5 * default["floor"]).all()


def test_costs_are_consistent(results_folder):
    table = cost_table("double_wishbone", results_folder).set_index("contestant")
    newton, strongest = table.loc["full order, Newton"], table.loc["full order, strongest"]
    assert newton["speed_up"] == 1.0
    assert strongest["speed_up_strongest"] == 1.0
    assert strongest["residual_evaluations"] < 1.1 * 1001
    assert strongest["jacobian_evaluations"] == 1
    assert newton["iterations"] == newton["jacobian_evaluations"]
    assert table.loc["replay", "iterations"] == 0
    for row in table.to_dict("records"):
        if np.isfinite(row["break_even"]):
            saved = newton["us_per_run"] - row["us_per_run"]
            assert row["break_even"] == pytest.approx(row["offline_us"] / saved)


def test_command_prints_json_and_says_that_bounds_are_missed(results_folder, capsys, rows):
    status = main(["compare", "--json", "--out", str(results_folder)])
    assert status == int((rows["verdict"] == "missed").any())
    printed = json.loads(capsys.readouterr().out)
    assert len(printed) == len(rows)
    assert set(printed[0]) == set(COLUMNS)


def test_command_prints_a_table_with_costs(results_folder, capsys):
    main(["compare", "--out", str(results_folder)])
    printed = capsys.readouterr().out
    for word in ("published", "reproduced", "floor", "replay", "verdict", "break-even", "missed"):
        assert word in printed
    assert "never published" in printed


def test_figures_and_tables_are_byte_identical(results_folder, tmp_path):
    names = ["5", "7", "13", "14"]
    contents = []
    for turn in ("first", "second"):
        out = tmp_path / turn
        paths = regenerate_figures(results_folder, out, names)
        paths += regenerate_tables(results_folder, out)
        contents.append({path.name: path.read_bytes() for path in paths})
    assert len(contents[0]) == 2 * len(names) + 3 * 4
    assert contents[0] == contents[1]
    assert all(contents[0].values())


def test_map_is_drawn_from_any_grid(tmp_path):
    import matplotlib.pyplot as plt

    path = tmp_path / "grid.toml"
    path.write_text(GRID)
    dataset = run_studies(str(path), tmp_path / "results")["grid"]
    figure = FIGURES["13-map"].draw({"perturbation-grid": dataset})
    meshes = [axis.collections[0].get_array() for axis in figure.axes[:2]]
    errors = dataset["rms_error"].sel({"output": "spindle_y"}).squeeze()
    for mesh, method in zip(meshes, ("pod", "replay"), strict=True):
        expected = errors.sel({"method": method}).transpose("amplitude_factor", "frequency_factor")
        np.testing.assert_array_equal(np.asarray(mesh), expected.values)
    plt.close(figure)


def test_figure_labels_have_units(results):
    import matplotlib.pyplot as plt

    for name, entry in FIGURES.items():
        if not set(entry.studies) <= set(results):
            continue
        figure = entry.draw(results)
        for axis in figure.axes:
            if axis.get_ylabel():
                assert "(" in axis.get_ylabel(), name
        plt.close(figure)


def test_tables_escape_what_their_format_reserves():
    import pandas as pd

    table = pd.DataFrame({"a_b": ["5 % | x_1 & y", 0.5], "c": [float("nan"), 2]})
    assert markdown(table).splitlines()[2] == "| 5 % \\| x_1 & y |  |"
    assert r"5 \% | x\_1 \& y" in latex(table)
