"""A study killed half-way resumes to the same dataset; the number of processes changes nothing."""

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from tests.study.small import assert_same, small_study
from vehiclemor.files import TEMPORARY, temporary_path
from vehiclemor.netcdf_file import write_dataset
from vehiclemor.study.run import run_studies

GRID = """
training = "nominal"

[grid]
frequency_factor = { first = 0.8, last = 1.4, count = 4 }
amplitude_factor = [0.9, 1.0, 1.1, 3.0]
rank = [2, 3]
"""
METHODS = "full_order", "replay", "pod"


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    return small_study(tmp_path_factory.mktemp("study"), GRID, *METHODS)


@pytest.fixture(scope="module")
def uninterrupted(study, tmp_path_factory) -> xr.Dataset:
    folder = tmp_path_factory.mktemp("one")
    return run_studies(str(study), folder, jobs=1)["small"]


def test_two_processes_give_the_same_dataset_and_store_it(study, uninterrupted, tmp_path):
    written = run_studies(str(study), tmp_path, jobs=2)["small"]
    assert_same(uninterrupted, written)
    with xr.open_dataset(tmp_path / "studies" / "small.nc") as read:
        xr.testing.assert_identical(written, read.load())


def test_a_killed_study_resumes_to_the_same_dataset(study, uninterrupted, tmp_path):
    command = [sys.executable, "-m", "vehiclemor", "run", str(study), "--jobs", "2"]
    process = subprocess.Popen([*command, "--results", str(tmp_path)], stdout=subprocess.PIPE)
    cells = tmp_path / "cells"
    deadline = time.monotonic() + 120
    while len(list(cells.glob("??/*"))) < 10:
        assert process.poll() is None, "the study ended before it could be killed"
        assert time.monotonic() < deadline
        time.sleep(0.01)
    process.kill()
    # Workers hold this end of the pipe for as long as they live, which was 330 s.
    process.communicate(timeout=60)
    finished = {path: path.stat().st_mtime_ns for path in cells.glob("??/*")}
    for path in (half := temporary_path(cells / "left"), *cells.glob(f"{TEMPORARY}*")):
        path.write_bytes(b"half a file")
        os.utime(path, (0, 0))
    resumed = run_studies(str(study), tmp_path)["small"]
    assert 10 <= len(finished) < 80
    for path, written in finished.items():
        assert path.stat().st_mtime_ns == written, "a finished cell was computed again"
    assert not half.exists()
    assert_same(uninterrupted, resumed)


def test_two_drivers_at_once_give_the_same_dataset(study, uninterrupted, tmp_path):
    command = [sys.executable, "-m", "vehiclemor", "run", str(study), "--results", str(tmp_path)]
    drivers = [subprocess.Popen(command, stdout=subprocess.DEVNULL) for _ in range(2)]
    assert [driver.wait(timeout=240) for driver in drivers] == [0, 0]
    assert not list(tmp_path.rglob(f"{TEMPORARY}*"))
    assert_same(uninterrupted, run_studies(str(study), tmp_path)["small"])


def test_unreachable_cells_are_results(uninterrupted):
    status = uninterrupted["status"].sel(amplitude_factor=3.0)
    assert (status == "unreachable").all()
    messages = uninterrupted["message"].sel(amplitude_factor=3.0).values.ravel()
    assert all("reachable range" in message for message in messages)
    reached = uninterrupted.sel(amplitude_factor=[0.9, 1.0, 1.1])
    assert (reached["status"] == "ok").all()
    assert np.isfinite(reached["rms_error"]).all()
    assert np.isnan(uninterrupted["rms_error"].sel(amplitude_factor=3.0)).all()


def test_dataset_is_labelled(uninterrupted):
    for name, variable in uninterrupted.variables.items():
        assert variable.attrs.get("long_name"), name
    # Outputs differ in their units: each has its own beside it.
    assert set(uninterrupted["rms_error"]["output_unit"].values) == {"m", "rad"}
    assert "units" not in uninterrupted["rms_error"].attrs
    assert {"source", "versions", "machine", "kernel_hash"} <= set(uninterrupted.attrs)


def test_a_dataset_laid_out_by_other_source_is_combined_again(study, uninterrupted, tmp_path):
    run_studies(str(study), tmp_path)
    path = tmp_path / "studies" / "small.nc"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("vehiclemor.study.plans.results.layout_digest", lambda: "older")
        path.unlink()
        older = run_studies(str(study), tmp_path)["small"]
    write_dataset(older.drop_vars("rms_error"), path)
    assert_same(uninterrupted, run_studies(str(study), tmp_path)["small"])
