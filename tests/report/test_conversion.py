"""Results of studies in other formats hold what the combined dataset holds."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import vehiclemor as vm
from tests.study.small import small_study
from vehiclemor.cli import main
from vehiclemor.exceptions import VehiclemorError

GRID = "grid = { parameters.tie_rod_inner.z = [-0.1, -0.09], rank = [2, 3] }\n"


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Result of a study, and the folder that holds it."""
    folder = tmp_path_factory.mktemp("study")
    path = small_study(folder, GRID, "full_order", "pod", name="mine")
    return vm.run_study(path, results=folder / "results"), folder


@pytest.mark.parametrize("to", ["csv", "parquet"])
def test_a_table_has_a_row_for_each_point(study, tmp_path, to):
    if to == "parquet":
        pytest.importorskip("pyarrow")
    found, folder = study
    path = vm.convert(folder / "mine.toml", to, tmp_path / f"mine.{to}", folder / "results")
    read = {"csv": lambda p: pd.read_csv(p, keep_default_na=False), "parquet": pd.read_parquet}
    table = read[to](path)
    assert len(table) == 8
    # In the order of the grid: the first dimension changes last.
    first = next(str(name) for name in found["status"].dims if found.sizes[name] > 1)
    np.testing.assert_array_equal(table[first], np.repeat(found[first], 8 // found.sizes[first]))
    point = {"parameters.tie_rod_inner.z": -0.09, "rank": 3, "label": "pod"}
    row = table.query("`parameters.tie_rod_inner.z` == -0.09 and rank == 3 and label == 'pod'")
    here = found.sel(point).squeeze()
    assert row["status"].item() == "ok"
    assert row["cell_key"].item() == here["cell_key"].item()
    toe = float(here["rms_error"].sel(output="toe"))
    assert float(row["rms_error.toe"].item()) == pytest.approx(toe, rel=1e-14)
    columns = pd.read_csv(tmp_path / "mine.columns.csv", index_col="column", keep_default_na=False)
    assert set(columns.index) == set(table.columns)
    assert columns.loc["rms_error.toe", "unit"] == "rad"
    assert columns.loc["rms_error.spindle_y", "unit"] == "m"
    assert columns.loc["parameters.tie_rod_inner.z", "unit"] == "m"


def test_zarr_holds_the_whole_dataset(study, tmp_path):
    pytest.importorskip("zarr")
    found, folder = study
    arguments = ["--to", "zarr", "--out", str(tmp_path / "mine.zarr")]
    stored = str(folder / "results" / "studies" / "mine.nc")
    assert main(["convert", stored, *arguments]) == 0
    with xr.open_zarr(tmp_path / "mine.zarr", consolidated=False) as opened:
        for name, variable in found.variables.items():
            np.testing.assert_array_equal(opened[name].values, variable.values)


@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("mine.toml", {"to": "xls"}, "unknown format 'xls'"),
        ("mine.toml", {"to": "csv", "out": "there.csv"}, "exists already"),
        ("mine.toml", {"to": "csv", "out": "/"}, "exists already"),
        ("mine.toml", {"to": "csv", "results": "elsewhere"}, "no such result"),
        ("paper", {"to": "csv"}, "is a collection"),
    ],
)
def test_wrong_conversions_leave_nothing(study, tmp_path, monkeypatch, name, arguments, words):
    _, folder = study
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.csv").write_text("kept")
    given = folder / name if name.endswith(".toml") else name
    with pytest.raises(VehiclemorError, match=words):
        vm.convert(given, **({"results": folder / "results"} | arguments))
    assert [path.name for path in tmp_path.iterdir()] == ["there.csv"]
    assert (tmp_path / "there.csv").read_text() == "kept"
