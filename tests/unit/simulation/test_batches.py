"""Batches of runs: each is the run alone, in however many threads."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import vehiclemor as vm
from tests.models import CAR, WISHBONE
from vehiclemor.exceptions import InputError
from vehiclemor.registry import component
from vehiclemor.simulation import batches
from vehiclemor.simulation.trajectory import FINISHED

TIMES = np.linspace(0.0, 4.0, 41)
KEPT = {"outputs": ["lateral_position", "Fz_FL", "u"], "times": [0.5, 1.0, 3.98]}


ALL_OUTPUTS = vm.model(CAR).outputs


@pytest.fixture(scope="module")
def reduced():
    """The reduced car that ships: a slow manifold with the full order behind it."""
    return vm.rom(CAR)


@pytest.fixture(scope="module")
def full(reduced):
    """The full car with its fastest integrator."""
    return vm.reduce(reduced.model, "full_order", solver="etdrk4", tolerance=1e-2)


def steering(runs, size=0.02):
    """Steering angles (runs, samples) in rad that set in at different times."""
    rng = np.random.default_rng(1)
    past = np.maximum(TIMES - rng.uniform(0.2, 1.5, (runs, 1)), 0.0)
    rate, height = rng.uniform(1.0, 4.0, (runs, 1)), rng.uniform(-1.0, 1.0, (runs, 1))
    return size * height * np.sin(rate * past) * np.tanh(past)


def check_alone(model, signals, found, starts=None):
    """Each run of a batch is the run alone, to the bit."""
    assert found.run.values.tolist() == [*range(len(signals))]
    for run, signal in enumerate(signals):
        start = starts if starts is None or isinstance(starts, str) else starts[run]
        names = tuple(str(name) for name in found.output.values)
        alone = model.simulate(signal, start, outputs=None if names == ALL_OUTPUTS else names)
        rows = np.searchsorted(alone.times, found.time.values - 1e-9)
        expected = alone.outputs[rows]
        np.testing.assert_array_equal(found["values"].values[run], expected)
        own = found.isel(run=run)
        for name in ("status", "message", "remark"):
            assert own[name].item() == getattr(alone, name)
        assert {name: own[name].item() for name in alone.counts} == alone.counts
        if alone.trust:
            assert own.indicator.item() == alone.trust.indicator
            assert own.until.item() == alone.trust.until


@pytest.mark.parametrize("kept", [{}, KEPT, {"outputs": "yaw"}], ids=["all", "few", "state"])
@pytest.mark.parametrize("start", [None, "dropped"])
@pytest.mark.parametrize("which", ["reduced", "full"])
def test_runs_are_those_alone(which, start, kept, request):
    model = request.getfixturevalue(which)
    signals = vm.many_signals(TIMES, steering(6), "cubic")
    found = vm.simulate_many(model, signals, start, **kept)
    assert found.status.isin(FINISHED).all()
    check_alone(model, signals, found, start)


def test_every_run_has_a_start_of_its_own(reduced, full):
    own = reduced.model.start("equilibrium")
    moved = np.array([own, 1.02 * own, own, 0.97 * own])
    signals = vm.many_signals(TIMES, steering(4), "zero")
    for model in (reduced, full):
        for starts in (moved, [own, "dropped", "equilibrium", moved[3]]):
            check_alone(model, signals, vm.simulate_many(model, signals, starts, **KEPT), starts)


@settings(max_examples=12)
@given(chunk=st.integers(1, 9), jobs=st.integers(1, 4), runs=st.integers(1, 20))
def test_neither_threads_nor_chunks_change_a_bit(reduced, chunk, jobs, runs):
    signals = vm.many_signals(TIMES, steering(20, 0.06)[:runs])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(batches, "CHUNK", chunk)
        found = vm.simulate_many(reduced, signals, jobs=jobs, **KEPT)
    whole = vm.simulate_many(reduced, vm.many_signals(TIMES, steering(20, 0.06)), jobs=1, **KEPT)
    xr.testing.assert_identical(
        found.drop_vars("seconds").drop_attrs(),
        whole.isel(run=slice(runs)).drop_vars("seconds").drop_attrs(),
    )


def test_what_fails_is_a_result_beside_the_others(reduced, full):
    u, states = steering(5), reduced.model.definition.states
    # Beyond the steering angles for which the model holds, and a car that is thrown on its side.
    u[3] = 1.2 * np.tanh(TIMES)
    signals = vm.many_signals(TIMES, u, "cubic")
    thrown = reduced.model.start("equilibrium")
    thrown[states.index("phi")], thrown[states.index("p")] = 0.9, 8.0
    starts = ["equilibrium", thrown, *["equilibrium"] * 3]
    for model in (reduced, full, full.model):
        found = vm.simulate_many(model, signals, starts, **KEPT)
        # A reduced car that comes to its end says that its error is large.
        failed = "untrusted" if model is reduced else "diverged"
        assert found.status.values.tolist() == ["ok", failed, "ok", "rejected", "ok"]
        assert "delta is" in found.message.item(3)
        assert ("error" if model is reduced else "roll is") in found.message.item(1)
        assert np.isnan(found["values"][3]).all()
        assert np.isnan(found["values"][1]).all() == (model is not reduced)
        assert (found.rhs_calls.values > 0).tolist() == [True, True, True, False, True]
        others = [0, 2, 4]
        alone = vm.simulate_many(model, vm.many_signals(TIMES, u[others], "cubic"), **KEPT)
        np.testing.assert_array_equal(found["values"][others], alone["values"])
        if model is not full.model:
            check_alone(model, signals[1:2], found.isel(run=[1]).assign_coords(run=[0]), [thrown])


def test_maneuvers_of_different_lengths_share_chosen_times(full):
    names = "step_steer", "lane_change", "multisine"
    maneuvers = [component("maneuver", name) for name in names]
    with pytest.raises(InputError, match=r"signals\[1\] has other output times"):
        vm.simulate_many(full, maneuvers)
    found = vm.simulate_many(full, names, times=[0.0, 1.0, 2.5], outputs=["yaw", "Fz_RR"])
    check_alone(full, maneuvers, found)


@pytest.mark.parametrize("method", ["full_order", "path_map"])
def test_mechanisms_in_batches(method):
    model = vm.rom(WISHBONE) if method == "path_map" else vm.reduce(WISHBONE, method)
    waves = 0.04 * np.sin(np.outer([1.0, 2.0, 2.5], TIMES))
    waves[2] *= 6.0
    signals = vm.many_signals(TIMES, np.stack([waves, 0.0 * waves], axis=2), "cubic")
    found = vm.simulate_many(model, signals)
    assert found.status.values.tolist()[:2] == ["ok", "ok"]
    assert found.status.item(2) in ("untrusted", "unreachable")
    check_alone(model, signals[:2], found.isel(run=slice(2)))


def test_parameters_by_run(full):
    masses, signals = ([1400.0, 1500.0, 1500.0, -1.0], vm.many_signals(TIMES, steering(4), "cubic"))
    table = vm.simulate_many(full, signals, parameters={"sprung_mass": masses}, **KEPT)
    listed = [{"sprung_mass": mass} for mass in masses]
    xr.testing.assert_equal(
        table.drop_vars("seconds"),
        vm.simulate_many(full, signals, parameters=listed, **KEPT).drop_vars("seconds"),
    )
    assert table.status.values.tolist() == ["ok", "ok", "ok", "rejected"]
    heavy = vm.model(CAR, parameters={"sprung_mass": 1500.0})
    own = vm.reduce(heavy, "full_order", solver="etdrk4", tolerance=1e-2)
    alone = vm.simulate_many(own, signals[1:3], **KEPT)
    np.testing.assert_array_equal(table["values"][1:3], alone["values"])
    assert abs(table["values"] - table["values"][0])[1].max() > 1e-3


STATE = [0.0] * 27


# What is wrong, and the name that the error begins with.
WRONG = [
    (("signals", [1.0]), "signals"),
    (("signals", [component("maneuver", "sine_travel")]), "sine_travel"),
    (("starts", "above"), "start 'above'"),
    (("starts", STATE), "start"),
    (("outputs", ["yaww"]), "output 'yaww'"),
    (("times", [1.0, 0.5]), "times"),
    (("times", [0.505]), "0.505 s is no output time"),
    (("model", 3), "model"),
    *((("parameters", given), "'mass'") for given in ({"mass": 1.0}, [{"mass": 1.0}] * 2)),
    *((("parameters", given), "parameters") for given in ([{}], [None] * 2)),
    (("parameters", {"sprung_mass": [1.0] * 3}), "sprung_mass"),
]


@pytest.mark.parametrize(("change", "word"), WRONG)
def test_wrong_input_is_one_line(change, word, full):
    name, value = change
    given = {"model": full, "signals": vm.many_signals(TIMES, steering(2))} | {name: value}
    with pytest.raises(InputError) as error:
        vm.simulate_many(**given)
    assert word in str(error.value)


def test_what_can_not_be_kept_is_refused(full, monkeypatch):
    signals = vm.many_signals(TIMES, steering(2))
    fitted = vm.reduce(full.model, "pod", training="nominal")
    with pytest.raises(InputError, match="is trained on runs of one model"):
        vm.simulate_many(fitted, signals, parameters={"sprung_mass": 1400.0})
    monkeypatch.setattr(batches, "LARGEST", 1000)
    for outputs in (["yaw", "roll"], None):
        with pytest.raises(InputError, match="GB of memory: choose outputs=, times="):
            vm.simulate_many(full, signals, outputs=outputs)
