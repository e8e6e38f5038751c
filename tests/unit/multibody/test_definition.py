"""A declaration that contradicts itself is one line."""

import subprocess
import sys
from dataclasses import replace
from importlib.metadata import EntryPoint

import pytest

from tests.unit import standard_problems
from vehiclemor import registry
from vehiclemor.errors import InputError
from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.registry import component

PLAIN = standard_problems.DEFINITION
VEHICLES = ("independent_suspension_vehicle", "high_fidelity_vehicle")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "pde"}, "kind 'pde'; allowed: ae, ode, dae"),
        ({"kind": "ae"}, "of kind ae declares no design_coordinates"),
        ({"speeds": PLAIN.speeds[:1]}, "has 2 coordinates and 1 speeds, not 2"),
        ({"cyclic": ("angel",)}, "cyclic names 'angel'; did you mean angle"),
        ({"planar": ("x", "y", "psi")}, "planar names 'x'"),
        ({"heading_pairs": (("angle", "tracked"),)}, "heading_pairs, but no heading in planar"),
        ({"error_scale": {"speed": 1.0}}, "error_scale names 'speed'"),
        ({"validity": {"roll": (0.0, 1.0)}}, "validity names 'roll'"),
        ({"loads": ("Fz_FL",)}, "loads names 'Fz_FL'"),
        ({"tabled_outputs": ("pitch",)}, "tabled_outputs names 'pitch'"),
        ({"main_outputs": ("yaw",)}, "main_outputs names 'yaw'"),
        (
            {"tabled_outputs": ("angle",), "main_outputs": ("tracked",)},
            "main_outputs names 'tracked'; known: angle",
        ),
    ],
)
def test_a_declaration_that_contradicts_itself_is_one_line(change, message):
    with pytest.raises(InputError, match=message) as error:
        replace(PLAIN, **change)
    assert "\n" not in str(error.value)
    assert "standard_problems" in str(error.value)


def test_a_model_without_starts_is_refused():
    fields = {
        name: getattr(PLAIN, name)
        for name in (
            *("name", "kind", "summary", "maneuver", "coordinates", "speeds", "inputs"),
            *("outputs", "parameters", "derive"),
        )
    }
    with pytest.raises(InputError, match="of kind ode declares no starts"):
        ModelDefinition(**fields)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("tests.unit.standard_problems", "is of type module: it must be a ModelDefinition"),
        ("tests.unit.standard_problems:NAME", "is of type str: it must be a ModelDefinition"),
    ],
)
def test_what_is_no_definition_is_refused_with_its_entry_point(monkeypatch, value, message):
    entry = EntryPoint("mine", value, registry.GROUPS["model"])
    monkeypatch.setattr(registry, "_entries", lambda _: {"mine": entry})
    with pytest.raises(InputError, match=message) as error:
        component("model", "mine")
    assert f"model 'mine' ({value})" in str(error.value)


# What the contact with a plane road and the wheels' symmetry make cyclic: place and spin angles.
@pytest.mark.parametrize("name", VEHICLES)
def test_planar_states_are_place_and_heading_and_cyclic_ones_place_and_spins(name):
    definition = component("model", name)
    assert [state.lower() for state in definition.planar] == ["x", "y", "psi"]
    spins = tuple(f"gamma_{wheel}" for wheel in ("FL", "FR", "RL", "RR"))
    assert definition.cyclic == (*definition.planar[:2], *spins)


def test_declarations_are_read_without_sympy():
    text = (
        "import sys; from vehiclemor.registry import component, names;"
        "[component('model', name) for name in names('model')];"
        "print([m for m in ('sympy', 'scipy', 'numba', 'xarray') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
