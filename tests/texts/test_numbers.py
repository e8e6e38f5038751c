"""Texts take measured numbers by name; they are current, and a missing name is an error."""

import json
import re
import sys
from configparser import ConfigParser

import measured_numbers
import numbers_by_name
import pytest
import xarray as xr
from numbers_by_name import load, render, shown

from vehiclemor.study.plans.loading import studies_and_files

NUMBERS = load()


def test_texts_hold_their_numbers():
    texts = dict(measured_numbers.texts(measured_numbers.ROOT, NUMBERS))
    assert {"README.md", "findings.md"} <= {path.name for path in texts}
    for path, text in texts.items():
        assert path.read_text(encoding="utf-8") == text, "run `paper/measured_numbers.py --texts`"


def test_the_file_holds_what_texts_ask_for():
    # Written anew by `paper/measured_numbers.py`, which also drops what no text asks for.
    assert measured_numbers.asked(measured_numbers.ROOT) == set(NUMBERS)


def test_one_command_measures_every_number_anew():
    text = (measured_numbers.ROOT / "tox.ini").read_text(encoding="utf-8")
    tox = ConfigParser(interpolation=None)
    tox.read_string(text)
    (order,) = re.findall(r"#   tox -e (\S+)", text)
    renewed = "".join(tox[f"testenv:{name}"]["commands"] for name in order.split(","))
    done = {f"python {script}" for script in re.findall(r"python (\S+\.py)", renewed)}
    done |= {"", "vehiclemor compare paper"} | {f"tox -e {name}" for name in order.split(",")}
    for study in re.findall(r"vehiclemor run (\S+)", renewed):
        done |= {f"vehiclemor run {name}" for name in studies_and_files(study)}
    # Logs are not part of the suite.
    needed = {entry["command"] for entry in NUMBERS.values() if "logs-" not in entry["command"]}
    assert needed <= done


def test_readme_is_short_and_keeps_its_commands():
    readme = (measured_numbers.ROOT / "README.md").read_text(encoding="utf-8")
    assert len(readme.splitlines()) <= 90
    # Continuous integration runs them.
    blocks = re.findall(r"^```sh\n(.*?)^```", readme, re.MULTILINE | re.DOTALL)
    assert blocks == ["sh .ci/tox -e bench\n", "sh .ci/tox -e tests\n"]


def test_a_missing_number_is_named_with_its_text():
    with pytest.raises(KeyError, match=r"page.md: no number 'time.no_car.us'"):
        render('{{ n("time.no_car.us") }}', name="page.md")


def test_numbers_are_formatted_and_calculated_with():
    numbers = {"a": {"value": 4.9e-7}, "b": {"value": 1e-7}}
    text = 'off {{ n("a", ".1e") }} m, {{ shown(n("a") / n("b"), ".2f") }} times, {{ n("b") }}\n'
    assert render(text, numbers) == "off 4.9e-7 m, 4.90 times, 1e-07\n"
    assert [shown(4e7, ".0e"), shown(24.6, "d"), shown(0.3, ".2f")] == ["4e7", "25", "0.30"]


def test_every_number_has_a_value_a_unit_and_an_origin():
    assert list(NUMBERS) == sorted(NUMBERS)
    for name, entry in NUMBERS.items():
        assert re.fullmatch(r"[a-z0-9_.+-]+", name), name
        assert list(entry) == ["value", "unit", "source", "command"], name
        assert entry["unit"], name
        assert entry["source"], name
        assert float(f"{entry['value']:.6g}") == entry["value"], name


@pytest.fixture
def results(tmp_path, monkeypatch):
    """A results folder with one file, and numbers of one more that is no longer there."""
    monkeypatch.setattr(measured_numbers, "operations", lambda: iter(()))
    monkeypatch.setattr(measured_numbers, "published", lambda: iter(()))
    names = {"name": ["gv step", "restart -1"], "output_unit": ("name", ["us", "m"])}
    xr.Dataset({"value": ("name", [12.3456789, float("nan")])}, names).to_netcdf(
        tmp_path / "in_use.nc"
    )
    return tmp_path


def test_the_script_reads_what_is_stored_and_keeps_the_rest(results, monkeypatch, capsys):
    old = {"value": 2.0, "unit": "s", "source": "peers.json", "command": "tox -e peers"}
    known = {"peers.x.seconds": old, "peers.unused": old, "in_use.gone": old}
    known["in_use.gone"] = old | {"source": "in_use.nc"}
    names = {"peers.x.seconds", "in_use.gone", "in_use.gv.step"}
    found = measured_numbers.measured(results, names, known)
    new = {"value": 12.3457, "unit": "us", "source": "in_use.nc"}
    new |= {"command": "python paper/in_use.py"}
    assert found == {"peers.x.seconds": old, "in_use.gv.step": new}
    assert "peers.json: missing; its numbers stay" in capsys.readouterr().err

    monkeypatch.setattr(measured_numbers, "FILE", results / "numbers.json")
    monkeypatch.setattr(measured_numbers, "ROOT", results)
    (results / "docs").mkdir()
    (results / "docs/README.md.in").write_text('a step takes {{ n("in_use.gv.step", "d") }} us\n')
    (results / "paper").mkdir()
    (results / "paper/paper.typ").write_text("none")
    monkeypatch.setattr("sys.argv", ["measured_numbers.py", "--results", str(results)])
    measured_numbers.main()
    assert (results / "README.md").read_text() == "a step takes 12 us\n"
    assert json.loads((results / "numbers.json").read_text()) == {"in_use.gv.step": new}
    monkeypatch.setattr("sys.argv", [*sys.argv, "--list", "step$"])
    measured_numbers.main()
    assert capsys.readouterr().out == "in_use.gv.step\n"
    assert numbers_by_name.load(results / "numbers.json") == {"in_use.gv.step": new}
