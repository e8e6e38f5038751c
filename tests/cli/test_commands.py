"""Commands: what they print and write."""

import json
import subprocess
import sys

import numpy as np
import xarray as xr

import vehiclemor as vm
from vehiclemor.cli import main


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


def test_run_prints_statuses_and_resumes(tmp_path, capsys):
    for _ in range(2):
        assert main(["run", "figures-6-7", "--out", str(tmp_path)]) == 0
        assert "12 ok" in capsys.readouterr().out
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
