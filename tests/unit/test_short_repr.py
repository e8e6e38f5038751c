"""What public objects show of themselves: one line that names them, never their arrays."""

import pytest

import vehiclemor as vm
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.registry import component, names
from vehiclemor.study.method_settings import complete_settings, for_method

LONGEST = 500


@pytest.mark.parametrize("name", ["double_wishbone", "independent_suspension_vehicle"])
def test_objects_of_a_simulation_show_themselves_in_one_line(name):
    model, definition, method = vm.model(name), component("model", name), component("method", "pod")
    maneuver = component("maneuver", definition.maneuver)
    runs = [TrainingRun(model, maneuver, model.starts[0])]
    settings = for_method(model, "pod", complete_settings(model, "pod"))
    reduced = method.fit(model, runs, settings)
    full = model.simulate(maneuver)
    for shown in (model, definition, method, maneuver, runs, settings, reduced, full):
        text = repr(shown)
        assert len(text) < LONGEST
        assert "\n" not in text
    assert name in repr(model)
    assert model.coordinates[0] in repr(model)
    assert name in repr(reduced)
    assert f"time=ndarray({maneuver.samples},)" in repr(full)
    assert "status='ok'" in repr(full)
    for further in (model.parameters, model.equations):
        assert len(repr(further)) < 2 * LONGEST


@pytest.mark.parametrize("kind", ["model", "method", "maneuver"])
def test_every_registered_component_shows_its_name(kind):
    for name in names(kind):
        text = repr(component(kind, name))
        assert name in text
        assert len(text) < LONGEST
