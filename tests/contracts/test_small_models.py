"""Presets fit models that are smaller than their rank; a rank that is given is never changed."""

import pytest

import vehiclemor as vm
from vehiclemor.contracts import check_method
from vehiclemor.errors import InputError
from vehiclemor.registry import component, names
from vehiclemor.study.method_settings import complete_settings

pytestmark = pytest.mark.usefixtures("plug_in_package")


@pytest.mark.parametrize("method", names("method"))
def test_every_method_keeps_its_contract_on_the_quarter_car(method):
    check_method(method, "quarter_car")


@pytest.mark.parametrize("method", ["pod", "fixed_basis"])
def test_a_preset_lowers_its_rank_to_the_number_of_coordinates(method):
    car = vm.model("quarter_car")
    for preset in component("method", method).presets_of("ode"):
        assert complete_settings(car, method, {}, preset)["rank"] == len(car.coordinates) == 2
        with pytest.raises(InputError, match="rank 3 is above the 2 coordinates of quarter_car"):
            vm.simulate(car, method, preset=preset, rank=3, formulation="coordinates")
    suspension = vm.model("double_wishbone")
    assert complete_settings(suspension, method, {})["rank"] == 3
