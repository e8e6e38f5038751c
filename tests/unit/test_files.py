"""Files are written whole or not at all."""

import os
from contextlib import suppress
from pathlib import Path

import pytest

from vehiclemor.exceptions import MachineError
from vehiclemor.files import remove_leftovers, temporary_path, write_text, write_whole


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_write_leaves_the_old_file_until_the_new_one_is_complete(tmp_path: Path) -> None:
    path = write_text(tmp_path / "file.txt", "old")

    def write(temporary: Path) -> None:
        assert temporary.suffix == ".txt"
        temporary.write_text("new")
        assert path.read_text() == "old"

    def broken(temporary: Path) -> None:
        write(temporary)
        raise KeyboardInterrupt

    for writer, content in ((broken, "old"), (write, "new")):
        with suppress(KeyboardInterrupt):
            write_whole(path, writer)
        assert path.read_text() == content
        assert names_in(tmp_path) == ["file.txt"]


def test_a_disk_error_is_one_line(tmp_path: Path) -> None:
    def full(_: Path) -> None:
        raise OSError(28, "No space left on device")

    line = r"file\.txt: can't be written \(No space left on device\)"
    with pytest.raises(MachineError, match=line):
        write_whole(tmp_path / "file.txt", full)


def test_old_leftovers_alone_are_removed(tmp_path: Path) -> None:
    old, new = (temporary_path(tmp_path / "a.nc") for _ in range(2))
    for path in (old, new, tmp_path / "a.nc"):
        path.touch()
    for path in (old, tmp_path / "a.nc"):
        os.utime(path, (0, 0))
    remove_leftovers(tmp_path)
    assert names_in(tmp_path) == sorted([new.name, "a.nc"])
