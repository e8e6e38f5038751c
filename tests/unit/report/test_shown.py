"""What tables show: the paper's models have rows of their own, others follow from their kind."""

from dataclasses import replace

import pytest

from tests.unit import standard_problems
from vehiclemor.registry import component, names
from vehiclemor.report.default_studies import of_paper, smaller_rank
from vehiclemor.report.labels import (
    default_rank,
    main_outputs,
    of_kind,
    tabled_outputs,
    tables_file,
    timing_cases,
)
from vehiclemor.report.published import load_published
from vehiclemor.simulation.build import build
from vehiclemor.study.experiment import complete_settings

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
