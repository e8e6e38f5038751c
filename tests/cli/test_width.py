"""What commands print fits into 80 columns, whatever is registered."""

import pytest

from vehiclemor.cli import main
from vehiclemor.cli.app import COMMANDS
from vehiclemor.registry import names
from vehiclemor.report.description.schema import SCHEMAS
from vehiclemor.resources import data_names

WIDTH = 80
LISTED = [n for kind in ("model", "method", "maneuver") for n in names(kind)] + data_names(
    "studies"
)


@pytest.fixture
def printed(capsys, monkeypatch):
    """Run the command line where no terminal says how wide it is; its output, which fits."""
    monkeypatch.delenv("COLUMNS", raising=False)

    def run(*arguments):
        assert main([str(argument) for argument in arguments]) == 0
        text = capsys.readouterr().out
        # A word that is longer than a line, such as a path, can't be broken.
        assert not [s for s in text.splitlines() if len(s) > WIDTH and " " in s.strip()]
        return text

    return run


def test_lists_and_whatever_can_be_shown(printed):
    text = printed("list")
    for name in LISTED:
        assert f"  {name}" in text
    for name in [*LISTED, *SCHEMAS]:
        printed("show", name)


def test_simulations_and_studies(printed, tmp_path):
    for model in names("model"):
        for arguments in ([], ["--method", "pod", "--all-outputs"]):
            assert "nan" not in printed("simulate", model, *arguments)
    printed("run", "figures-6-7", "--out", tmp_path)


def test_help(printed):
    for command in ([], *([command] for command in COMMANDS)):
        printed(*command, "--help")
