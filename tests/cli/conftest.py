"""How wrong input must fail on the command line."""

import pytest

from vehiclemor.cli import main


@pytest.fixture
def fails(capsys):
    """Run the command line; it must fail with one line that has all the words."""

    def run(arguments, *words):
        assert main([str(a) for a in arguments]) == 2
        captured = capsys.readouterr()
        assert captured.err.count("\n") == 1, captured.err
        assert "Traceback" not in captured.err
        assert captured.out == ""
        for word in words:
            assert word in captured.err, captured.err

    return run
