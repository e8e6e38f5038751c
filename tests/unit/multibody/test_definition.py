"""A declaration that contradicts itself is one line; what it leaves empty follows from its kind."""

import re
import subprocess
import sys
from dataclasses import replace
from importlib.metadata import EntryPoint

import pytest

from tests.unit import standard_problems
from vehiclemor import registry
from vehiclemor.errors import InputError
from vehiclemor.multibody import definition
from vehiclemor.multibody.quantities import Quantity
from vehiclemor.multibody.report import ModelReport, TimingCase
from vehiclemor.registry import component, names
from vehiclemor.report.published import load_published
from vehiclemor.resources import data_names

PLAIN = standard_problems.DEFINITION
BUILT_IN = ("double_wishbone", "independent_suspension_vehicle", "high_fidelity_vehicle")
BASELINE = TimingCase("baseline", "one", "full_order")
STRONGEST = TimingCase("strongest", "two", "full_order", "strongest")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "pde"}, "'pde'"),
        ({"kind": "ae"}, "design_coordinates"),
        ({"starts": definition._unset}, "no starts"),
        ({"speeds": PLAIN.speeds[:1]}, "1 speeds"),
        ({"cyclic": ("angel",)}, "cyclic names 'angel'"),
        ({"planar": ("x", "y", "psi")}, "planar names 'x'"),
        ({"heading_pairs": (("angle", "tracked"),)}, "heading_pairs"),
        ({"error_scale": {"speed": 1.0}}, "error_scale names 'speed'"),
        ({"validity": {"roll": (0.0, 1.0)}}, "validity names 'roll'"),
        ({"loads": ("Fz_FL",)}, "loads names 'Fz_FL'"),
        ({"report": ModelReport(outputs=("pitch",))}, "report names 'pitch'"),
        ({"report": ModelReport(bounds={"yaw": "key"})}, "report names 'yaw'"),
        ({"report": ModelReport(timing=(BASELINE,))}, "'strongest'"),
        (
            {"report": ModelReport(timing=(BASELINE, STRONGEST, STRONGEST))},
            "twice",
        ),
    ],
)
def test_a_declaration_that_contradicts_itself_is_one_line(change, message):
    with pytest.raises(InputError, match=message) as error:
        replace(PLAIN, **change)
    assert "\n" not in str(error.value)
    assert "standard_problems" in str(error.value)


@pytest.mark.parametrize("value", ["standard_problems", "standard_problems:NAME"])
def test_what_is_no_definition_is_refused_with_its_entry_point(monkeypatch, value):
    value = f"tests.unit.{value}"
    entry = EntryPoint("mine", value, registry.GROUPS["model"])
    monkeypatch.setattr(registry, "_entries", lambda _: {"mine": entry})
    with pytest.raises(InputError, match=re.escape(f"model 'mine' ({value})")):
        component("model", "mine")


@pytest.mark.parametrize("name", BUILT_IN)
def test_what_a_built_in_declares_exists(name):
    definition = component("model", name)
    declared = definition.report
    cases = definition.shown.timing
    labels = [case.label for case in cases]
    assert len(set(labels)) == len(labels)
    assert {case.method for case in cases} <= set(names("method"))
    assert declared.study in data_names("studies")
    if declared.settings_study:
        assert declared.settings_study in data_names("studies")
    published = load_published().numbers
    for output, key in declared.bounds.items():
        assert (published[key].model, published[key].quantity) == (name, output)
    assert definition.heading_pairs == () or definition.planar[2] == "psi"


# What the contact with a plane road and the wheels' symmetry make cyclic: place and spin angles.
@pytest.mark.parametrize("name", BUILT_IN[1:])
def test_planar_states_are_place_and_heading_and_cyclic_ones_place_and_spins(name):
    definition = component("model", name)
    assert [state.lower() for state in definition.planar] == ["x", "y", "psi"]
    spins = tuple(f"gamma_{wheel}" for wheel in ("FL", "FR", "RL", "RR"))
    assert definition.cyclic == (*definition.planar[:2], *spins)


def test_defaults_follow_the_kind():
    speeds = {"ae": (), "ode": PLAIN.speeds, "dae": PLAIN.speeds}
    for kind, counted in (("ae", "iterations"), ("ode", "rhs_calls"), ("dae", "rhs_calls")):
        made = replace(PLAIN, kind=kind, speeds=speeds[kind], design_coordinates=PLAIN.starts)
        cases = made.shown.timing
        assert [case.id for case in cases][:2] == ["baseline", "strongest"]
        assert "replay" in [case.id for case in cases]
        assert counted in made.shown.counts
        assert made.shown.outputs == tuple(output.name for output in PLAIN.outputs)
        assert made.shown.printed_outputs == ("angle", "tracked", "angular_speed")
        assert all(made.shown.baselines)
        chosen = replace(made, report=ModelReport(outputs=("tracked",)))
        assert chosen.shown.outputs == chosen.shown.printed_outputs == ("tracked",)


@pytest.mark.parametrize(("coordinates", "rank"), [(1, 1), (2, 1), (3, 2), (4, 3), (26, 3)])
def test_the_default_rank_is_a_reduction_where_there_is_one(coordinates, rank):
    made = tuple(Quantity(f"q{k}", "m", "a coordinate") for k in range(coordinates))
    speeds = tuple(Quantity(f"v{k}", "m/s", "a speed") for k in range(coordinates))
    shown = replace(PLAIN, coordinates=made, speeds=speeds).shown
    assert shown.paper_fixed == {"rank": rank}


def test_declarations_are_read_without_sympy():
    text = (
        "import sys; from vehiclemor.registry import component, names;"
        "[component('model', name) for name in names('model')];"
        "print([m for m in ('sympy', 'scipy', 'numba', 'xarray') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
