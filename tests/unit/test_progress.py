"""What takes long is told of, once, on standard error; what doesn't is not."""

import logging
import os
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest

from vehiclemor import progress
from vehiclemor.codegen.cache import fetched
from vehiclemor.progress import first_use, making

LOOP = """
import logging
from vehiclemor import progress
progress.QUIET = 0.0
from vehiclemor.codegen.loops import loops
{before}
loops(("simulation.path_loops",), ("kernel_path",))
"""


def test_what_takes_long_is_told_of_and_its_end_if_it_has_one(monkeypatch, caplog):
    caplog.set_level(logging.INFO, "vehiclemor")
    with first_use("a model"), making("kernel"):
        pass
    assert not caplog.messages
    monkeypatch.setattr(progress, "QUIET", 0.3)
    with suppress(ZeroDivisionError), first_use("what fails"), making("kernel"):
        time.sleep(0.4)
        raise ZeroDivisionError
    # No part of it takes so long, but both do.
    with first_use("a model"):
        for part in ("derivation", "kernel"):
            with making(part):
                time.sleep(0.2)
    failed, began, ended = caplog.messages
    assert "first use of what fails" in failed
    assert "first use of a model" in began
    assert "a model: compiled in" in ended
    assert float(ended.split()[-2]) >= 0.4


def test_a_process_tells_of_what_it_compiles_and_nothing_when_it_is_there(tmp_path: Path):
    def told(before: str, cache: Path) -> list[str]:
        command = [sys.executable, "-c", LOOP.format(before=before)]
        own = {**os.environ, "VEHICLEMOR_CACHE": str(cache)}
        done = subprocess.run(command, env=own, capture_output=True, text=True, check=True)
        return done.stderr.splitlines()

    began, ended = told("", tmp_path / "1")
    assert began.startswith("first use of path_loops")
    assert ended.startswith("path_loops: compiled in ")
    assert told("", tmp_path / "1") == []
    # An application's own handlers print them, and nothing else does.
    began, ended = told("logging.basicConfig(format='mine: %(message)s')", tmp_path / "2")
    assert began.startswith("mine: first use of path_loops")
    assert ended.startswith("mine: path_loops: compiled in ")


@pytest.fixture
def cache(tmp_path: Path, monkeypatch):
    monkeypatch.setenv("VEHICLEMOR_CACHE", str(tmp_path))
    return tmp_path


def test_of_several_that_want_a_file_one_makes_it_and_others_wait(cache):
    begun, finish, made = threading.Event(), threading.Event(), []

    def make() -> bytes:
        begun.set()
        assert finish.wait(60.0)
        made.append(1)
        return b"content"

    found: list[bytes] = []

    def want() -> None:
        found.append(fetched("kernels/some-0123.o", make))

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
    assert [path.name for path in (cache / "kernels").iterdir()] == ["some-0123.o"]


def test_an_error_of_the_maker_is_its_own_and_frees_the_lock(cache):
    def fail() -> bytes:
        raise OSError("no compiler")

    with pytest.raises(OSError, match="no compiler"):
        fetched("kernels/some-0123.o", fail)
    assert fetched("kernels/some-0123.o", lambda: b"content") == b"content"
