"""What public objects show of themselves: one line that names them, never their arrays."""

import pytest

import vehiclemor as vm
from vehiclemor import registry

LONGEST = 500


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
    assert f"time=ndarray({maneuver.samples},)" in repr(full)
    assert "status='ok'" in repr(full)
    for further in (model.parameters, model.equations, definition.report):
        assert len(repr(further)) < 2 * LONGEST


def test_every_registered_component_shows_its_name():
    for kind in registry.GROUPS:
        for name in registry.names(kind):
            text = repr(registry.component(kind, name))
            assert name in text
            assert len(text) < LONGEST
