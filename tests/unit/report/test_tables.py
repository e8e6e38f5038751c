"""Tables: what is handed in stands there in every format; rates, times, printed numbers."""

import math
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom

import vehiclemor as vm
from tests.models import MODELS
from vehiclemor.registry import component, names
from vehiclemor.report.comparison import smaller_rank
from vehiclemor.report.labels import (
    Column,
    column,
    declared,
    method_text,
    of_kind,
    readable_unit,
    timing_cases,
)
from vehiclemor.report.printing import Table, simulation_text, width
from vehiclemor.report.published import load_published, of_paper
from vehiclemor.report.unseen import at_error, upper_bound
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
    # A missing number is a dash, an exact zero is 0.
    assert found == [["1.2e-05", "-", "3"], ["0", "12.3", "0"]]
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


@pytest.mark.parametrize(
    ("largest", "unit", "expected"),
    [
        (0.01, "m", (1e3, "mm")),
        (2e-5, "rad/s", (1e6, "µrad/s")),
        (1.0, "m", (1.0, "m")),
        # A prefix would be squared, or make another unit.
        *((0.01, unit, (1.0, unit)) for unit in ("m^2", "min", "mol", "rads", "s")),
    ],
)
def test_prefixes_keep_the_meaning_of_a_unit(largest, unit, expected):
    assert readable_unit(largest, unit) == expected


def test_a_colour_and_a_mark_name_one_method_of_the_package():
    looks = declared().methods
    assert set(names("method")) - {"full_order"} <= set(looks)
    assert len({(look.color, look.mark) for look in looks.values()}) == len(looks)


def test_methods_of_other_names_keep_them():
    names = ("pod_literal", "tripod", "my_pod")
    assert [method_text(name) for name in names] == ["POD literal", "tripod", "my POD"]


def test_a_simulation_prints_the_errors_of_each_output_and_a_zero_as_such():
    run = vm.simulate("double_wishbone", "pod", rank=3)
    run["floor_rms_error"].loc["toe"] = 0.0
    lines = simulation_text(run, ["toe", "spindle_y"], []).splitlines()
    rows = {line.split()[0]: line.split() for line in lines if line.split()[:1]}
    for output, unit in (("toe", "rad"), ("spindle_y", "m")):
        names = ("rms_error", "floor_rms_error", "max_error", "signal_range")
        numbers = [float(run[name].sel(output=output)) for name in names]
        assert rows[output][1:] == [f"{n:.1e}" if n else "0" for n in numbers] + [unit]


NOMINAL = ("figures-6-7", "figures-2-4", "figures-9-10")


@pytest.mark.parametrize("name", names("model"))
def test_rows_of_costs_are_named_once_and_their_methods_take_the_settings(name):
    cases, model = timing_cases(component("model", name)), build(name)
    assert [case.id for case in cases[:2]] == ["baseline", "strongest"]
    for kind in ("id", "label"):
        assert len({getattr(case, kind) for case in cases}) == len(cases)
    assert "replay" in {case.method for case in cases}
    assert set(of_kind(model.kind).counts) <= set(model.counts)
    for case in cases:
        settings = complete_settings(model, case.method, case.settings, case.preset)
        method = component("method", case.method)
        # A row of a method that refuses the model says so, and has no settings.
        names_of = method.names_of(model.kind) if method.accepts(model)[0] else ()
        assert set(settings) == set(names_of)


@pytest.mark.parametrize(("name", "nominal"), [*zip(MODELS, NOMINAL, strict=True)])
def test_settings_of_the_paper_are_the_defaults_of_pod(name, nominal):
    assert of_paper(name) == nominal
    assert set(declared().reduced) == set(MODELS)
    printed = [n for n in load_published().values() if n.model == name]
    model = build(name)
    assert smaller_rank(model, "pod") == {}
    settings = complete_settings(model, "pod")
    for number in printed:
        if number.kind == "rms_error":
            assert settings["rank"] == number.states
            assert settings["control_period"] == number.control_period


@given(st.integers(0, 40), st.integers(1, 400))
def test_the_bound_of_a_rate_is_exact(misses, runs):
    misses = min(misses, runs)
    bound = upper_bound(misses, runs)
    if misses == runs:
        assert bound == 1.0
    else:
        # At the bound so few misses have a probability of 5 %.
        np.testing.assert_allclose(binom.cdf(misses, runs, bound), 0.05, rtol=1e-6)


def test_299_runs_without_a_miss_prove_less_than_1_percent():
    assert upper_bound(0, 298) > 0.01 > upper_bound(0, 299)


def ladder(name, order, scores, factor=1.0):
    return [
        {"label": f"{name} {s}", "score": s, "seconds": factor * s ** (-1.0 / order)}
        for s in scores
    ]


@given(st.floats(0.011, 0.99))
def test_a_power_law_is_interpolated_exactly(error):
    rows = ladder("a", 3.0, [1.0, 0.1, 0.01])
    # A row that is slower and less accurate than another is no part of the curve.
    rows.append({"label": "slip", "score": 0.5, "seconds": 50.0})
    found = at_error([rows], error, "seconds")
    np.testing.assert_allclose(found.seconds, error ** (-1.0 / 3.0), rtol=1e-12)
    assert found.rows == (("a 1.0", "a 0.1") if error >= 0.1 else ("a 0.1", "a 0.01"))


def test_the_fastest_ladder_counts_that_reaches_the_error():
    slow, fast = ladder("slow", 3.0, [1.0, 0.001], 2.0), ladder("fast", 3.0, [1.0, 0.1])
    assert at_error([slow, fast], 0.2, "seconds").rows == ("fast 1.0", "fast 0.1")
    assert at_error([slow, fast], 0.04, "seconds").rows == ("slow 1.0", "slow 0.001")
    # Just beyond its end the fast one is continued by its own law, not replaced by the slow one.
    (first, last), continued = fast, at_error([slow, fast], 0.06, "seconds")
    law = math.log(last["seconds"] / first["seconds"]) / math.log(last["score"] / first["score"])
    expected = last["seconds"] * (0.06 / last["score"]) ** law
    assert continued.rows == ("fast 1.0", "fast 0.1")
    assert continued.seconds == pytest.approx(expected, rel=1e-12)
    assert at_error([slow, fast], 5.0, "seconds") == (1.0, ("fast 1.0",))
    assert math.isnan(at_error([slow, fast], 1e-6, "seconds").seconds)
