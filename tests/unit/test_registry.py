"""Components are found by entry point, and unknown names suggest the nearest ones."""

from collections.abc import Iterator
from importlib.metadata import EntryPoint

import pytest

from vehiclemor import registry
from vehiclemor.errors import InputError
from vehiclemor.registry import component, names, unknown


def test_built_ins_are_registered() -> None:
    assert {"double_wishbone"} <= set(names("model"))
    assert {"full_order", "replay", "pod", "fixed_basis"} <= set(names("method"))
    assert {"sine_travel", "chirp_travel"} <= set(names("maneuver"))
    for kind in ("model", "method", "maneuver"):
        assert names(kind) == sorted(names(kind))


@pytest.mark.parametrize(
    ("kind", "name", "message"),
    [
        (
            "model",
            "double_wishbon",
            "unknown model 'double_wishbon'; did you mean double_wishbone?",
        ),
        ("method", "full-order", "unknown method 'full-order'; did you mean full_order?"),
        ("method", "PID", "unknown method 'PID'; known: fixed_basis, "),
        ("maneuver", "sine", "unknown maneuver 'sine'; "),
        ("model", "", "unknown model ''; known: "),
    ],
)
def test_unknown_name_lists_the_nearest(kind: str, name: str, message: str) -> None:
    with pytest.raises(InputError) as error:
        component(kind, name)
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)


def test_nearest_names_come_best_first() -> None:
    message = str(unknown("colour", "gren", ["violet", "green", "grey", "blue"]))
    assert message == "unknown colour 'gren'; did you mean green or grey?"


def test_of_many_names_the_nearest_are_told_and_how_to_see_all() -> None:
    message = str(unknown("colour", "0", [f"shade_{number}" for number in range(200)]))
    assert message.startswith("unknown colour '0'; nearest of 200: shade_0, ")
    assert message.endswith("; all: vehiclemor list, vehiclemor show NAME")
    assert len(message) < 120


@pytest.fixture
def plugins(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    found = {
        ("vehiclemor.methods", "mine"): "vehiclemor.reduction.methods.replay:METHOD",
        ("vehiclemor.methods", "empty"): "json",
        ("vehiclemor.methods", "gone"): "no_such_package.method",
        ("vehiclemor.maneuvers", "nothing"): "json:no_such_object",
    }
    entries = [EntryPoint(name, value, group) for (group, name), value in found.items()]
    monkeypatch.setattr(
        registry, "entry_points", lambda group: [e for e in entries if e.group == group]
    )
    registry._entries.cache_clear()
    yield
    registry._entries.cache_clear()


@pytest.mark.usefixtures("plugins")
def test_plugins_register_as_built_ins_do() -> None:
    from vehiclemor.reduction.methods import replay

    assert names("method") == ["empty", "gone", "mine"]
    assert component("method", "mine") is replay.METHOD


@pytest.mark.usefixtures("plugins")
def test_plugin_that_is_no_method_is_one_line() -> None:
    with pytest.raises(InputError, match=r"'empty' \(json\) is of type module: it must be a M"):
        component("method", "empty")


@pytest.mark.usefixtures("plugins")
@pytest.mark.parametrize(("kind", "name"), [("method", "gone"), ("maneuver", "nothing")])
def test_plugin_that_cannot_be_imported_is_one_line(kind: str, name: str) -> None:
    with pytest.raises(InputError, match="can't be imported: ") as error:
        component(kind, name)
    assert name in str(error.value)
    assert "\n" not in str(error.value)
