"""Reduced models of other cars than those of their training: right, warned of, or refused."""

from functools import cache

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor.errors import InputError
from vehiclemor.reduction.cars import cars_of, difference
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.validation import fitted, of_car, validated
from vehiclemor.reduction.vehicle import own_runs
from vehiclemor.reduction.vehicle.shape import VehicleShape
from vehiclemor.reduction.vehicle.slow_modes import as_of, slow_modes
from vehiclemor.registry import component, names
from vehiclemor.simulation.build import reparametrised

GV, LANE = "independent_suspension_vehicle", component("maneuver", "lane_change")
BOX = {"sprung_mass": [800.0, 1100.0], "PKY1": [-24.0, -20.0]}
HEAVY, HEAVIER = {"sprung_mass": 1050.0, "PKY1": -21.0}, {"sprung_mass": 1300.0}
# A box of cars is learnt around one of them.
AROUND_ITS_OWN = ("slow_manifold", "guarded")
# Their subspaces contain nothing but the training.
PERIODS = ("pod", "fixed_basis")
QUICK = {
    "operator_inference": {"degree": 1},
    "slow_manifold": {"sweeps": 0, "terms": 0},
    "guarded": {"fast_settings": "sweeps = 0, terms = 0"},
}


@cache
def car():
    return vm.model(GV)


@cache
def heavy():
    return reparametrised(car(), HEAVY)


def reduced(method, model, *trained):
    definition = component("method", method)
    settings = validated(definition, model.kind, QUICK.get(method, {}), coordinates=14)
    runs = [TrainingRun(m, LANE, m.starts[0]) for m in trained]
    return definition, fitted(definition, model, runs, settings), settings


@cache
def of_box(bases="concatenated"):
    return vm.reduce(car(), "pod", training="nominal", cars=BOX, bases=bases)


def roll_errors(model, run):
    full = model.simulate(LANE)
    column = model.outputs.index("roll")
    return float(np.abs(run.outputs - full.outputs)[:, column].max())


@pytest.mark.parametrize(
    "name", [n for n in names("method") if component("method", n).accepts(car())[0]]
)
def test_every_method_uses_runs_of_another_car_rightly_or_refuses_them(name):
    method = component("method", name)
    if not method.accepts(car())[0]:
        return
    if method.learns_from == "own" or name in AROUND_ITS_OWN:
        with pytest.raises(InputError, match="car") as caught:
            reduced(name, heavy(), car())
        assert "\n" not in str(caught.value)
        return
    _, found, _ = reduced(name, heavy(), car())
    if name == "replay":
        run = found.simulate(LANE, "equilibrium")
        np.testing.assert_array_equal(run.outputs, car().simulate(LANE).outputs)
        return
    # What is learnt of the other car is no more than a subspace: straight on, without steering,
    # there is nothing of it.
    straight = component("maneuver", "straight_ahead")
    run, full = found.simulate(straight, "equilibrium"), heavy().simulate(straight)
    asides = [car().outputs.index(name) for name in ("lateral_position", "yaw", "roll")]
    if name not in PERIODS:
        np.testing.assert_allclose(run.outputs[:, asides], full.outputs[:, asides], atol=2e-3)


@pytest.mark.parametrize("name", names("method"))
def test_what_looks_at_no_run_is_the_same_remade_and_fitted(name):
    method = component("method", name)
    if method.learns_from != "inputs" or not method.accepts(car())[0]:
        return
    definition, own, settings = reduced(name, car(), car())
    remade = of_car(definition, own, heavy(), settings).simulate(LANE, "equilibrium")
    _, direct, _ = reduced(name, heavy(), heavy())
    np.testing.assert_array_equal(remade.outputs, direct.simulate(LANE, "equilibrium").outputs)


def test_replay_gives_the_run_of_the_nearest_car_as_that_car_had_it():
    replay = vm.reduce(car(), "replay", training="nominal", cars=[HEAVY, HEAVIER])
    run = replay.for_parameters({"sprung_mass": 1040.0, "PKY1": -21.0}).simulate()
    np.testing.assert_array_equal(run.outputs, heavy().simulate(LANE).outputs)
    assert run.status == "untrusted"
    assert "run of a car with another sprung_mass" in run.message
    assert replay.for_parameters(HEAVY).simulate().status == "ok"


@pytest.mark.parametrize("bases", ["concatenated", "interpolated"])
def test_pod_of_one_car_does_not_depend_on_how_bases_of_several_are_joined(bases):
    alone = vm.reduce(car(), "pod", training="nominal", bases=bases)
    again = alone.for_parameters({"sprung_mass": float(car().parameters["sprung_mass"])})
    np.testing.assert_allclose(again.simulate().outputs, alone.simulate().outputs, atol=1e-9)


