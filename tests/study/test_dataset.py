"""Datasets for methods of other programs, and the judge of their predictions."""

import json
import subprocess
import sys
from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.io import mmread

import vehiclemor as vm
from tests.study.small import small_study
from vehiclemor.cli import main
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.files import data_names
from vehiclemor.report.published import fixed_test_sets
from vehiclemor.study import timing
from vehiclemor.study.outside_methods import EQUATIONS, digest_of
from vehiclemor.study.plans.protocol import PREFIX, load_protocol, protocol_names, sampled_sets

OUTSIDE = Path(__file__).parents[2] / "examples" / "outside_method.py"
BOUNDED = ("spindle_y", "second_euler_angle")
CAR = """
bounds.yaw = { measure = "rms", bound = 1e-4 }
training = [{ maneuver = "lane_change" }]
validation = [{ maneuver = "lane_change", frequency = [1.3] }]
test = [{ maneuver = "lane_change", points = [[1.1, 1.2, 18.0]] }]
"""
TRUCK = """
bounds.roll = { measure = "relative", bound = 0.01 }
training = [{ maneuver = "road:1", parameters = { payload = [500.0] } }, { maneuver = "road:4" }]
validation = [{ maneuver = "road:2" }]
test = [{ maneuver = "road:3" }]
"""


def test_fixed_test_sets_never_change(capsys):
    protocols = [load_protocol(name) for name in data_names("studies") if name.startswith(PREFIX)]
    names = [protocol.test_set.partition(",")[0] for protocol in protocols]
    assert fixed_test_sets() == dict(zip(names, map(digest_of, protocols), strict=True))
    assert main(["cite"]) == 0
    told = capsys.readouterr().out
    assert all(f"{name}: digest {digest}" in told for name, digest in fixed_test_sets().items())


def stiffer(definition):
    """A truck whose frame is made otherwise, from the same parameters."""

    def structure(values):
        made = definition.structure(values)
        return replace(made, stiffness=1.001 * made.stiffness)

    return replace(definition, structure=structure)


@pytest.mark.parametrize("name", protocol_names())
def test_other_physics_are_another_test_set(name):
    protocol = load_protocol(protocol_names()[name])
    model = protocol.model

    def digest_with(**changes):
        # Some of these can't be assembled, which a model that is made would say.
        other = copy(model)
        vars(other).update(changes)
        return digest_of(replace(protocol, model=other))

    assert digest_with() == digest_of(protocol)
    entries = model.parameters.entries
    first, entry = next(iter(entries.items()))
    value = np.multiply(entry.value, 1.0 + 1e-12).tolist()
    changed = entries | {first: entry.model_copy(update={"value": value})}
    values = replace(model.parameters, entries=changed)
    found = [digest_with(parameters=values)]
    for function in filter(model.kernels.__contains__, EQUATIONS):
        kernel = model.equations.sources[function]
        other = replace(kernel, listed=kernel.listed.replace("multiply", "add", 1))
        found.append(digest_with(equations=Kernels([*model.equations.sources.values(), other])))
    if model.kind == "structural":
        found.append(digest_with(definition=stiffer(model.definition)))
    assert len({digest_of(protocol), *found}) == 1 + len(found)


def read(path):
    return xr.load_dataset(path, decode_times=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, protocol_text):
    """Folder with the small protocol, its dataset and its results."""
    folder = tmp_path_factory.mktemp("dataset")
    (folder / "small.toml").write_text(protocol_text)
    vm.dataset(folder / "small.toml", folder / "data")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(timing, "PROTOCOL_ROUNDS", 2)
        vm.run_study(folder / "small.toml", results=folder)
    return folder


@pytest.fixture
def truth(folder, monkeypatch):
    """The test set as predictions of its bounded outputs."""
    monkeypatch.chdir(folder)
    known = read("data/test.nc")
    attributes = {name: known.attrs[name] for name in ("model", "test_set_digest")}
    return xr.Dataset({name: known[name] for name in BOUNDED}, attrs=attributes)


def judged(found):
    found.to_netcdf("found.nc")
    return vm.judge("found.nc", "data", ".")


