"""A declaration that contradicts itself is one line."""

import re
from dataclasses import replace

import pytest

from tests.models import VEHICLES
from tests.plugin.installation import registered
from tests.unit import standard_problems
from vehiclemor.exceptions import InputError
from vehiclemor.multibody import definition
from vehiclemor.registry import component

PLAIN = standard_problems.DEFINITION


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "ae"}, "design_coordinates"),
        ({"starts": definition._unset}, "no starts"),
        ({"speeds": PLAIN.speeds[:1]}, "1 speeds"),
        ({"cyclic": ("angel",)}, "cyclic names 'angel'"),
        ({"heading_pairs": (("angle", "tracked"),)}, "heading_pairs"),
        ({"validity": {"roll": (0.0, 1.0)}}, "validity names 'roll'"),
        ({"tabled_outputs": ("pitch",)}, "tabled_outputs names 'pitch'"),
        (
            {"tabled_outputs": ("angle",), "main_outputs": ("tracked",)},
            "main_outputs names 'tracked'; known: angle",
        ),
    ],
)
def test_a_declaration_that_contradicts_itself_is_one_line(change, message):
    with pytest.raises(InputError, match=message) as error:
        replace(PLAIN, **change)
    assert "standard_problems" in str(error.value)


@pytest.mark.parametrize("value", ["standard_problems", "standard_problems:NAME"])
def test_what_is_no_definition_is_refused_with_its_entry_point(value):
    value = f"tests.unit.{value}"
    words = re.escape(f"model 'mine' ({value})")
    with registered("model", "mine", value), pytest.raises(InputError, match=words):
        component("model", "mine")


# What the contact with a plane road and the wheels' symmetry make cyclic: place and spin angles.
@pytest.mark.parametrize("name", VEHICLES)
def test_planar_states_are_place_and_heading_and_cyclic_ones_place_and_spins(name):
    definition = component("model", name)
    assert [state.lower() for state in definition.planar] == ["x", "y", "psi"]
    spins = tuple(f"gamma_{wheel}" for wheel in ("FL", "FR", "RL", "RR"))
    assert definition.cyclic == (*definition.planar[:2], *spins)
