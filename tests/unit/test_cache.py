"""Files are whole or not there; the cache is checked, made by one; what takes long is told."""

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
from vehiclemor.codegen.cache import cache_folder, cached_by_one_thread, from_cache
from vehiclemor.files import write_text, write_whole
from vehiclemor.progress import compiling, first_use

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
    def compute(content: bytes) -> bytes:
        made.append(content)
        return content

    return lambda name=NAME, content=CONTENT: from_cache(name, lambda: compute(content))


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


needs_modes = pytest.mark.skipif(os.name != "posix", reason="files have no modes of POSIX")
WRITABLE = [lambda path, mode=mode: path.chmod(mode) for mode in (0o777, 0o720, 0o702)]
FOREIGN = pytest.param(given_away, marks=needs_root)


@needs_modes
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


@needs_modes
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


@needs_modes
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
        cache._cache.cache_clear()
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


def test_what_threads_ask_for_together_is_made_once_and_tried_again_if_it_fails():
    tries, gate = [], threading.Barrier(8)

    @cached_by_one_thread
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


LOOP = """
from vehiclemor.codegen.loops import loops
loops(("simulation.path_loops",), ("kernel_path",))
"""


def test_a_first_use_is_announced_when_it_compiles_and_its_end_if_it_has_one(caplog):
    caplog.set_level(logging.INFO, "vehiclemor")
    with first_use("what is in the cache"):
        pass
    with compiling("a kernel", slow=False):
        pass
    with suppress(ZeroDivisionError), first_use("what fails"), compiling("kernel"):
        assert "first use of what fails" in caplog.messages[0]
        raise ZeroDivisionError
    with first_use("a model"):
        for part in ("derivation", "kernel"):
            with compiling(part):
                time.sleep(0.2)
    _, began, ended = caplog.messages
    assert "first use of a model" in began
    assert "a model: compiled in" in ended
    assert float(ended.split()[-2]) >= 0.4


def test_a_process_tells_of_what_it_compiles_and_nothing_when_it_is_there(tmp_path: Path):
    def told() -> list[str]:
        own = {**os.environ, "VEHICLEMOR_CACHE": str(tmp_path)}
        command = [sys.executable, "-c", LOOP]
        done = subprocess.run(command, env=own, capture_output=True, text=True, check=True)
        return done.stderr.splitlines()

    began, ended = told()
    assert began.startswith("first use of path_loops")
    assert ended.startswith("path_loops: compiled in ")
    assert told() == []


def test_of_several_that_want_a_file_one_makes_it_and_others_wait(folder):
    begun, finish, made = threading.Event(), threading.Event(), []

    def make() -> bytes:
        begun.set()
        assert finish.wait(60.0)
        made.append(1)
        return b"content"

    found: list[bytes] = []

    def want() -> None:
        found.append(from_cache("kernels/some-0123.o", make))

    threads = [threading.Thread(target=want) for _ in range(3)]
    threads[0].start()
    assert begun.wait(60.0)
    for thread in threads[1:]:
        thread.start()
    finish.set()
    for thread in threads:
        thread.join()
    assert (found, made) == ([b"content"] * 3, [1])
    # Nothing is left of the locks.
    assert [path.name for path in (folder / "kernels").iterdir()] == ["some-0123.o"]


def test_an_error_of_the_maker_is_its_own_and_frees_the_lock(folder):
    def fail() -> bytes:
        raise OSError("no compiler")

    with pytest.raises(OSError, match="no compiler"):
        from_cache("kernels/some-0123.o", fail)
    assert from_cache("kernels/some-0123.o", lambda: b"content") == b"content"


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
        assert list(tmp_path.iterdir()) == [path]
