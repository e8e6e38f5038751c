"""What is no result of the package is not replaced, and what is no file is not read."""

import os

import pytest

import vehiclemor as vm
from vehiclemor.exceptions import FileError, InputError, VehiclemorError
from vehiclemor.files import read_regular, write_text


@pytest.fixture
def device(tmp_path):
    path = tmp_path / "device"
    path.symlink_to("/dev/null")
    return path


@pytest.fixture
def pipe(tmp_path):
    path = tmp_path / "pipe.toml"
    os.mkfifo(path)
    return path


def test_devices_and_foreign_files_are_not_replaced_by_a_saved_model(tmp_path, device):
    rom, mine = vm.rom("double_wishbone"), tmp_path / "mine.txt"
    mine.write_text("mine")
    for path in (device, mine):
        with pytest.raises(InputError, match="no saved model"):
            rom.save(path, overwrite=True)
    assert mine.read_text() == "mine"
    assert device.is_symlink()
    saved = rom.save(tmp_path / "rom.nc")
    assert rom.save(saved, overwrite=True) == saved


def test_nothing_is_written_over_a_device(device):
    with pytest.raises(FileError, match="a device or pipe"):
        write_text(device, "text")
    assert device.is_symlink()


def test_a_report_replaces_no_other_file(tmp_path):
    stored = tmp_path / "mine.nc"
    stored.write_text("stored")
    with pytest.raises(InputError, match=r"does not end in \.html"):
        vm.write_report(["figure-11"], out=stored)
    assert stored.read_text() == "stored"


def test_pipes_devices_and_huge_files_are_not_read(tmp_path, pipe):
    large = tmp_path / "large.toml"
    large.write_text("a" * 2_000_000)
    deep = tmp_path / "deep.toml"
    deep.write_text(".".join(["a"] * 50_000) + " = 1")
    for path, reason in ((pipe, "device or pipe"), (large, "bytes"), (deep, "parts")):
        with pytest.raises(FileError, match=reason):
            vm.status(str(path))
    with pytest.raises(FileError, match="device or pipe"):
        read_regular(pipe, 10)
    with pytest.raises(VehiclemorError, match="device"):
        vm.load("/dev/zero")


def test_keys_of_few_parts_and_long_lists_are_read(tmp_path):
    path = tmp_path / "study.toml"
    values = ",".join(f"{1.0 + k / 100}" for k in range(60))
    path.write_text(
        'title = "many"\nmodel = "double_wishbone"\n'
        f'grid.frequency_factor = [{values}]\n[[methods]]\nmethod = "full_order"\n'
    )
    assert vm.status(str(path))["study"].runs == 60


def test_studies_are_named_by_paths_too(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text('title = "one"\nmodel = "double_wishbone"\n[[methods]]\nmethod = "pod"\n')
    results = tmp_path / "results"
    assert len(vm.compare(path, results=results)) > 0
    assert vm.figures([path], results=results)
    assert vm.write_report([path], results=results, out=tmp_path / "page.html").exists()
    assert vm.describe(path) is not None
