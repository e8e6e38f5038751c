"""Commands: what they print and write."""

import json
from pathlib import Path

import numpy as np
import xarray as xr

import vehiclemor as vm
from vehiclemor.cli import main
from vehiclemor.study.netcdf_file import write_dataset


def test_names_and_citation(capsys):
    assert main(["list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert set(listed) == {"models", "methods", "maneuvers", "studies"}
    assert listed["models"] == vm.models()
    assert main(["cite"]) == 0
    assert "10.1115/1.4029390" in capsys.readouterr().out


def test_simulate_writes_what_the_interface_returns(tmp_path, capsys):
    out, point = tmp_path / "run.nc", [0.0, 0.8, -0.13]
    pod = "--method pod --set rank=2 --frequency 1.1 --training nominal"
    parameter = "--parameter wheel_centre=0,0.8,-0.13"
    assert main(f"simulate double_wishbone {pod} {parameter} --out {out}".split()) == 0
    assert f"written: {out}" in capsys.readouterr().out
    model = vm.model("double_wishbone", {"wheel_centre": point})
    expected = vm.simulate(model, "pod", rank=2, frequency=1.1, training="nominal")
    with xr.open_dataset(out) as written:
        np.testing.assert_array_equal(written["coordinates"], expected["coordinates"])
        assert list(written["coordinate"].values) == list(model.coordinates)
        assert json.loads(written.attrs["configuration"])["parameters"]["wheel_centre"] == point


def test_simulate_prints_errors_in_a_table(capsys):
    assert main(["simulate", "double_wishbone", "--method", "pod", "--all-outputs"]) == 0
    text, dataset = capsys.readouterr().out, vm.simulate("double_wishbone", "pod")
    rows = [line.split() for line in text.splitlines() if line.split()[-1:] in (["m"], ["rad"])]
    assert [row[0] for row in rows] == dataset["output"].values.tolist()
    names = ("rms_error", "floor_rms_error", "max_error", "signal_range")
    for output, *row, _ in rows:
        expected = [dataset[name].sel(output=output).item() for name in names]
        # What is zero or missing is a dash.
        assert row == [f"{value:.1e}" if value else "-" for value in expected]


def test_pictures_are_named_and_written(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments = ["simulate", "double_wishbone", "--method", "pod", "--out", "run.nc"]
    assert main([*arguments, "--plot"]) == 0
    assert main([*arguments, "--plot", "mine.svg"]) == 0
    assert main(["run", "figures-6-7", "--results", "results"]) == 0
    assert main(["plot", "run.nc", "--kind", "errors"]) == 0
    assert main(["plot", "figures-6-7", "--select", "rank=4", "--out", "study.pdf"]) == 0
    text = capsys.readouterr().out
    names = ["double_wishbone-pod.png", "mine.svg", "study.pdf", "run-errors.png"]
    assert {path.name for path in tmp_path.iterdir()} == {*names, "run.nc", "results"}
    for name in names:
        assert f"written: {name}" in text
        assert Path(name).stat().st_size > 1000


def test_a_result_draws_itself(tmp_path):
    dataset = vm.simulate("double_wishbone", "pod")
    dataset.vehiclemor.plot("histories", tmp_path / "a.png")
    write_dataset(dataset, tmp_path / "run.nc")
    vm.plot(tmp_path / "run.nc", out=tmp_path / "b.png")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
