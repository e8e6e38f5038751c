"""Tables fit the terminal, and what is said twice is said once below."""

import pytest

import vehiclemor as vm
from vehiclemor.report.printing import Footnotes, Line, table_text, width
from vehiclemor.report.simulation import simulation_text


@pytest.mark.parametrize(("columns", "expected"), [("40", 80), ("100", 100), ("400", 120)])
def test_lines_are_as_wide_as_the_terminal_within_reason(monkeypatch, columns, expected):
    monkeypatch.setenv("COLUMNS", columns)
    assert width() == expected
    rows = [Line(["a name of many words " * 5, "1.0e-05"], note="told " * 40, heading="head " * 40)]
    assert 0.8 * expected < max(map(len, table_text(["", "error"], rows).splitlines())) <= expected


def test_a_phrase_has_one_letter():
    notes = Footnotes()
    assert notes.marks("one", "", "two") == "[a][b]"
    assert notes.marks("two") == "[b]"
    assert notes.marks("") == ""
    assert notes.text() == "  [a] one\n  [b] two"
    many = Footnotes()
    assert [many.marks(str(i)) for i in range(28)][-3:] == ["[z]", "[aa]", "[ab]"]


def test_a_simulation_prints_the_errors_of_each_output_and_a_dash_for_zero():
    run = vm.simulate("double_wishbone", "pod", rank=3)
    run["floor_rms_error"].loc["toe"] = 0.0
    lines = simulation_text(run, ["toe", "spindle_y"], []).splitlines()
    rows = {line.split()[0]: line.split() for line in lines if line.split()[:1]}
    for output, unit in (("toe", "rad"), ("spindle_y", "m")):
        names = ("rms_error", "floor_rms_error", "max_error", "signal_range")
        numbers = [float(run[name].sel(output=output)) for name in names]
        assert rows[output][1:] == [f"{n:.1e}" if n else "-" for n in numbers] + [unit]
