"""What commands print fits into 80 columns, whatever is registered."""

import pytest

from vehiclemor.cli import main
from vehiclemor.cli.app import COMMANDS
from vehiclemor.registry import names
from vehiclemor.report.description.schema import SCHEMAS
from vehiclemor.resources import data_names

WIDTH = 80
SHOWN = [*(n for kind in ("model", "method", "maneuver") for n in names(kind)), *SCHEMAS]


@pytest.fixture
def printed(capsys, monkeypatch):
    """Run the command line where no terminal says how wide it is; its output."""
    monkeypatch.delenv("COLUMNS", raising=False)

    def run(*arguments):
        assert main([str(argument) for argument in arguments]) == 0
        return capsys.readouterr().out

    return run


def too_long(text):
    # A word that is longer than a line, such as a path, can't be broken.
    return [line for line in text.splitlines() if len(line) > WIDTH and " " in line.strip()]


def test_lists(printed):
    text = printed("list")
    assert not too_long(text)
    for name in SHOWN[: -len(SCHEMAS)] + data_names("studies"):
        assert f"  {name}" in text
    assert "vehiclemor show NAME" in text


def test_whatever_can_be_shown(printed):
    for name in [*SHOWN, *data_names("studies")]:
        assert not too_long(printed("show", name))


@pytest.mark.parametrize("model", names("model"))
def test_simulations(printed, model):
    for arguments in ([], ["--method", "pod", "--all-outputs"]):
        text = printed("simulate", model, *arguments)
        assert not too_long(text)
        assert "nan" not in text
        assert "nothing is kept" in text


@pytest.mark.parametrize("command", [[], *([command] for command in COMMANDS)])
def test_help(printed, command):
    assert not too_long(printed(*command, "--help"))


def test_runs(printed, tmp_path):
    assert not too_long(printed("run", "figures-6-7", "--out", tmp_path))
