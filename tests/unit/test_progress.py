"""What takes long is told of, once, on standard error; what doesn't is not."""

import io
import logging
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from vehiclemor import progress
from vehiclemor.codegen.cache import fetched
from vehiclemor.progress import StandardError, first_use, making, telling

BEGAN = "first use of a model: deriving and compiling; kept for later runs"
LOOP = """
import logging
from vehiclemor import progress
progress.QUIET = 0.0
from vehiclemor.codegen.loops import loops
{before}
loops(("simulation.path_loops",), ("kernel_path",))
"""


class Clock:
    """Time that passes when the test says so, and the timers that are set by it."""

    def __init__(self) -> None:
        self.now, self.timers = 0.0, []

    def passes(self, seconds: float) -> None:
        self.now += seconds
        for timer in [timer for timer in self.timers if timer.due <= self.now]:
            self.timers.remove(timer)
            timer.function()


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> Clock:
    fake = Clock()

    class Timer:
        def __init__(self, seconds, function):
            self.seconds, self.function, self.due = seconds, function, float("inf")

        def start(self):
            self.due = fake.now + self.seconds
            fake.timers.append(self)

        def cancel(self):
            fake.timers = [timer for timer in fake.timers if timer is not self]

        def is_alive(self):
            return False

    monkeypatch.setattr(progress, "Timer", Timer)
    monkeypatch.setattr(progress, "perf_counter", lambda: fake.now)
    caplog.set_level(logging.INFO, "vehiclemor")
    return fake


def test_a_first_use_says_once_that_it_begins_and_how_long_it_took(clock, caplog):
    with first_use("a model"):
        with making("derivation", derived=True):
            clock.passes(progress.QUIET)
            assert caplog.messages == [BEGAN]
            clock.passes(2.0)
        # What is computed between counts for nothing.
        clock.passes(50.0)
        for _ in range(3):
            with making("kernel"):
                clock.passes(1.5)
    assert caplog.messages == [BEGAN, "a model: derived and compiled in 7.5 s"]
    assert {record.levelno for record in caplog.records} == {logging.INFO}


def test_many_short_parts_are_told_of_when_they_add_up(clock, caplog):
    with first_use("a model with a method"):
        for part in range(4):
            assert not caplog.messages, part
            with making("kernel"):
                clock.passes(0.3)
    began, ended = caplog.messages
    assert began == "first use of a model with a method: compiling; kept for later runs"
    assert ended == "a model with a method: compiled in 1.2 s"


def test_what_is_done_quickly_is_not_worth_a_word(clock, caplog):
    with first_use("a model"):
        with making("derivation", derived=True):
            clock.passes(0.9)
        clock.passes(50.0)
    with making("kernel"):
        clock.passes(0.9)
    with telling("drawing"):
        clock.passes(0.9)
    with first_use("what is there"):
        clock.passes(50.0)
    assert not caplog.messages
    assert not clock.timers


def test_a_use_within_a_use_is_part_of_it_and_one_alone_speaks_for_itself(clock, caplog):
    with first_use("study"), first_use("a model"), making("kernel"):
        clock.passes(3.0)
    with making("a loop"):
        clock.passes(2.0)
    with telling("drawing"):
        clock.passes(4.0)
    assert caplog.messages == [
        "first use of study: compiling; kept for later runs",
        "study: compiled in 3.0 s",
        "first use of a loop: compiling; kept for later runs",
        "a loop: compiled in 2.0 s",
        "drawing",
        "drawing: done in 4.0 s",
    ]


def test_what_fails_has_no_end(clock, caplog):
    def fail() -> None:
        with first_use("a model"), making("derivation", derived=True):
            clock.passes(5.0)
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert caplog.messages == [BEGAN]
    assert not clock.timers


def test_own_lines_stand_back_behind_an_applications_handlers(monkeypatch):
    printed = io.StringIO()
    monkeypatch.setattr(sys, "stderr", printed)
    record = logging.LogRecord("vehiclemor", logging.INFO, "", 0, "a line", (), None)
    root = logging.getLogger()
    # Here these are pytest's.
    assert root.handlers
    StandardError().emit(record)
    assert not printed.getvalue()
    monkeypatch.setattr(root, "handlers", [])
    StandardError().emit(record)
    assert printed.getvalue() == "a line\n"


def run(before: str, cache: Path) -> str:
    """Standard error of a process that needs a loop."""
    result = subprocess.run(
        [sys.executable, "-c", LOOP.format(before=before)],
        env={"VEHICLEMOR_CACHE": str(cache)},
        capture_output=True,
        text=True,
        check=True,
    )
    return result.stderr


def test_a_process_tells_of_what_it_compiles_and_nothing_when_it_is_there(tmp_path: Path):
    began, ended = run("", tmp_path / "1").splitlines()
    assert began == "first use of path_loops: compiling; kept for later runs"
    assert ended.startswith("path_loops: compiled in ")
    assert run("", tmp_path / "1") == ""
    silent = "logging.getLogger('vehiclemor').setLevel(logging.WARNING)"
    assert run(silent, tmp_path / "2") == ""


def test_of_several_that_want_a_file_one_makes_it_and_others_wait(tmp_path: Path, monkeypatch):
    monkeypatch.setenv("VEHICLEMOR_CACHE", str(tmp_path / "cache"))
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
    assert [path.name for path in (tmp_path / "cache" / "kernels").iterdir()] == ["some-0123.o"]


def test_an_error_of_the_maker_is_its_own_and_frees_the_lock(tmp_path: Path, monkeypatch):
    monkeypatch.setenv("VEHICLEMOR_CACHE", str(tmp_path / "cache"))

    def fail() -> bytes:
        raise OSError("no compiler")

    with pytest.raises(OSError, match="no compiler"):
        fetched("kernels/some-0123.o", fail)
    assert fetched("kernels/some-0123.o", lambda: b"content") == b"content"
