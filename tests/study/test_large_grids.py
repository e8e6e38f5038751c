"""Grids that are too large to be held: experiments and results are made part by part."""

import weakref

import netCDF4
import numpy as np
import pytest
import xarray as xr

from tests.study.small import small_study
from vehiclemor.errors import SpoiledError
from vehiclemor.study import netcdf_file, run, workers
from vehiclemor.study.experiment import Experiment
from vehiclemor.study.netcdf_file import read_dataset
from vehiclemor.study.plans import grid_results
from vehiclemor.study.plans.grid import expand
from vehiclemor.study.plans.study_file import StudyFile
from vehiclemor.study.run import run_studies

GRID = "grid = { amplitude_factor = [0.5, 0.7, 0.9], rank = [2, 3] }\n"


def test_experiments_of_a_grid_are_made_when_they_are_asked_for(monkeypatch):
    made, alive = [], []
    make = Experiment.__init__

    def counted(self, *given, **further):
        made.append(weakref.ref(self))
        make(self, *given, **further)

    monkeypatch.setattr(Experiment, "__init__", counted)
    given = {
        "title": "t",
        "model": "double_wishbone",
        "grid": {"amplitude_factor": np.linspace(0.5, 1.0, 60).tolist()},
        "methods": [{"method": "pod"}, {"method": "full_order"}],
    }
    grid = expand("mine", StudyFile.model_validate(given))
    assert len(grid.unique) == 120
    for number, (key, cell) in enumerate(grid.unique.items()):
        if number % 40 == 0:
            assert cell.key == key
            alive.append(sum(reference() is not None for reference in made))
    assert len(made) >= 240
    assert max(alive) < 10


def test_a_dataset_in_parts_is_the_same_as_in_one(tmp_path, monkeypatch):
    path = small_study(tmp_path, GRID, "full_order", "pod", name="mine")
    whole = run_studies(str(path), tmp_path / "results")["mine"]
    file = tmp_path / "results" / "studies" / "mine.nc"
    file.unlink()
    held, given = [], []
    part = grid_results._part
    call = workers.Workers.__call__
    monkeypatch.setattr(
        grid_results, "_part", lambda *given: held.append(part(*given).sizes) or part(*given)
    )
    monkeypatch.setattr(
        workers.Workers, "__call__", lambda self, g: given.append(len(g)) or call(self, g)
    )
    monkeypatch.setattr(run, "AT_ONCE", 4)
    for module in (netcdf_file, grid_results):
        monkeypatch.setattr(module, "PART", 3 * whole.nbytes // 12)
    monkeypatch.setattr(netcdf_file, "LARGE", 1)
    found = run_studies(str(path), tmp_path / "results")["mine"]
    assert given == [4, 4, 1]
    assert len(held) > 2
    # Nothing has been read before it is asked for.
    assert all(not isinstance(v.variable._data, np.ndarray) for v in found.data_vars.values())
    xr.testing.assert_identical(found.load(), whole)
    found.close()
    again = read_dataset(file, "source", "vehiclemor")
    xr.testing.assert_identical(again.load(), whole)
    again.close()
    with netCDF4.Dataset(file, "a") as opened:
        opened["rms_error"][0, 2, 0, 0, 0, 0] = 7.0
    with pytest.raises(SpoiledError, match="not what was written"):
        read_dataset(file, "source", "vehiclemor")
