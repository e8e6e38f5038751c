"""Commands: what they print and write."""

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import vehiclemor as vm
from vehiclemor.cli import main, progress
from vehiclemor.report import regenerate
from vehiclemor.report.comparison import kinds
from vehiclemor.study import run as study_run
from vehiclemor.study.netcdf_file import write_dataset
from vehiclemor.study.workers import Workers


def test_list(capsys):
    assert main(["list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert set(listed) == {"models", "methods", "maneuvers", "studies"}
    assert "double_wishbone" in listed["models"]
    assert {"full_order", "replay", "pod", "fixed_basis"} <= set(listed["methods"])
    assert main(["list", "methods"]) == 0
    assert "pod" in capsys.readouterr().out


def test_simulate_writes_what_the_interface_returns(tmp_path, capsys):
    out = tmp_path / "run.nc"
    arguments = [
        "--method",
        "pod",
        "--set",
        "rank=2",
        "--frequency",
        "1.1",
        "--training",
        "nominal",
    ]
    assert main(["simulate", "double_wishbone", *arguments, "--out", str(out)]) == 0
    assert "second_euler_angle" in capsys.readouterr().out
    expected = vm.simulate("double_wishbone", "pod", rank=2, frequency=1.1, training="nominal")
    with xr.open_dataset(out) as written:
        np.testing.assert_array_equal(written["coordinates"], expected["coordinates"])
        assert list(written["coordinate"].values) == list(vm.model("double_wishbone").coordinates)


def table_of(text):
    """Output -> numbers of the table of a simulation."""
    rows = [line.split() for line in text.splitlines() if line.split()[-1:] in (["m"], ["rad"])]
    return {row[0]: row[1:-1] for row in rows}


def test_simulate_prints_errors_in_a_table(capsys):
    assert main(["simulate", "double_wishbone", "--method", "pod", "--all-outputs"]) == 0
    text = capsys.readouterr().out
    dataset = vm.simulate("double_wishbone", "pod")
    table = table_of(text)
    assert list(table) == dataset["output"].values.tolist()
    names = ("rms_error", "floor_rms_error", "max_error", "signal_range")
    for output, row in table.items():
        expected = [dataset[name].sel(output=output).item() for name in names]
        assert row == [f"{value:.1e}" if value else "-" for value in expected]
    assert "floor: RMS error of the best approximation" in text
    assert "nothing is kept: --out FILE.nc keeps the result, --plot draws it" in text


def test_what_is_zero_or_missing_is_a_dash(capsys):
    assert main(["simulate", "double_wishbone"]) == 0
    text = capsys.readouterr().out
    assert {tuple(row[:3]) for row in table_of(text).values()} == {("-", "-", "-")}
    assert "4 more outputs: --all-outputs" in text


def test_parameters_of_the_command_line_are_those_of_the_interface(tmp_path, capsys):
    out, point = tmp_path / "run.nc", [0.0, 0.8, -0.13]
    given = ["--parameter", "wheel_centre=0,0.8,-0.13", "--out", str(out)]
    assert main(["simulate", "double_wishbone", *given]) == 0
    assert f"written: {out}" in capsys.readouterr().out
    model = vm.model("double_wishbone", {"wheel_centre": point})
    with xr.open_dataset(out) as written:
        np.testing.assert_array_equal(written["outputs"], vm.simulate(model)["outputs"])
        assert json.loads(written.attrs["configuration"])["parameters"]["wheel_centre"] == point


def test_pictures_are_named_and_written(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments = ["simulate", "double_wishbone", "--method", "pod", "--out", "run.nc"]
    assert main([*arguments, "--plot"]) == 0
    assert main([*arguments, "--plot", "mine.svg"]) == 0
    assert main(["run", "figures-6-7", "--out", "results"]) == 0
    assert main(["plot", "run.nc", "--kind", "errors"]) == 0
    assert main(["plot", "figures-6-7", "--select", "rank=4", "--out", "study.pdf"]) == 0
    text = capsys.readouterr().out
    names = ["double_wishbone-pod.png", "mine.svg", "study.pdf", "run-errors.png"]
    assert {path.name for path in tmp_path.iterdir()} == {*names, "run.nc", "results"}
    for name in names:
        assert f"written: {name}" in text
        assert Path(name).stat().st_size > 1000
    assert "at rank 4" in text


def test_a_result_draws_itself(tmp_path):
    dataset = vm.simulate("double_wishbone", "pod")
    figure = dataset.vehiclemor.plot("histories", tmp_path / "a.png")
    assert "pod on double_wishbone: sine_travel" in figure.get_suptitle()
    write_dataset(dataset, tmp_path / "run.nc")
    vm.plot(tmp_path / "run.nc", path=tmp_path / "b.png")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize(
    ("result", "words"),
    [
        (3, "result is 3"),
        (xr.Dataset({"a": 1.0}), "neither a run nor a study"),
        ("figure-99", "unknown study"),
        ("figure-11", "vehiclemor run figure-11 makes it"),
        ("paper", "is a collection"),
        ("none.nc", "no such result"),
    ],
)
def test_what_can_not_be_drawn_is_one_line(tmp_path, result, words):
    with pytest.raises(vm.VehiclemorError, match=words):
        vm.plot(result, results=tmp_path)


def test_progress_without_a_terminal_is_lines(capsys, monkeypatch):
    monkeypatch.setattr(progress, "INTERVAL", 0.01)
    with progress.shown_progress():
        workers = Workers("mine", Path("nowhere"), asked={"a", "b", "c"}, finished={"a"})
        for line in ("mine: 2 of 3 to compute", "mine: 1 of 3, "):
            workers._report()
            told, end = "", time.monotonic() + 20.0
            while line not in told and time.monotonic() < end:
                told += capsys.readouterr().err
            assert line in told


@pytest.mark.parametrize("command", ["run", "compare", "figures"])
def test_every_long_command_tells_of_cells(capsys, monkeypatch, tmp_path, command):
    def long(*_, **__):
        Workers("mine", tmp_path, asked={"a", "b", "c"}, finished={"a"})._report()
        given = {"compare": pd.DataFrame({"verdict": []}), "figures": ([], {}), "run": {}}
        return given[command]

    monkeypatch.setattr(kinds, "compare", long)
    monkeypatch.setattr(regenerate, "regenerate_figures", long)
    monkeypatch.setattr(study_run, "run_studies", long)
    arguments = {"run": ["figure-6"], "compare": ["--json"], "figures": []}
    assert main([command, *arguments[command]]) == 0
    assert "mine: 2 of 3 to compute" in capsys.readouterr().err


def test_run_prints_statuses_and_resumes(tmp_path, capsys):
    for _ in range(2):
        assert main(["run", "figures-6-7", "--out", str(tmp_path)]) == 0
        assert "12 grid points, 9 cells: 9 ok" in capsys.readouterr().out
    assert (tmp_path / "studies" / "figures-6-7.nc").exists()


def test_cite(capsys):
    assert main(["cite"]) == 0
    printed = capsys.readouterr().out
    assert "10.1115/1.4029390" in printed
    assert "Masoudi" in printed


def test_importing_the_package_loads_nothing_heavy():
    heavy = ("numpy", "sympy", "numba", "xarray", "scipy", "pandas", "matplotlib", "pydantic")
    code = f"import sys, vehiclemor; print([m for m in {heavy!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_public_names_exist():
    for name in vm.__all__:
        assert getattr(vm, name) is not None
