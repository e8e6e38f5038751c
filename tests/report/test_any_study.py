"""A study, a protocol or a collection of somebody else's: tables and figures."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg

import vehiclemor as vm
from tests.report.figure_texts import check_texts
from vehiclemor.cli import main
from vehiclemor.report.figures.catalogue import find
from vehiclemor.report.figures.result_plot import plot_result
from vehiclemor.report.figures.theme import styled
from vehiclemor.report.frames import frame, grid_rows
from vehiclemor.report.page import error_table
from vehiclemor.study.netcdf_file import read_dataset
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
        status = main([*map(str, arguments), "--out", str(place / "results")])
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
    data = read_dataset(place / "results" / "studies" / "mine.nc", "study", "mine")
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
    data = read_dataset(place / "results" / "studies" / "mine.nc", "study", "mine")
    data["status"] = data["status"].astype(object)
    there = {"label": "mine", "start": "dropped", "frequency_factor": 1.3, "fastest": 20.0}
    before = {(r["label"], r["start"], r["output"]): r for r in grid_rows(data)}
    data["status"].loc[there] = "diverged"
    data["rms_error"].loc[there] = np.inf
    after = {(r["label"], r["start"], r["output"]): r for r in grid_rows(data)}
    row = after["mine", "dropped", "tire_force"]
    assert (row["failed"], row["failures"], row["runs"]) == (1, "1 diverged", 6)
    assert np.isfinite(row["largest"])
    assert row["largest"] <= before["mine", "dropped", "tire_force"]["largest"]
    figure = plot_result(data, None, "errors")
    assert "a run has failed" in [text.get_text() for text in figure.legends[0].get_texts()]
    check_texts_of(figure)
    # What a protocol would not trust has the status ok, and a remark.
    data["remark"] = data["remark"].astype(object)
    data["remark"].loc[there | {"frequency_factor": 1.0}] = "not driven; not to be trusted on Mars"
    data["remark"].loc[there | {"frequency_factor": 0.8}] = "not driven"
    now = {(r["label"], r["start"], r["output"]): r["warned"] for r in grid_rows(data)}
    more = {key[:2] for key, count in now.items() if count != before[key]["warned"]}
    assert more == {("mine", "dropped")}
    table = error_table(data)
    told = [status for status in table["status"] if status.endswith("Mars")]
    assert told == ["ok (trained on this run): not driven; not to be trusted on Mars"]
    data["status"][:] = "diverged"
    assert {row["failures"] for row in grid_rows(data)} == {"3 diverged", "6 diverged"}


def test_a_frame_has_a_row_for_each_run_of_a_grid_and_of_a_protocol(place):
    for name, dataset in run_studies(str(place / "both.toml"), place / "results").items():
        runs = frame(dataset)
        assert len(runs) == dataset["status"].size
        axes = [str(dimension) for dimension in dataset["status"].dims]
        assert {"label", "method"} <= set(runs), name
        assert not runs.duplicated(axes).any()
        # In the order of the grid: the first dimension changes last.
        first = dataset[axes[0]].values
        np.testing.assert_array_equal(runs[axes[0]], np.repeat(first, len(runs) // len(first)))
        for row in runs.sample(5, random_state=1).to_dict("records"):
            run = dataset.sel({axis: row[axis] for axis in axes})
            assert row["status"] == run["status"].item()
            assert row["method"] == run["method"].item()
            for output in dataset["output"].values:
                expected = run["rms_error"].sel(output=output).item()
                np.testing.assert_array_equal(row[f"rms_error.{output}"], expected)
        assert set(frame(dataset, ["status"])) >= {*axes, "status"}
        assert "seconds" not in frame(dataset, ["status"])


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
    entries = find(str(place / "both.toml"), results)
    assert [entry.name for entry in entries] == ["mine-errors", "mine-histories", "road-pareto"]
    data = run_studies(str(place / "both.toml"), results)
    with styled():
        figure = entries[0].draw(data)
        check_texts_of(figure)
    assert "mine" in " ".join(text.get_text() for text in figure.legends[0].get_texts())
    folders = ["--results", results, "--out", place / "figures"]
    assert main(["figures", "--only", str(place / "road.toml"), *map(str, folders)]) == 0
    written = [Path(line) for line in capsys.readouterr().out.splitlines()]
    assert [path.name for path in written] == [
        f"figure-road-pareto.{suffix}" for suffix in ("pdf", "svg", "png")
    ]
    assert all(path.stat().st_size > 10_000 for path in written)


def check_texts_of(figure):
    FigureCanvasAgg(figure).draw()
    check_texts(figure)


def varied(**dimensions):
    """Errors that a study could have over any dimensions, of two methods."""
    outputs = ["second_euler_angle", "spindle_y"]
    names = [*dimensions, "label"]
    sizes = [len(values) for values in dimensions.values()]
    rng = np.random.default_rng(3)
    errors = 10.0 ** rng.uniform(-6.0, -2.0, (*sizes, 2, 2))
    variables = {
        "rms_error": ((*names, "output"), errors),
        "signal_range": ((*names, "output"), np.ones_like(errors)),
        "status": (names, np.full(errors.shape[:-1], "ok", dtype=object)),
    }
    units = {"output_unit": ("output", ["rad", "m"])}
    coordinates = {**dimensions, "label": ["pod", "my_own_method"], "output": outputs, **units}
    attributes = {"title": "what varies", "model": "double_wishbone", "configuration": "{}"}
    return xr.Dataset(variables, coordinates, attributes)


FACTOR = {"frequency_factor": [0.8, 1.0, 1.2, 1.4]}


@pytest.mark.parametrize(
    ("dimensions", "label", "panels", "meshes"),
    [
        (FACTOR | {"rank": [1, 2, 3]}, "frequency perturbation (%)", 2, 0),
        (FACTOR | {"amplitude_factor": [0.9, 1.0]}, "frequency perturbation (%)", 4, 4),
        ({"tolerance": [1e-8, 1e-6, 1e-3]}, "tolerance", 2, 0),
        ({"rank": [*range(1, 9)], "snapshots": [*range(5, 11)]}, "rank", 4, 4),
        ({"start": ["a", "b"], "rank": [1, 2, 3]}, "rank", 4, 0),
        ({"formulation": ["coordinates", "state", "paired"]}, "formulation", 2, 0),
        ({"equation_seed": [*range(30)]}, "equation seed, sorted by error", 2, 0),
    ],
)
def test_figures_follow_from_what_varies(dimensions, label, panels, meshes):
    dataset = varied(**dimensions)
    figure = plot_result(dataset, None, "errors")
    shown = [axis for axis in figure.axes if axis.get_label() != "<colorbar>"]
    assert len(shown) == panels
    assert shown[-1].get_xlabel() == label
    found = [axis for axis in shown if any(hasattr(c, "get_coordinates") for c in axis.collections)]
    assert len(found) == meshes
    assert (shown[-1].get_xscale() == "log") == (label == "tolerance")
    check_texts_of(figure)


def test_curves_show_every_error_once(place):
    dataset = varied(**FACTOR, rank=[2, 3])
    # One method does not depend on the rank.
    dataset["rms_error"][:, 1, 1] = dataset["rms_error"][:, 0, 1]
    figure = plot_result(dataset, None, "errors")
    axis = figure.axes[0]
    lines = {line.get_label(): line for line in axis.lines if np.size(line.get_xdata())}
    own = {"POD, rank 2", "POD, rank 3", "my own method"}
    assert set(lines) == own | {"published, nominal"}
    for rank_ in (2, 3):
        place = {"label": "pod", "rank": rank_, "output": "second_euler_angle"}
        line = lines[f"POD, rank {rank_}"]
        np.testing.assert_array_equal(line.get_ydata(), dataset["rms_error"].sel(place))
        np.testing.assert_allclose(line.get_xdata(), [-20.0, 0.0, 20.0, 40.0], atol=1e-12)


def test_samples_are_drawn_over_what_was_sampled():
    dataset = varied(sample=[*range(40)])
    values = np.linspace(0.0, 1.0, 40)
    names = ("first", "second", "third", "fourth")
    for number, name in enumerate(names):
        places = np.roll(values, 7 * number)
        dataset = dataset.assign_coords({name: ("sample", places, {"units": "kg"})})
    dataset["rms_error"] = dataset["rms_error"] * 0.0 + np.exp(dataset["third"])
    figure = plot_result(dataset, None, "errors")
    assert len(figure.axes) == 6
    # Of four quantities the errors follow the third.
    assert figure.axes[3].get_xlabel() == "third (kg)"
    check_texts_of(figure)
