"""`vehiclemor new-plugin`: the template under any name, whole or not at all."""

import runpy
import tomllib
from contextlib import suppress
from pathlib import Path

import pytest

from vehiclemor import registry
from vehiclemor.cli import main
from vehiclemor.resources import data_folder


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_tests_of_the_template_pass(plug_in_package):
    (file,) = plug_in_package.glob("test_*.py")
    tests = [f for name, f in runpy.run_path(file).items() if name.startswith("test_")]
    assert len(tests) == 4
    for test in tests:
        test()


def test_a_name_stands_wherever_the_template_has_its_own(here, capsys):
    assert main(["new-plugin", "my_car"]) == 0
    told = capsys.readouterr().out
    assert "pip install -e my_car_plugin pytest\n" in told
    assert [path.name for path in here.iterdir()] == ["my_car_plugin"]
    written = [path for path in (here / "my_car_plugin").rglob("*") if path.is_file()]
    template = [p for p in (data_folder() / "plugin_template").rglob("*") if p.suffix != ".pyc"]
    assert len(written) == sum(path.is_file() for path in template)
    for path in written:
        text = path.read_text()
        assert "quarter_car" not in text + str(path)
        assert "quarter-car" not in text
        tomllib.loads(text) if path.suffix == ".toml" else compile(text, path, "exec")
    project = tomllib.loads((here / "my_car_plugin" / "pyproject.toml").read_text())["project"]
    assert project["name"] == "vehiclemor-my-car"
    assert project["entry-points"].keys() == {f"vehiclemor.{kind}s" for kind in registry.GROUPS}
    named = {name for entries in project["entry-points"].values() for name in entries}
    assert named == {"my_car", "my_car_road", "my_car_modes"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["My-Car"], "'My-Car' can't name"),
        (["../car"], "'../car' can't name"),
        (["class"], "'class' can't name"),
        (["3"], "'3' can't name"),
        ([""], "'' can't name"),
        (["a" * 41], "at most 40"),
        (["pod"], "there is a method pod"),
        (["double_wishbone"], "there is a model double_wishbone"),
        (["quarter_car"], "there is a model quarter_car"),
        (["lane_change"], "there is a maneuver lane_change"),
        (["paper"], "there is a study paper"),
        (["json"], "there is a Python package json"),
        (["my_car", "--out", "there"], "there exists: it is not replaced"),
        (["my_car", "--out", "file"], "file exists: it is not replaced"),
        (["my_car", "--out", "no/where"], "no/where: the folder no does not exist"),
        (["my_car", "--out", "file/x"], "file/x: "),
        (["my_car", "--out", "a" * 300], "can't be written"),
    ],
)
def test_what_cannot_be_made_is_one_line(plug_in_package, here, capsys, arguments, words):
    (here / "there").mkdir()
    (here / "file").write_text("mine")
    assert main(["new-plugin", *arguments]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line
    assert sorted(path.name for path in here.iterdir()) == ["file", "there"]
    assert not list((here / "there").iterdir())


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_write_that_ends_early_leaves_nothing(here, monkeypatch, error):
    def fail(path, *_, **__):
        if path.name == "model.py":
            raise error
        path.touch()

    monkeypatch.setattr(Path, "write_text", fail)
    with suppress(KeyboardInterrupt):
        assert main(["new-plugin", "my_car"]) != 0
    assert not list(here.iterdir())
