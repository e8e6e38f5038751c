"""How wrong input must fail on the command line."""

import re

import pytest

from vehiclemor.cli import main
from vehiclemor.resources import data_folder


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


@pytest.fixture
def parameter_file(tmp_path):
    """Write the parameter file of a model with some values replaced."""

    def write(model, values):
        text = (data_folder() / "parameters" / f"{model}.toml").read_text()
        for name, value in values.items():
            entry = rf"(\[parameters\.{name}\]\n(?:(?!\[).*\n)*?value = ).*\n"
            text, replaced = re.subn(entry, rf"\g<1>{value}\n", text)
            assert replaced == 1
        path = tmp_path / "vehicle.toml"
        path.write_text(text)
        return path

    return write
