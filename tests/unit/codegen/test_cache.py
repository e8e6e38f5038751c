"""Files of the cache are checked by content, name and owner; nothing unchecked is executed."""

import ast
import errno
import logging
import os
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.unit import standard_problems
from vehiclemor.codegen import (
    cache,
    compiler,
    derivation,
    kernels,
    llvm_kernels,
    loops,
)
from vehiclemor.codegen.cache import cache_folder, fetched
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.simulation.build import build
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.paths import PATH_LOOPS

PACKAGE = Path(cache.__file__).parents[1]
FLIPS = 200
NAME = "kernels/some-0123.o"
OTHERS = "other users can write it"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache."""
    chosen = tmp_path / "cache"
    monkeypatch.setenv("VEHICLEMOR_CACHE", str(chosen))
    return chosen


@pytest.fixture
def made() -> list[bytes]:
    """What was made, one entry for each time."""
    return []


@pytest.fixture
def fetch(made: list[bytes]) -> Callable[..., bytes]:
    def fetch(name: str = NAME, content: bytes = b"some content") -> bytes:
        def make() -> bytes:
            made.append(content)
            return content

        return fetched(name, make)

    return fetch


def flipped(content: bytes, bit: int) -> bytes:
    changed = bytearray(content)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


def test_what_is_whole_is_made_once(folder, fetch, made, caplog):
    assert fetch() == fetch() == b"some content"
    assert len(made) == 1
    assert not caplog.records
    # Nobody else can read or write it, and nothing unfinished is left.
    (path,) = (path for path in folder.rglob("*") if path.is_file())
    assert path == folder / NAME
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


def test_every_single_flipped_bit_and_every_other_length_is_repaired(folder, fetch, made, caplog):
    fetch()
    path = folder / NAME
    whole = path.read_bytes()
    hashed, content = whole[:64], whole[65:]
    others = [b"", whole[: len(whole) // 2], hashed, whole[:-1], whole + b" ", content]
    damaged = [*others, *(flipped(whole, bit) for bit in range(8 * len(whole)))]
    for damage in damaged:
        path.write_bytes(damage)
        assert fetch() == b"some content"
        assert path.read_bytes() == whole
        (record,) = caplog.records
        assert str(path) in record.getMessage()
        assert record.levelno == logging.WARNING
        caplog.clear()
    assert len(made) == 1 + len(damaged)


def test_a_whole_file_under_another_name_is_refused(folder, fetch, made):
    fetch()
    (folder / NAME).rename(folder / "kernels" / "other-4567.o")
    assert fetch("kernels/other-4567.o", b"other content") == b"other content"
    assert len(made) == 2


needs_root = pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root gives files away"
)


def opened(mode: int) -> Callable[[Path], None]:
    return lambda path: path.chmod(mode)


def given_away(path: Path) -> None:
    os.chown(path, 12345, -1)


WRITABLE = [(opened(mode), OTHERS) for mode in (0o666, 0o620, 0o602)]
FOREIGN = pytest.param(given_away, "it belongs to another user", marks=needs_root)


@pytest.mark.parametrize(("change", "reason"), [*WRITABLE, FOREIGN])
def test_a_file_that_others_can_write_is_made_again(folder, fetch, made, caplog, change, reason):
    fetch()
    path = folder / NAME
    change(path)
    assert fetch() == b"some content"
    (message,) = caplog.messages
    assert str(path) in message
    assert reason in message
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert path.stat().st_uid == os.geteuid()
    fetch()
    assert len(made) == 2


@pytest.mark.parametrize(("change", "reason"), [*WRITABLE, FOREIGN])
def test_a_folder_that_others_can_write_is_not_used(folder, fetch, caplog, change, reason):
    folder.mkdir()
    change(folder)
    folder.chmod(folder.stat().st_mode | 0o700)
    assert fetch() == b"some content"
    (message,) = caplog.messages
    assert str(folder) in message
    assert reason in message
    assert not list(folder.iterdir())
    # What stands in for it is this user's alone, the same for all of the process.
    instead = cache_folder()
    assert stat.S_IMODE(instead.stat().st_mode) == 0o700
    assert (instead / NAME).exists()
    assert cache_folder() == instead
    assert len(caplog.messages) == 1


def other_files(folder: Path, fetch: Callable[..., bytes]) -> Path:
    """A folder as of the cache, with a whole file of another content."""
    fetch(content=b"foreign content")
    return (folder / "kernels").rename(folder.parent / "foreign")


def linked_file(folder: Path, fetch: Callable[..., bytes]) -> None:
    foreign = other_files(folder, fetch)
    (folder / "kernels").mkdir(mode=0o700)
    (folder / NAME).symlink_to(foreign / Path(NAME).name)


def linked_folder(folder: Path, fetch: Callable[..., bytes]) -> None:
    (folder / "kernels").symlink_to(other_files(folder, fetch))


def folder_of_all(folder: Path, fetch: Callable[..., bytes]) -> None:
    other_files(folder, fetch).rename(folder / "kernels").chmod(0o777)


def folder_of_another(folder: Path, fetch: Callable[..., bytes]) -> None:
    given_away(other_files(folder, fetch).rename(folder / "kernels"))


@pytest.mark.parametrize(
    ("plant", "told"),
    [
        (linked_file, "it is a link"),
        (linked_folder, "it is a link"),
        (folder_of_all, OTHERS),
        pytest.param(folder_of_another, "it belongs to another user", marks=needs_root),
    ],
)
def test_what_others_may_have_planted_on_the_way_is_not_read(
    folder, fetch, made, caplog, plant, told
):
    plant(folder, fetch)
    for _ in range(2):
        assert fetch() == b"some content"
    assert len(made) == 2
    (message,) = caplog.messages
    assert told in message
    # Nothing is written where others may be.
    kept = [p for p in folder.parent.rglob("*.o") if p.read_bytes().endswith(b"some content")]
    assert kept == ([folder / NAME] if plant is linked_file else [])


def test_a_folder_made_by_a_generous_user_is_trusted(folder, fetch, made):
    # Where users have groups of their own, files that are made can be written by the group.
    before = os.umask(0o002)
    try:
        fetch()
        fetch()
    finally:
        os.umask(before)
    assert cache_folder() == folder
    assert len(made) == 1


def test_a_folder_that_cannot_be_made_is_replaced(tmp_path, monkeypatch, fetch, caplog):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("VEHICLEMOR_CACHE", str(tmp_path / "file" / "below"))
    assert fetch() == b"some content"
    assert len(caplog.messages) == 1
    assert "every process compiles for itself" in caplog.text


def test_a_file_that_cannot_be_written_is_made_by_every_process(folder, fetch, made, caplog):
    folder.mkdir()
    (folder / "kernels").write_text("not a folder")
    assert fetch() == fetch() == b"some content"
    assert len(made) == 2
    assert all("is not kept" in m for m in caplog.messages if "made again" not in m)


def test_without_space_a_temporary_folder_keeps_what_is_made(
    folder, fetch, made, monkeypatch, tmp_path, caplog
):
    written = Path.write_bytes

    def full(path: Path, content: bytes) -> int:
        if folder in path.parents:
            raise OSError(errno.ENOSPC, "No space left on device")
        return written(path, content)

    monkeypatch.setattr(Path, "write_bytes", full)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    for _ in range(2):
        assert fetch() == b"some content"
        assert fetch("kernels/other-0.o") == b"some content"
    assert len(made) == 2
    (message,) = caplog.messages
    assert "No space left on device" in message
    assert len(list(tmp_path.glob("vehiclemor-*/kernels/*.o"))) == 2


def test_the_environment_chooses_the_folder(tmp_path, monkeypatch):
    import platformdirs

    monkeypatch.delenv("VEHICLEMOR_CACHE", raising=False)
    monkeypatch.setattr(platformdirs, "user_cache_path", lambda name: tmp_path / "own" / name)
    cache._folders.cache_clear()
    assert cache_folder() == tmp_path / "own" / "vehiclemor"
    cache._folders.cache_clear()
    monkeypatch.setenv("VEHICLEMOR_CACHE", str(tmp_path / "chosen"))
    assert cache_folder() == tmp_path / "chosen"


def test_a_process_that_goes_elsewhere_keeps_its_cache(tmp_path, monkeypatch, fetch, made):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("VEHICLEMOR_CACHE", "relative")
    fetch()
    monkeypatch.chdir(tmp_path.parent)
    fetch()
    assert len(made) == 1
    assert cache_folder() == tmp_path / "relative"


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


# Machine code and derivations


@pytest.fixture(scope="module")
def vehicle() -> DynamicModel:
    return build("independent_suspension_vehicle")


def test_flipped_bits_in_cached_code_give_no_wrong_number(
    vehicle, folder, monkeypatch, rng, caplog
):
    """Random bits of kernels of a vehicle, of a compiled loop and of a derivation."""
    sources, x, u = vehicle.equations.sources, vehicle.start("dropped"), np.array([0.03])
    sizes = {"derivative": len(x), "outputs": len(vehicle.outputs)}

    def numbers() -> list:
        """What is computed by files that are loaded anew, as in another process."""
        results, address = [], 0
        for name, size in sizes.items():
            address, function, owner = kernels._machine.__wrapped__(sources[name])
            results.append(np.full(size, np.nan))
            function(*(array.ctypes.data for array in (x, u, vehicle.constants, results[-1])))
        path = np.full((2, size), np.nan)
        (loop,) = loops._loops.__wrapped__(PATH_LOOPS, ("kernel_path",), (), ()).values()
        states, inputs = np.tile(x, (2, 1)), np.tile(u, (2, 1))
        loop(states, inputs, np.array([address]), vehicle.constants, path)
        del owner
        return [
            *results,
            path,
            derivation.derivation("standard_problems", standard_problems.derive),
        ]

    expected = numbers()
    contents = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert sorted({path.parent.name for path in contents}) == [
        "derivations",
        "kernels",
        "loops",
        "sources",
    ]
    # What is made again takes no time here: it is what the compiler has made before.
    made = {p.name.partition("-")[0]: whole.split(b"\n", 1)[1] for p, whole in contents.items()}
    monkeypatch.setattr(llvm_kernels, "kernel_module", lambda kernels, _: kernels[0].name)
    monkeypatch.setattr(compiler, "compiled_module", lambda name: made[name])
    monkeypatch.setattr(compiler, "compiled_loops", lambda *_: made["path_loops"])
    places = list(contents)
    caplog.clear()
    for _ in range(FLIPS):
        path = places[int(rng.integers(len(places)))]
        path.write_bytes(flipped(contents[path], int(rng.integers(8 * len(contents[path])))))
        *found, derived = numbers()
        for result, wanted in zip(found, expected[:-1], strict=True):
            np.testing.assert_array_equal(result, wanted)
        assert derived == expected[-1]
        assert [str(path) in message for message in caplog.messages] == [True]
        assert path.read_bytes() == contents[path]
        caplog.clear()


def test_planted_files_are_refused(folder, caplog):
    """A derivation or machine code that says something else, with any hash but its own."""
    source = kernels.kernel_sources("def planted(_x, _result):\n    _result[0] = 2.0 * _x[0]\n")
    other = kernels.kernel_sources("def planted(_x, _result):\n    _result[0] = 9.0 * _x[0]\n")
    files = []
    for sources in (source, other):
        kernels._machine.__wrapped__(sources["planted"])
        files.append(next(p for p in folder.rglob("*.o") if p not in files))
    files[0].write_bytes(files[1].read_bytes())
    result = np.empty(1)
    Kernels(source).call("planted", np.array([1.5]), result)
    assert result == [3.0]
    standard = derivation.derivation("standard_problems", standard_problems.derive)
    (path,) = (folder / "derivations").iterdir()
    digest, content = path.read_bytes().split(b"\n", 1)
    path.write_bytes(digest + b"\n" + content.replace(b"_result[0]", b"_result[1]"))
    assert derivation.derivation("standard_problems", standard_problems.derive) == standard
    assert len(caplog.messages) == 2


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
