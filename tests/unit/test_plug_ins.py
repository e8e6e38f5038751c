"""Broken plug-ins: named, and harmless to everything else."""

from importlib.metadata import EntryPoint

import pytest

import vehiclemor as vm
from vehiclemor import registry
from vehiclemor.errors import InputError


@pytest.fixture
def plug_in(tmp_path, monkeypatch):
    """Register a module text as a method, beside the built-ins."""

    def register(name, text):
        (tmp_path / f"{name}_module.py").write_text(text)
        monkeypatch.syspath_prepend(tmp_path)
        entry = EntryPoint(name, f"{name}_module", registry.GROUPS["method"])
        known = registry._entries("method")
        monkeypatch.setattr(registry, "_entries", {"method": {**known, name: entry}}.__getitem__)

    return register


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("def fit(:", "SyntaxError"),
        ("raise RuntimeError('at import')", "RuntimeError: at import"),
        ("import no_such_package", "no_such_package"),
        ("summary = 'half'", "is of type module: it must be a Method"),
    ],
)
def test_a_broken_plug_in_is_named_and_harmless(plug_in, text, words):
    plug_in("faulty", text)
    listed = vm.methods()
    assert words in listed["faulty"]
    assert listed["pod"].startswith("POD")
    with pytest.raises(InputError, match="faulty"):
        registry.component("method", "faulty")


def test_no_plug_in_takes_a_built_in_name(monkeypatch):
    thief = EntryPoint("pod", "thief", registry.GROUPS["method"])
    real = registry.entry_points(group=registry.GROUPS["method"])
    monkeypatch.setattr(registry, "entry_points", lambda **_: [*real, thief])
    found = registry._entries.__wrapped__("method")
    assert found["pod"].value == "vehiclemor.reduction.methods.pod:METHOD"
