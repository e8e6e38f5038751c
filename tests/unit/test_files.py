"""What is no result of this package is never replaced; what is no file is never waited for."""

import os
import socket

import pytest

import vehiclemor as vm
from vehiclemor.cli import main
from vehiclemor.exceptions import VehiclemorError
from vehiclemor.exporting import fmu

if os.name != "posix":
    pytest.skip("pipes, sockets and devices are those of POSIX", allow_module_level=True)

MODEL, CAR = "double_wishbone", "independent_suspension_vehicle"


def listening(path):
    with socket.socket(socket.AF_UNIX) as end:
        end.bind(str(path))


# What may stand at a path.
OTHERS = {
    "text": lambda path: path.write_text("precious"),
    "folder": lambda path: path.mkdir(),
    "pipe": os.mkfifo,
    "socket": listening,
    "device": lambda path: path.symlink_to("/dev/zero"),
    "nothing": lambda path: path.symlink_to("nowhere"),
}


@pytest.fixture(params=OTHERS)
def other(request, tmp_path, monkeypatch):
    """Put something at a path here; asserts at the end that it is still there, and alone."""
    monkeypatch.chdir(tmp_path)
    before = {}

    def put(name):
        path = tmp_path / name
        OTHERS[request.param](path)
        before[path] = path.lstat().st_ino
        return name

    yield put
    assert {path: path.lstat().st_ino for path in tmp_path.iterdir()} == before


@pytest.fixture(scope="module")
def run():
    """A run, to be drawn."""
    return vm.simulate(MODEL)


WRITERS = {
    "a.nc": lambda path, _: vm.rom(MODEL).save(path, overwrite=True),
    "a": lambda path, _: vm.export(MODEL, "c", path, overwrite=True),
    "a.fmu": lambda path, _: vm.export(MODEL, "fmu", path, overwrite=True),
    "a.casadi": lambda path, _: vm.export(MODEL, "casadi", path, overwrite=True),
    "a.html": lambda path, _: vm.write_report("figure-11", out=path),
    "a.txt": lambda path, _: vm.write_report("figure-11", out=path),
    "a.png": lambda path, run: vm.plot(run, out=path),
    "a.svg": lambda path, run: vm.plot(run, out=path),
    "a.pdf": lambda path, run: vm.plot(run, out=path),
    "a.gif": lambda path, _: vm.animate(vm.simulate(CAR), duration=0.5, out=path),
    "b.csv": lambda path, _: vm.convert(path, "csv", out=path),
    "b": lambda path, _: vm.dataset(MODEL, out=path),
}


@pytest.mark.parametrize("name", WRITERS)
def test_what_is_no_result_is_not_replaced(other, run, name):
    path = other(name)
    with pytest.raises(VehiclemorError, match=name):
        WRITERS[name](path, run)


def test_results_are_replaced_by_their_kind_alone(run, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    # What is not optimised compiles soon.
    monkeypatch.setattr(fmu, "OPTIMISED", ("-std=c99", "-O0"))
    for _ in range(2):
        for name in ("a.nc", "a", "a.fmu", "a.casadi", "a.png", "a.svg", "a.pdf", "a.gif"):
            WRITERS[name](name, run)
        assert main(f"simulate {MODEL} --out run.nc".split()) == 0
    for command in (
        f"simulate {MODEL} --out a.nc",
        f"export {MODEL} --to c --overwrite --out a.fmu",
    ):
        assert main(command.split()) == 2
    with pytest.raises(VehiclemorError, match="no saved model"):
        vm.rom(MODEL).save("run.nc", overwrite=True)


READERS = {
    "a.toml": [vm.run_study, vm.status, vm.describe, vm.compare, vm.figures],
    "a.nc": [vm.load, vm.plot, lambda path: vm.convert(path, "csv")],
    "a.csv": [vm.Signal.from_csv],
    "b.toml": [lambda path: vm.model(MODEL, None, path)],
    "test.nc": [lambda path: vm.judge(path, ".")],
}


@pytest.mark.parametrize("name", READERS)
def test_what_is_no_file_is_refused_at_once(other, name):
    path = other(name)
    for read in READERS[name]:
        with pytest.raises(VehiclemorError):
            read(path)
