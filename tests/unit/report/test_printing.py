"""Tables: what is handed in stands there in every format; and what tables show of a model."""

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

import vehiclemor as vm
from tests.unit import standard_problems
from vehiclemor.registry import component, names
from vehiclemor.report.default_studies import of_paper, smaller_rank
from vehiclemor.report.labels import (
    Column,
    column,
    default_rank,
    main_outputs,
    of_kind,
    tabled_outputs,
    tables_file,
    timing_cases,
)
from vehiclemor.report.printing import Table, simulation_text, width
from vehiclemor.report.published import load_published
from vehiclemor.simulation.build import build
from vehiclemor.study.experiment import complete_settings

ROWS = pd.DataFrame(
    {
        "label": ["a|b_c & <d>", "plain"],
        "floor": [1.23456e-5, 0.0],
        "score": [np.nan, 12.3456],
        "misses": [3, 0],
    }
)


@pytest.mark.parametrize(("columns", "expected"), [("40", 80), ("100", 100), ("400", 120)])
def test_lines_are_as_wide_as_the_terminal_within_reason(monkeypatch, columns, expected):
    monkeypatch.setenv("COLUMNS", columns)
    assert width() == expected
    rows = [{"name": "a name of many words " * 5, "median": 1e-5, "why": "told " * 40}]
    lines = str(Table(rows)).splitlines()
    assert 0.8 * expected < max(map(len, lines)) <= expected
    assert " ".join(" ".join(lines).split()).count("told") == 40


def test_numbers_keep_their_digits_where_they_are_read_again():
    page = ElementTree.fromstring(f"<div>{Table(ROWS).__html__()}</div>")  # noqa: S314 - our own
    values = [float(element.get("value")) for element in page.iter("data")]
    assert values == [1.23456e-5, 0.0, 12.3456]
    assert "a|b_c & <d>" in ["".join(cell.itertext()) for cell in page.iter("td")]
    # Groups and notes have lines of their own, meanings stand below.
    grouped = Table(
        ROWS.assign(of="<g>", why="a & b"), ("score",), group="of", note="why"
    ).__html__()
    page = ElementTree.fromstring(f"<div>{grouped}</div>")  # noqa: S314 - our own
    cells = ["".join(cell.itertext()) for cell in page.iter("td")]
    assert cells == ["<g>", "-", "a & b", "12.3", "a & b"]
    assert column("score").meaning in page.findtext("p")


def test_a_terminal_shows_headings_formats_groups_and_meanings_once():
    rows = ROWS.assign(of=["first", "second"])
    text = str(Table(rows, ("label", "floor", "score", "misses"), group="of"))
    lines = text.splitlines()
    assert lines.index("first") < lines.index("second")
    found = [line.split()[-3:] for line in lines if line.startswith(("a|b", "plain"))]
    # An exact zero is no order of magnitude.
    assert found == [["1.2e-05", "-", "3"], ["-", "12.3", "0"]]
    assert str(Table([{"score": 0.0}], explain=False)).split()[-1] == "0"
    plain = " ".join(text.split())
    for name in ("floor", "score", "misses"):
        assert plain.count(column(name).meaning) == 1
    assert column("floor").meaning not in " ".join(str(Table(rows, explain=False)).split())
    lines = str(
        Table([{"of": o, "n": n} for n, o in enumerate("abab")], ("n",), group="of")
    ).split()
    assert lines == ["n", "a", "0", "2", "b", "1", "3"]
    micro = {"t": Column("time, us", ".1f", scale=1e6)}
    assert str(Table([{"t": 2.5e-6}], micro)).split() == ["time,", "us", "2.5"]


def test_a_simulation_prints_the_errors_of_each_output_and_a_dash_for_zero():
    run = vm.simulate("double_wishbone", "pod", rank=3)
    run["floor_rms_error"].loc["toe"] = 0.0
    lines = simulation_text(run, ["toe", "spindle_y"], []).splitlines()
    rows = {line.split()[0]: line.split() for line in lines if line.split()[:1]}
    for output, unit in (("toe", "rad"), ("spindle_y", "m")):
        names = ("rms_error", "floor_rms_error", "max_error", "signal_range")
        numbers = [float(run[name].sel(output=output)) for name in names]
        assert rows[output][1:] == [f"{n:.1e}" if n else "-" for n in numbers] + [unit]


PLAIN = standard_problems.DEFINITION
BUILT_IN = ("double_wishbone", "independent_suspension_vehicle", "high_fidelity_vehicle")
NOMINAL = ("figures-6-7", "figures-2-4", "figures-9-10")


@pytest.mark.parametrize(("name", "nominal"), [*zip(BUILT_IN, NOMINAL, strict=True)])
def test_rows_of_the_papers_models_exist_and_are_named_once(name, nominal):
    cases, model = timing_cases(component("model", name)), build(name)
    assert [case.id for case in cases[:2]] == ["baseline", "strongest"]
    for kind in ("id", "label"):
        assert len({getattr(case, kind) for case in cases}) == len(cases)
    assert {case.method for case in cases} <= set(names("method"))
    assert set(of_kind(model.kind).counts) <= set(model.counts)
    assert of_paper(name) == nominal
    assert set(tables_file().reduced) == set(BUILT_IN)
    # Settings of the paper are the defaults of POD.
    printed = [n for n in load_published().numbers.values() if n.model == name]
    assert smaller_rank(model, "pod") == {}
    settings = complete_settings(model, "pod")
    for number in printed:
        if number.kind == "rms_error":
            assert settings["rank"] == number.states
            assert settings["control_period"] == number.control_period


def test_defaults_follow_the_kind():
    speeds = {"ae": (), "ode": PLAIN.speeds, "dae": PLAIN.speeds}
    for kind, counted in (("ae", "iterations"), ("ode", "rhs_calls"), ("dae", "rhs_calls")):
        made = replace(PLAIN, kind=kind, speeds=speeds[kind], design_coordinates=PLAIN.starts)
        cases = [case.id for case in timing_cases(made)]
        assert cases[:2] == ["baseline", "strongest"]
        assert cases[-4:] == ["replay", "pod_r1", "pod_literal_r1", "fixed_basis_r1"]
        assert counted in of_kind(kind).counts
    for coordinates, rank in ((1, 1), (2, 1), (3, 2), (4, 3), (26, 3)):
        assert default_rank(coordinates) == rank
    assert tabled_outputs(PLAIN) == tuple(output.name for output in PLAIN.outputs)
    assert main_outputs(PLAIN) == ("angle", "tracked", "angular_speed")
