"""What can't be exported, or not there: one line, and nothing is half written."""

from pathlib import Path

import pytest

import vehiclemor as vm
from tests.reducing import fitted
from vehiclemor.cli import main
from vehiclemor.exporting import libraries
from vehiclemor.reduction.reduced_model import ReducedOrderModel

CAR = "independent_suspension_vehicle"


@pytest.mark.parametrize(
    ("model", "arguments", "words"),
    [
        (CAR, {"to": "matlab"}, "'matlab'"),
        (CAR, {"to": "c", "step": 0.0}, "step: 0 s"),
        (CAR, {"to": "c", "out": "no-such-folder/car"}, "no-such-folder"),
        (CAR, {"to": "jax", "out": "car.py"}, "jax"),
        (3, {"to": "casadi"}, "model: 3"),
    ],
)
def test_wrong_arguments(tmp_path, monkeypatch, model, arguments, words):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(vm.VehiclemorError, match=words):
        vm.export(model, **arguments)
    assert not list(tmp_path.iterdir())


def test_what_has_no_equations_to_export(model, nominal, monkeypatch):
    reduced = fitted(model, nominal, "pod", rank=2)
    with pytest.raises(vm.VehiclemorError, match="double_wishbone_pod"):
        vm.export(ReducedOrderModel(model, "pod", {}, (), reduced), "casadi")
    with pytest.raises(vm.VehiclemorError, match="table"):
        vm.export(vm.rom("double_wishbone"), "sympy")
    # Missing packages are named.
    monkeypatch.setattr(libraries, "find_spec", lambda _: None)
    with pytest.raises(vm.VehiclemorError, match=r"vehiclemor\[casadi\]"):
        vm.export(vm.rom(CAR), "casadi")


def test_a_compiler_that_fails(tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "false")
    with pytest.raises(vm.VehiclemorError, match="can't compile the model: status 1"):
        vm.export(vm.rom(CAR), "fmu", tmp_path / "car.fmu")
    assert not list(tmp_path.iterdir())


def test_nothing_is_replaced_unasked(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    command = ["export", CAR, "--method", "shipped", "--to", "c"]
    assert main(command) == 0
    folder = tmp_path / f"{CAR}_{vm.rom(CAR).method}"
    assert capsys.readouterr().out == f"written: {folder.name}\n"
    written = {path.name: path.read_text() for path in folder.iterdir()}
    assert main(command) == 2
    assert "--overwrite" in capsys.readouterr().err
    (folder / "vehiclemor_model.c").write_text("")
    assert main([*command, "--overwrite"]) == 0
    assert {path.name: path.read_text() for path in folder.iterdir()} == written
    assert [path.name for path in tmp_path.iterdir()] == [folder.name]


def test_what_is_not_ours_is_never_replaced(tmp_path):
    letter = tmp_path / "mine" / "letter.txt"
    letter.parent.mkdir()
    letter.write_text("dear")
    for to in ("c", "fmu"):
        with pytest.raises(vm.VehiclemorError, match="mine"):
            vm.export(CAR, to, letter.parent, overwrite=True)
    assert letter.read_text() == "dear"


def test_a_failure_on_the_way_leaves_what_was_there(tmp_path, monkeypatch):
    path = vm.export(vm.rom(CAR), "c", tmp_path / "car")
    before = {file.name: file.read_text() for file in path.iterdir()}
    write = Path.write_text

    def full(path, *given, **further):
        if path.suffix == ".h":
            raise OSError(28, "No space left on device")
        return write(path, *given, **further)

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(vm.VehiclemorError, match="No space left"):
        vm.export(CAR, "c", path, overwrite=True)
    assert {file.name: file.read_text() for file in path.iterdir()} == before
    assert list(tmp_path.iterdir()) == [path]
