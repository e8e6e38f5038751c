"""Components are found by entry point, and unknown names suggest the nearest ones."""

from importlib.metadata import EntryPoint

import pytest

from vehiclemor import registry
from vehiclemor.errors import InputError
from vehiclemor.reduction.methods import pod, replay
from vehiclemor.registry import component, names, unknown


@pytest.mark.parametrize(
    ("kind", "name", "words"),
    [
        ("model", "double_wishbon", "did you mean double_wishbone?"),
        ("method", "full-order", "did you mean full_order?"),
        ("method", "PID", "known: fixed_basis, "),
        ("maneuver", "sine", "sine_travel"),
        ("model", "", "known: "),
    ],
)
def test_unknown_name_lists_the_nearest(kind, name, words):
    with pytest.raises(InputError, match=f"unknown {kind} '{name}'; .*") as error:
        component(kind, name)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_nearest_names_come_best_first_and_of_many_the_nearest_alone():
    few = str(unknown("colour", "gren", ["violet", "green", "grey", "blue"]))
    assert few.endswith("did you mean green or grey?")
    many = str(unknown("colour", "0", [f"shade_{number}" for number in range(200)]))
    assert "shade_0, " in many
    assert "vehiclemor list" in many
    assert len(many) < 120


def test_plug_ins_register_as_built_ins_do_and_take_no_name_of_theirs(monkeypatch):
    group = registry.GROUPS["method"]
    of_others = [EntryPoint("mine", "vehiclemor.reduction.methods.replay:METHOD", group)]
    of_others += [EntryPoint("pod", "thief:METHOD", group)]
    found = [*registry.entry_points(group=group), *of_others]
    with monkeypatch.context() as patch:
        patch.setattr(registry, "entry_points", lambda **_: found)
        registry._entries.cache_clear()
        assert names("method") == sorted({entry.name for entry in found})
        assert component("method", "mine") is replay.METHOD
        assert component("method", "pod") is pod.METHOD
    registry._entries.cache_clear()
