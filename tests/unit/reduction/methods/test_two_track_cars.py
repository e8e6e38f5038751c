"""Two-track models of a box of cars: each car's own, checked, and warned of beyond the box."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor.errors import InputError
from vehiclemor.reduction.vehicle import two_track_cars
from vehiclemor.reduction.vehicle.mirror import mirror
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.reduction.vehicle.two_track_fit import straight
from vehiclemor.registry import component
from vehiclemor.study.scenario import Scenario, start_of, training_run

NAME = "high_fidelity_vehicle"
LANE_CHANGE = component("maneuver", "rack_lane_change")
RUNS = [(f, a, v) for f in (0.8, 1.1, 1.6) for a in (-0.6, 1.2) for v in (19.0, 20.0, 21.5)]
CORNERS = [
    {"chassis_mass": 1300.0, "cornering_stiffness": 130000.0},
    {"chassis_mass": 1700.0, "cornering_stiffness": 105000.0},
]


def model(parameters=None) -> Any:
    return vm.model(NAME, parameters=parameters)


def scenario(frequency, amplitude, speed, start="equilibrium"):
    return Scenario(LANE_CHANGE.perturbed(frequency, amplitude), start, speed)


@cache
def of_box() -> Any:
    return vm.reduce(
        NAME,
        "two_track",
        training=[scenario(*run) for run in RUNS],
        cars=CORNERS,
        terms=8,
        even_terms=12,
        wheel_terms=6,
        sweeps=4,
    )


@cache
def corner(number) -> Any:
    return of_box().for_parameters(CORNERS[number])


def unseen(rom):
    """A run that no model was trained on, and the full one."""
    case = scenario(1.1, -1.0, 20.5)
    start = start_of(rom.model, case)
    return rom.simulate(case.maneuver, start), rom.model.simulate(case.maneuver, start)


def apart(run, other, name="lateral_position"):
    column = model().outputs.index(name)
    return np.abs(run.outputs[:, column] - other.outputs[:, column]).max()


def test_the_first_car_is_as_it_was_fitted_and_nearly_so_when_it_is_remade():
    first = of_box()
    assert first.for_parameters({}).reduced is first.reduced
    remade = corner(0).for_parameters({name: first.parameters[name] for name in CORNERS[0]})
    (run, full), (again, _) = unseen(first), unseen(remade)
    assert run.status == again.status == "ok"
    # The one is checked by a run that the other has learnt from.
    assert apart(again, run) < 0.1
    assert apart(run, full) < 0.1


@pytest.mark.parametrize("number", [0, 1])
def test_a_car_at_a_corner_is_predicted(number):
    run, full = unseen(corner(number))
    assert run.status == "ok"
    for name in ("lateral_position", "longitudinal_position"):
        assert apart(run, full, name) < 0.05
    # The first car drives elsewhere.
    assert apart(unseen(of_box())[1], full) > 0.2


def test_its_terms_are_those_of_the_first_car_and_its_tires_its_own():
    first, other = of_box().reduced, corner(0).reduced
    assert other.features == first.features
    assert other.lifted_features == first.lifted_features
    stiffness = CORNERS[0]["cornering_stiffness"] / 3.0
    assert np.isclose(other.parameters, stiffness).any()
    assert not np.isclose(first.parameters, stiffness).any()


def test_a_car_beyond_the_box_is_not_trusted():
    heavy = of_box().for_parameters({"chassis_mass": 1750.0})
    run, _ = unseen(heavy)
    assert run.status == "untrusted"
    assert "chassis_mass is 1750; the cars of the training have 1300 to 1700" in run.message


def test_a_car_whose_own_runs_tell_otherwise_is_not_trusted(monkeypatch):
    def worse(reduced, *_):
        spoilt = reduced.coefficients.copy()
        spoilt[:, 5] *= 1.02
        return replace(reduced, coefficients=spoilt)

    monkeypatch.setattr(two_track_cars, "improved", worse)
    run, _ = unseen(of_box().for_parameters(CORNERS[0]))
    assert run.status == "untrusted"
    assert run.trust.indicator > 10.0


def test_a_car_that_slides_wherever_it_is_driven_is_refused():
    first = of_box().reduced
    strict = replace(first, box=replace(first.box, sliding=1e-3))
    with pytest.raises(InputError, match="slides or is lost"):
        strict.for_car(model(CORNERS[0]))


def test_a_mirror_image_does_not_hang_on_modes_of_one_frequency():
    """Of this car a mode of pitch and one of roll are so near that their vectors are mixed."""
    mixed = {
        "chassis_mass": 1724.1808314915845,
        "chassis_centre.z": 0.19814550005794274,
        "front_stiffness": 63716.10948528951,
        "rear_stiffness": 43695.736123788025,
        "front_damping": 12261.706625030742,
        "cornering_stiffness": 110192.62918363753,
    }
    image, other = (mirror(VehicleShape(model(car))) for car in ({}, mixed))
    np.testing.assert_array_equal(image, other)


def test_runs_that_begin_with_a_drop_are_not_learnt_from():
    car = model()
    starts = ("equilibrium", "dropped", "equilibrium")
    runs = [training_run(car, scenario(1.0, 1.0, 18.0 + i, s)) for i, s in enumerate(starts)]
    assert straight(car, runs) == [runs[0], runs[2]]
    with pytest.raises(InputError, match="straight running"):
        straight(car, runs[1:2])


def test_what_is_saved_makes_the_same_cars(tmp_path):
    of_box().save(tmp_path / "box.nc")
    found = vm.load(tmp_path / "box.nc").for_parameters(CORNERS[0])
    np.testing.assert_allclose(unseen(found)[0].outputs, unseen(corner(0))[0].outputs, atol=1e-6)