def test_the_truth_has_no_error_and_replay_the_row_of_the_protocol(truth):
    assert judged(truth)[["score", "misses"]].iloc[0].tolist() == [0, 0]
    protocol = load_protocol("small.toml")
    scenarios = sampled_sets(protocol)["drawn"]
    assert [s.label for s in scenarios] == read("data/test.nc")["label"].values.tolist()
    replay = vm.reduce("double_wishbone", "replay", training=list(protocol.sets["training"]))
    runs = [replay.simulate(scenario.maneuver) for scenario in scenarios]
    for name in BOUNDED:
        truth[name] = "sample", np.concatenate([run[name] for run in runs])
    truth["trusted"] = "run", [int(run.status == "ok") for run in runs]
    rows = judged(truth)
    assert rows["label"][1] == "replay"
    for name in ("runs", "misses", "silent", "flagged", "score", "median_score", "output"):
        assert rows[name][0] == rows[name][1], name
    assert rows["score"][0] > 1.0


def test_a_run_without_numbers_is_missed_and_no_error(truth):
    truth["spindle_y"][:3] = np.nan
    row = judged(truth.assign(trusted=("run", np.ones(5)))).iloc[0]
    assert row[["misses", "silent", "median_score"]].tolist() == [1, 0, 0.0]
    assert (row["score"], row["output"]) == (np.inf, "spindle_y")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda found: found.assign_attrs(test_set_digest="0"), "test_set_digest is '0'"),
        (lambda found: found.drop_vars("spindle_y"), "has no spindle_y"),
        (lambda found: found.isel(sample=slice(9)), "(9,)"),
        (lambda found: found.assign(trusted=("run", [1])), "trusted"),
    ],
)
def test_wrong_predictions_are_refused_in_one_line(truth, change, words, capsys):
    change(truth).to_netcdf("wrong.nc")
    assert main(["judge", "wrong.nc", "--dataset", "data"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line
    for command in ("judge wrong.nc --dataset none", "dataset small.toml --out data"):
        assert main(command.split()) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1


def test_a_method_of_another_program_competes(truth, capsys):
    command = [sys.executable, str(OUTSIDE), "data", "out.nc"]
    subprocess.run(command, check=True)
    assert main(["judge", "out.nc", "--dataset", "data", "--results", ".", "--json"]) == 0
    row, other, *_ = json.loads(capsys.readouterr().out)
    assert (row["label"], other["label"]) == ("polynomials of degree 3", "replay")
    assert 0.0 < row["median_score"] < row["score"] < other["score"]


def test_rates_are_those_of_the_states_and_histories_have_units(tmp_path):
    study = small_study(tmp_path, CAR, "replay", model="independent_suspension_vehicle")
    data = read(vm.dataset(study, tmp_path / "data") / "test.nc")
    assert (data["initial_speed"].item(), data["yaw"].attrs["bound"]) == (18.0, 1e-4)
    for name in data.attrs["states"].split():
        x, rate = data[name].values, data[f"rate_of_{name}"].values
        mean = (rate[:-2] + 4.0 * rate[1:-1] + rate[2:]) / 6.0
        slope = (x[2:] - x[:-2]) / (data["time"].values[2:] - data["time"].values[:-2])
        np.testing.assert_allclose(slope, mean, atol=1e-4 * np.ptp(rate))
        assert x[0] == data["initial_state"].sel(state=name)
    histories = [variable for variable in data.variables.values() if "sample" in variable.dims]
    assert len(histories) == 1 + 1 + 28 + 28 + 33
    assert all({"units", "long_name"} <= set(variable.attrs) for variable in histories)


def test_a_truck_has_payloads_and_the_matrices_of_its_structure(tmp_path):
    study = small_study(tmp_path, TRUCK, "replay", model="flexible_truck")
    folder = vm.dataset(study, tmp_path / "data")
    assert read(folder / "training.nc")["parameter_payload"].values.tolist() == [500.0, 2000.0]
    matrices = {p.stem: mmread(p, spmatrix=False) for p in (folder / "matrices").iterdir()}
    structure = vm.model("flexible_truck").system.structure
    for name in ("mass", "stiffness", "dampers", "ports"):
        assert abs(matrices[name] - getattr(structure, name)).max() == 0.0
    assert abs(matrices["outputs_force"] - structure.outputs[3]).max() == 0.0
    empty = vm.model("flexible_truck", {"payload": 0.0}).system.structure.mass
    assert abs(matrices["mass"] - 2000.0 * matrices["mass_by_payload"] - empty).max() < 1e-6
