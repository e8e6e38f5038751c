"""Files of the cache are checked by content, name and owner; nothing unchecked is executed."""

import ast
import logging
import os
import stat
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import pytest

from vehiclemor.codegen import cache
from vehiclemor.codegen.cache import cache_folder, fetched, once

PACKAGE = Path(cache.__file__).parents[1]
NAME = "kernels/some-0123.o"
CONTENT = b"some content"


@pytest.fixture(autouse=True)
def _warnings_alone(caplog: pytest.LogCaptureFixture) -> None:
    """On a busy machine it is told, too, what takes long to compile."""
    caplog.set_level(logging.WARNING, "vehiclemor")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache."""
    monkeypatch.setenv("VEHICLEMOR_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def made() -> list[bytes]:
    """What was made, one entry for each time."""
    return []


@pytest.fixture
def fetch(made: list[bytes]) -> Callable[..., bytes]:
    return lambda name=NAME, content=CONTENT: fetched(name, lambda: made.append(content) or content)


def flipped(content: bytes, bit: int) -> bytes:
    changed = bytearray(content)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


def test_what_is_whole_is_made_once(folder, fetch, made, caplog):
    # Where users have groups of their own, files that are made can be written by the group.
    before = os.umask(0o002)
    try:
        assert fetch() == fetch() == CONTENT
    finally:
        os.umask(before)
    assert len(made) == 1
    assert not caplog.records
    assert cache_folder() == folder
    # Nobody else can read or write it, and nothing unfinished is left.
    (path,) = (path for path in folder.rglob("*") if path.is_file())
    assert path == folder / NAME
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


def test_every_flipped_bit_every_other_length_and_name_is_repaired(folder, fetch, made, caplog):
    fetch("kernels/other-4567.o", b"other content")
    other = (folder / "kernels" / "other-4567.o").read_bytes()
    fetch()
    path = folder / NAME
    whole = path.read_bytes()
    parts = [b"", whole[: len(whole) // 2], whole[:64], whole[:-1], whole + b" ", whole[65:], other]
    damaged = [*parts, *(flipped(whole, bit) for bit in range(8 * len(whole)))]
    for damage in damaged:
        path.write_bytes(damage)
        assert fetch() == CONTENT
        assert path.read_bytes() == whole
        (record,) = caplog.records
        assert str(path) in record.getMessage()
        assert record.levelno == logging.WARNING
        caplog.clear()
    assert len(made) == 2 + len(damaged)


needs_root = pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root gives files away"
)


def given_away(path: Path) -> None:
    os.chown(path, 12345, -1)


WRITABLE = [lambda path, mode=mode: path.chmod(mode) for mode in (0o777, 0o720, 0o702)]
FOREIGN = pytest.param(given_away, marks=needs_root)


@pytest.mark.parametrize("change", [*WRITABLE, FOREIGN])
def test_a_file_that_others_can_write_is_made_again(folder, fetch, made, caplog, change):
    fetch()
    path = folder / NAME
    change(path)
    assert fetch() == fetch() == CONTENT
    (message,) = caplog.messages
    assert str(path) in message
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert path.stat().st_uid == os.geteuid()
    assert len(made) == 2


@pytest.mark.parametrize("change", [*WRITABLE, FOREIGN])
def test_a_folder_that_others_can_write_is_not_used(folder, fetch, caplog, change):
    folder.mkdir()
    change(folder)
    assert fetch() == CONTENT
    (message,) = caplog.messages
    assert str(folder) in message
    assert not list(folder.iterdir())
    # What stands in for it is this user's alone, the same for all of the process.
    instead = cache_folder()
    assert stat.S_IMODE(instead.stat().st_mode) == 0o700
    assert (instead / NAME).exists()
    assert cache_folder() == instead
    assert len(caplog.messages) == 1


def linked_file(planted: Path, foreign: Path) -> None:
    planted.mkdir(mode=0o700)
    (planted / Path(NAME).name).symlink_to(foreign / Path(NAME).name)


def folder_of_all(planted: Path, foreign: Path) -> None:
    foreign.rename(planted).chmod(0o777)


def folder_of_another(planted: Path, foreign: Path) -> None:
    given_away(foreign.rename(planted))


PLANTED = [
    linked_file,
    Path.symlink_to,
    folder_of_all,
    pytest.param(folder_of_another, marks=needs_root),
]


@pytest.mark.parametrize("plant", PLANTED)
def test_what_others_may_have_planted_on_the_way_is_not_read(folder, fetch, made, caplog, plant):
    fetch(content=b"foreign content")
    plant(folder / "kernels", (folder / "kernels").rename(folder.parent / "foreign"))
    for _ in range(2):
        assert fetch() == CONTENT
    assert len(made) == 2
    assert len(caplog.messages) == 1
    # Nothing is written where others may be.
    kept = [p for p in folder.parent.rglob("*.o") if p.read_bytes().endswith(CONTENT)]
    assert kept == ([folder / NAME] if plant is linked_file else [])


def test_where_nothing_can_be_written_every_process_compiles(folder, fetch, made, caplog):
    folder.mkdir()
    (folder / "kernels").write_text("not a folder")
    assert fetch() == fetch() == CONTENT
    assert len(made) == 2
    assert all("is not kept" in m for m in caplog.messages if "made again" not in m)


def test_the_environment_chooses_the_folder(tmp_path, monkeypatch, fetch, made):
    import platformdirs

    monkeypatch.setattr(platformdirs, "user_cache_path", lambda name: tmp_path / "own" / name)
    monkeypatch.chdir(tmp_path)
    for chosen, expected in (("", "own/vehiclemor"), (tmp_path / "a", "a"), ("b", "b")):
        cache._folder.cache_clear()
        monkeypatch.setenv("VEHICLEMOR_CACHE", str(chosen))
        assert cache_folder() == tmp_path / expected
    # A process that goes elsewhere keeps its cache.
    fetch()
    monkeypatch.chdir(tmp_path.parent)
    fetch()
    assert len(made) == 1
    assert cache_folder() == tmp_path / "b"


def test_the_cache_of_one_process_is_removed_at_its_end(tmp_path):
    (tmp_path / "file").write_text("")
    code = "from vehiclemor.codegen.cache import cache_folder; print(cache_folder())"
    chosen = {"VEHICLEMOR_CACHE": str(tmp_path / "file"), "TMPDIR": str(tmp_path)}
    command = [sys.executable, "-c", code]
    ran = subprocess.run(
        command, env=os.environ | chosen, capture_output=True, text=True, check=True
    )
    assert Path(ran.stdout.strip()).parent == tmp_path
    assert not Path(ran.stdout.strip()).exists()


def test_nothing_is_read_that_could_run_code():
    """No module of the package reads pickles, nor executes text."""
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = [alias.name for alias in node.names]
                names.append(getattr(node, "module", None) or "")
                assert not {"pickle", "marshal", "shelve", "dill", "cloudpickle"} & set(names), path
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id not in {"eval", "exec", "compile", "__import__"}, path


def test_what_threads_ask_for_together_is_made_once_and_tried_again_if_it_fails():
    tries, gate = [], threading.Barrier(8)

    @once
    def thing(name: str) -> object:
        tries.append(name)
        time.sleep(0.05)
        if len(tries) == 1:
            raise OSError
        return object()

    def ask(_: int) -> object:
        gate.wait()
        return thing("a")

    with suppress(OSError):
        thing("a")
    with ThreadPoolExecutor(8) as pool:
        found = set(pool.map(ask, range(8)))
    assert tries == ["a", "a"]
    assert len(found) == 1
