"""Public names stay what they are whatever was used before; objects show themselves in a line."""

import subprocess
import sys

import pytest

import vehiclemor as vm
from vehiclemor import registry

LONGEST = 500
# Everything that a session may have imported and used before a name is asked for: Python puts a
# module in the place of a name as soon as anything imports it.
USED = """
import importlib, pkgutil
import vehiclemor as vm
vm.simulate("double_wishbone", "pod")
for found in pkgutil.walk_packages(vm.__path__, "vehiclemor."):
    if not found.name.endswith("__main__"):
        importlib.import_module(found.name)
from vehiclemor import api
for name in vm.__all__:
    value = getattr(vm, name)
    if getattr(value, "__module__", None) != vm._DEFINED_IN[name] or not value.__doc__:
        raise SystemExit(f"vehiclemor.{name} is {value!r}")
for name in ("models", "methods", "maneuvers", "studies"):
    assert getattr(vm, name)(), name
"""


def test_public_names_after_everything_was_used():
    done = subprocess.run([sys.executable, "-c", USED], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", ["double_wishbone", "independent_suspension_vehicle"])
def test_objects_of_a_simulation_show_themselves_in_one_line(name):
    model, definition = vm.model(name), registry.component("model", name)
    maneuver = vm.maneuver(definition.maneuver)
    rom, full = vm.reduce(name, "pod", training=[maneuver]), model.simulate(maneuver)
    for shown in (model, definition, maneuver, rom, rom.reduced, full):
        text = repr(shown)
        assert len(text) < LONGEST
        assert "\n" not in text
    assert name in repr(model)
    assert model.coordinates[0] in repr(model)
    assert name in repr(rom)
    assert f"times=ndarray({maneuver.samples},)" in repr(full)
    assert "status='ok'" in repr(full)
    for further in (model.parameters, model.equations):
        assert len(repr(further)) < 2 * LONGEST


def test_every_registered_component_shows_its_name():
    for kind in registry.GROUPS:
        for name in registry.names(kind):
            text = repr(registry.component(kind, name))
            assert name in text
            assert len(text) < LONGEST