def test_interpolated_bases_are_each_cars_own_where_it_was_trained():
    own = vm.reduce(heavy(), "pod", training="nominal")
    both = vm.reduce(car(), "pod", training="nominal", cars=[HEAVY, HEAVIER], bases="interpolated")
    there = both.for_parameters(HEAVY)
    error, expected = (roll_errors(heavy(), rom.simulate()) for rom in (there, own))
    assert error < 1.5 * expected + 1e-5


def test_interpolated_bases_predict_cars_between_that_other_bases_do_not():
    errors = {
        bases: roll_errors(heavy(), of_box(bases).for_parameters(HEAVY).simulate())
        for bases in ("concatenated", "interpolated")
    }
    assert errors["interpolated"] < 0.5 * errors["concatenated"]


def test_cars_beyond_the_box_are_not_trusted():
    box = of_box("interpolated")
    inside, beyond = (box.for_parameters(p).simulate() for p in (HEAVY, HEAVIER))
    assert inside.status == "ok"
    assert beyond.status == "untrusted"
    assert "sprung_mass is 1300; the cars of the training have 800 to 1100" in beyond.message
    alone = vm.reduce(car(), "pod", training="nominal").for_parameters(HEAVY).simulate()
    assert alone.status == "untrusted"
    # How a run starts is not which car it is.
    dropped = box.for_parameters({"drop_height": 0.02})
    assert dropped.simulate().status == "ok"
    # But POD of one run drives at its speed, whatever that of another is.
    slower = box.for_parameters({"initial_speed": 19.9})
    assert not slower.input_range.cars.trust(slower.model).reason
    assert "runs that check this car" in slower.simulate().message
    batch = vm.simulate_many(box.for_parameters(HEAVIER), [LANE, LANE.perturbed(1.0, 0.9)])
    assert set(batch["status"].values.tolist()) == {"untrusted"}


def test_a_car_is_doubted_where_the_basis_of_the_box_is_far_worse_than_its_own():
    joined, between = of_box(), of_box("interpolated")
    for parameters in ({}, HEAVY):
        model = reparametrised(car(), parameters)
        own = roll_errors(model, vm.reduce(model, "pod", training="nominal").simulate())
        bad, good = (rom.for_parameters(parameters) for rom in (joined, between))
        assert bad.reduced.doubt
        assert bad.simulate().status == "untrusted"
        assert "times those of a model of the first car alone" in bad.simulate().message
        assert roll_errors(model, bad.simulate()) > 3.0 * own
        assert not good.reduced.doubt
        assert good.simulate().status == "ok"
        assert roll_errors(model, good.simulate()) < 3.0 * own
    assert joined.simulate().status == "untrusted"
    batch = vm.simulate_many(joined.for_parameters(HEAVY), [LANE])
    assert batch["status"].item() == "untrusted"
    state = joined.state()
    assert joined.trust(state, np.zeros(1)).reason


def test_cars_are_checked_by_inputs_that_have_no_name_too(tmp_path):
    times = np.linspace(0.0, 5.0, 51)
    own = vm.Signal.from_samples(times, LANE.at(times))
    box = vm.reduce(car(), "pod", training=[own], cars=[HEAVY, HEAVIER])
    for rom in (box, vm.load(box.save(tmp_path / "box.nc"))):
        assert rom.for_parameters(HEAVY).simulate(own).status == "untrusted"


def test_a_method_that_is_exact_for_every_car_has_none_beyond():
    exact = vm.reduce(car(), "full_order", training="nominal").for_parameters(HEAVIER)
    assert exact.simulate().status == "ok"


def test_a_guard_hands_cars_beyond_the_box_over():
    _, guard, _ = reduced("guarded", car(), car())
    exact = guard.safe.for_car(heavy()).simulate(LANE, "equilibrium")
    fast = guard.fast
    with pytest.raises(InputError, match="is fitted to one car"):
        guard.for_car(heavy())
    object.__setattr__(guard, "fast", guard.safe)
    object.__setattr__(guard, "fast_name", "full_order")
    run = guard.for_car(heavy()).simulate(LANE, "equilibrium")
    object.__setattr__(guard, "fast", fast)
    np.testing.assert_array_equal(run.outputs, exact.outputs)
    assert "by full_order: sprung_mass is 1050" in run.remark


