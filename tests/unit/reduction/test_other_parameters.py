"""Reduced models of a model with other parameters: the same as fitted to it, or refused."""

from functools import cache

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor.exceptions import InputError
from vehiclemor.reduction.training import TrainingRun, difference
from vehiclemor.reduction.validation import fitted, for_model, validated
from vehiclemor.registry import component, names
from vehiclemor.simulation.build import reparametrised

LANE = component("maneuver", "lane_change")
HEAVY = {"sprung_mass": 1050.0, "PKY1": -21.0}
METHODS = names("method")


@cache
def car():
    return vm.model("independent_suspension_vehicle")


@cache
def heavy():
    return reparametrised(car(), HEAVY)


def reduced(name, model, trained):
    method = component("method", name)
    settings = validated(method, model.kind, {}, coordinates=14)
    runs = [TrainingRun(trained, LANE, trained.starts[0])]
    return method, fitted(method, model, runs, settings), settings


def of_kind(learns_from):
    methods = [component("method", name) for name in METHODS]
    return [m.name for m in methods if m.learns_from == learns_from and m.accepts(car())[0]]


@pytest.mark.parametrize("name", of_kind("runs"))
def test_what_learns_from_runs_refuses_those_of_another_model(name):
    with pytest.raises(InputError, match="of a training run is another"):
        reduced(name, heavy(), car())


@pytest.mark.parametrize("name", of_kind("nothing"))
def test_what_looks_at_no_run_is_the_same_remade_and_fitted(name):
    method, own, settings = reduced(name, car(), car())
    remade = for_model(method, own, heavy(), settings).simulate(LANE, "equilibrium")
    _, direct, _ = reduced(name, heavy(), heavy())
    np.testing.assert_array_equal(remade.outputs, direct.simulate(LANE, "equilibrium").outputs)


def test_a_map_of_paths_is_made_anew_between_the_inputs_of_its_training():
    moved = {"tie_rod_inner.z": -0.09}
    known = vm.reduce("double_wishbone", "path_map", training="nominal").for_parameters(moved)
    direct = vm.reduce(vm.model("double_wishbone", moved), "path_map", training="nominal")
    np.testing.assert_array_equal(known.simulate().outputs, direct.simulate().outputs)


def test_how_a_run_starts_is_not_of_which_model_it_is():
    assert difference(car(), heavy()) in HEAVY
    faster = reparametrised(car(), {"initial_speed": 25.0, "drop_height": 0.02})
    assert difference(car(), faster) == ""
    _, found, _ = reduced("pod", car(), faster)
    alone = vm.reduce(faster, "pod", training="nominal").simulate()
    run = found.simulate(LANE, faster.start())
    np.testing.assert_allclose(run.outputs, alone.outputs, atol=1e-6)
