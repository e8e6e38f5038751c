"""Tables fit the terminal, and what is said twice is said once below."""

import os

import numpy as np
import pytest
import xarray as xr

from vehiclemor.report.printing import Footnotes, Line, power, table_text, width
from vehiclemor.report.simulation import simulation_text


@pytest.mark.parametrize(
    ("columns", "expected"), [("40", 80), ("80", 80), ("100", 100), ("400", 120)]
)
def test_lines_are_as_wide_as_the_terminal_within_reason(monkeypatch, columns, expected):
    monkeypatch.setenv("COLUMNS", columns)
    assert width() == expected
    rows = [Line(["a name of many words " * 5, "1.0e-05"], note="told " * 40, heading="head " * 40)]
    assert 0.8 * expected < max(map(len, table_text(["", "error"], rows).splitlines())) <= expected


def test_without_a_terminal_lines_have_80_columns(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    monkeypatch.setattr("shutil.get_terminal_size", os.terminal_size)
    assert width() == 80


def test_long_headings_give_way_to_names(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    headings = ["method", *["body displacement pert.", "suspension travel pert."] * 3]
    printed = table_text(headings, [Line(["full_order_strongest [a]", *["1.0e-03"] * 6])])
    assert "full_order_strongest" in printed
    assert printed.count("1.0e-03") == 6
    assert max(map(len, printed.splitlines())) <= 80


def test_a_phrase_has_one_letter():
    notes = Footnotes()
    assert notes.marks("one", "", "two") == "[a][b]"
    assert notes.marks("two") == "[b]"
    assert notes.marks("") == ""
    assert notes.text() == "  [a] one\n  [b] two"
    many = Footnotes()
    assert [many.marks(str(i)) for i in range(28)][-3:] == ["[z]", "[aa]", "[ab]"]


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_what_is_zero_or_missing_is_a_dash(value):
    assert power(value) == "-"


def test_a_simulation_is_a_table_with_aligned_columns():
    outputs = ["yaw", "longitudinal_position"]
    columns = {
        "rms_error": [1e-3, 0.0],
        "floor_rms_error": [np.nan, np.nan],
        "max_error": [2e-3, 3.0],
        "signal_range": [0.1, 500.0],
    }
    found = {name: ("output", values) for name, values in columns.items()}
    found |= {"status": "ok", "message": "", "remark": "", "steps": 7}
    found["seconds"] = ((), 1e-3, {"clock": "CPU time of the thread"})
    units = {"output": outputs, "output_unit": ("output", ["rad", "m"])}
    dataset = xr.Dataset(found, units, {"title": "pod on a car"})
    lines = simulation_text(dataset, ["steps"]).splitlines()
    assert lines[0] == "pod on a car: ok"
    rows = {line.split()[0]: line for line in lines if line.split()[0] in outputs}
    assert rows["yaw"].split() == ["yaw", "1.0e-03", "-", "2.0e-03", "1.0e-01", "rad"]
    assert rows["longitudinal_position"].split()[1:] == ["-", "-", "3.0e+00", "5.0e+02", "m"]
    assert rows["yaw"].index("rad") == rows["longitudinal_position"].rindex("m")
    text = "\n".join(lines)
    assert "floor: RMS error of the best approximation" in text
    assert "CPU time of the thread" in text