WRONG = {
    "no-parameter": ({"mass": [1.0, 2.0]}, "is not a parameter"),
    "ends": ({"sprung_mass": [1100.0, 900.0]}, "not the two ends of a range"),
    "number": ({"sprung_mass": 900.0}, "not the two ends of a range"),
    "nothing": ({"sprung_mass": None}, "sprung_mass is None, not the two ends of a range"),
    "start": ({"initial_speed": [18.0, 22.0]}, "initial_speed says how a run starts"),
    "empty-box": ({}, "a box without parameters"),
    "no-cars": ("heavy", "neither ranges of parameters nor a list of cars"),
    "no-car": ([900.0], "neither ranges of parameters nor a list of cars"),
    "impossible": ({"whole_car_yaw_inertia": [300.0, 2000.0]}, "no body has"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_cars_are_refused_in_one_line(case):
    cars, why = WRONG[case]
    with pytest.raises(vm.VehiclemorError, match=why) as caught:
        vm.reduce(car(), "pod", training="nominal", cars=cars)
    assert "\n" not in str(caught.value)


def test_places_in_a_box():
    cars = cars_of([car(), heavy(), car(), reparametrised(car(), HEAVIER)])
    assert len(cars.values) == 3
    assert cars.numbers([heavy(), car()]) == [1, 0]
    np.testing.assert_allclose(np.abs(cars.places(cars.values)).max(axis=0), 1.0)
    assert difference(car(), reparametrised(car(), {"initial_speed": 25.0})) == ""
    assert difference(car(), heavy()) in HEAVY


def test_slow_modes_of_another_car_span_the_same_in_coordinates_near_the_first():
    first = slow_modes(VehicleShape(car()), 45.0, 2)
    shape = VehicleShape(heavy())
    own, found = slow_modes(shape, 45.0, 2), as_of(shape, first)
    np.testing.assert_allclose(found.left @ found.right, np.eye(8), atol=1e-8)
    k = first.lateral
    np.testing.assert_allclose(found.left[:k] @ first.right[:, :k], np.eye(k), atol=1e-8)
    values, expected = (np.sort_complex(np.linalg.eigvals(m.rates)) for m in (found, own))
    np.testing.assert_allclose(values, expected, atol=1e-6)
    # z' = A z exactly along the linearised shape, in whichever coordinates of the span.
    residual = found.left @ shape.linearised.a - found.rates @ found.left
    assert np.abs(residual).max() < 1e-5
    same = as_of(VehicleShape(car()), first)
    np.testing.assert_allclose(same.left, first.left, atol=1e-8)


def test_a_slow_manifold_of_a_box_knows_cars_between_and_how_far_it_is_right(monkeypatch):
    runs = [LANE.perturbed(1.0, a) for a in (0.5, 0.8, 1.0)]
    quick = {"sweeps": 1, "terms": 12, "training": runs}
    ends = [{"PKY1": stiffness} for stiffness in (-25.0, -23.5, -20.5, -19.0)]
    box = vm.reduce(car(), "slow_manifold", cars=ends, **quick)
    between, lane = {"PKY1": -24.3}, LANE.perturbed(1.0, 0.7)
    model = reparametrised(car(), between)
    run = box.for_parameters(between).simulate(lane)
    full, nominal = model.simulate(lane), car().simulate(lane)
    column = model.outputs.index("lateral_position")
    error = np.abs(run.outputs - full.outputs)[:, column].max()
    assert run.status == "ok"
    assert error < 0.25 * np.abs(nominal.outputs - full.outputs)[:, column].max()
    # That it is another car is told first, and of the whole run.
    assert "from t = 0 s on PKY1 is -27" in box.for_parameters({"PKY1": -27.0}).simulate().message
    # With all runs of the car itself wrong it knows nothing.
    monkeypatch.setattr(own_runs, "TRUSTED", 0.0)
    told = box.for_parameters(between).simulate(lane)
    assert told.status == "untrusted"
    assert "leaves what the training runs have covered" in told.message


def test_a_box_of_slow_manifolds_needs_inputs_that_each_car_can_drive():
    own = vm.Signal.from_samples(LANE.times, LANE.at(LANE.times))
    quick = {"sweeps": 0, "terms": 0, "training": [own]}
    with pytest.raises(InputError, match="none of them is a registered maneuver"):
        vm.reduce(car(), "slow_manifold", cars=[HEAVY], **quick)


def test_a_loaded_model_of_a_box_gives_other_cars_too(tmp_path):
    path = of_box("interpolated").save(tmp_path / "box.nc")
    there, again = (rom.for_parameters(HEAVY) for rom in (of_box("interpolated"), vm.load(path)))
    np.testing.assert_array_equal(again.simulate().outputs, there.simulate().outputs)
    assert vm.load(path).for_parameters(HEAVIER).simulate().status == "untrusted"
