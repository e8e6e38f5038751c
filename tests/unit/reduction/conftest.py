"""Saved models of all kinds."""

import pytest

import vehiclemor as vm
from tests.models import CAR
from vehiclemor.reduction.reduced_model import shipped_folder


@pytest.fixture(scope="module")
def car():
    """A car whose equations are features."""
    return vm.reduce(CAR, "linear_single_track", training="nominal")


@pytest.fixture
def saved(car, tmp_path):
    return car.save(tmp_path / "car.nc")


@pytest.fixture(scope="module")
def contents(car, tmp_path_factory):
    """Files of all kinds of reduced models."""
    made = {
        "bicycle": car,
        # Few control periods: a file of many is written slowly.
        "pod": vm.reduce(CAR, "pod", training="nominal", formulation="state", control_period=5.0),
        "windows": vm.reduce("double_wishbone", "pod", training="nominal"),
        "replay": vm.reduce("double_wishbone", "replay"),
    }
    folder = tmp_path_factory.mktemp("saved")
    paths = {name: rom.save(folder / f"{name}.nc") for name, rom in made.items()}
    names = {"car": CAR, "map": "double_wishbone", "guarded": "high_fidelity_vehicle"}
    paths |= {name: shipped_folder() / f"{model}.nc" for name, model in names.items()}
    # What the full models need is compiled.
    _ = [vm.load(path) for path in paths.values()]
    return {name: path.read_bytes() for name, path in paths.items()}
