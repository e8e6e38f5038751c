"""What vehiclemor demands of every model and method, and what physics demands of this one."""

import numpy as np
from quarter_car.maneuver import ROAD

import vehiclemor as vm
from vehiclemor.plugin import check_method, check_model


def test_the_model_keeps_its_contract():
    check_model("quarter_car")


def test_methods_keep_their_contract_on_the_model():
    for method in ("full_order", "replay", "quarter_car_modes"):
        check_method(method, "quarter_car")


def test_what_the_tire_gives_moves_both_masses():
    car = vm.model("quarter_car")
    run = car.simulate(ROAD, "dropped")
    rates = np.array([car.rhs(*point) for point in zip(run.states, run.inputs, strict=True)])
    masses = [float(car.parameters[name]) for name in ("sprung_mass", "unsprung_mass")]
    force = run.outputs[:, car.outputs.index("tire_force")]
    np.testing.assert_allclose(rates[:, 2:] @ masses, force, rtol=0, atol=1e-9)


def test_all_modes_of_a_linear_model_are_the_model():
    data = vm.simulate("quarter_car", "quarter_car_modes", fastest=1e4, frequency=1.3)
    # Between output times the method takes the road as straight.
    assert (data["rms_error"] < 5e-3 * data["signal_range"]).all()
