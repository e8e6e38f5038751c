"""Reduced structures: their modes, bases, steps and slopes; what they keep, and how far they go."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.linalg import eigh

import vehiclemor as vm
from tests.models import TRUCK
from vehiclemor.exceptions import InputError
from vehiclemor.reduction.projection.structural import modes_within
from vehiclemor.registry import component, names
from vehiclemor.simulation.structures.model import relative_error

HEIGHTS = ("road_FL", "road_FR", "road_RL", "road_RR")
ROAD, SHORT = vm.road("C", 3), {"tolerance": 1e-2}


def signal(size=0.02, duration=1.0, rate=4.0):
    def height(t):
        return size * np.sin(rate * np.pi * t) * np.sin(0.5 * np.pi * t) ** 2

    return vm.Signal.from_function(height, duration, inputs=["z"], output_step=0.01)


def bumps(size=0.02, duration=1.0):
    """Heights under the wheels of the truck."""
    times = np.linspace(0.0, duration, 201)
    paths = [size * np.sin(0.5 * np.pi * times) ** 2 * np.sin(f * times) for f in (9, 11, 13, 15)]
    u = np.column_stack(paths)
    return vm.Signal.from_samples(times, u, "cubic", inputs=HEIGHTS, output_step=0.01)


@pytest.fixture(scope="module")
def model(chain):
    return chain()


@cache
def truck():
    return vm.model(TRUCK)


def learns_nothing(name):
    method = component("method", name)
    return method.learns_from == "nothing" and "structural" in method.settings


def error_of(rom, given, full=None):
    full = rom.model.simulate(given, tolerance=1e-4) if full is None else full
    run = rom.simulate(given)
    assert run.status == "ok"
    return relative_error(run.outputs, full.outputs)


# Bases


def squares(structure, law, model):
    """Squared natural frequencies on springs and tires at the static state, small ones first."""
    rest = np.zeros(law.static.shape[1])
    slopes = -law.at(rest, rest, np.zeros(len(model.inputs)))[:, 1]
    mass, stiffness, ports = (
        m.toarray() for m in (structure.mass, structure.stiffness, structure.ports)
    )
    return eigh(stiffness + ports * slopes @ ports.T, mass, eigvals_only=True)


def test_frequencies_come_down_to_those_of_the_full_structure(model):
    system, before, errors, full = model.system, np.full(3, np.inf), [], None
    exact = squares(system.structure, system.law, model)[:3]
    for highest in (20.0, 50.0, 90.0, 1e5):
        rom = vm.reduce(
            model, "craig_bampton", training=[signal()], highest=highest, tolerance=1e-4
        )
        first = rom.reduced.system
        found = squares(first.structure, first.law, model)[:3]
        assert (exact * (1.0 - 1e-9) <= found).all()
        assert (found <= before * (1.0 + 1e-9)).all()
        before, full = found, full or model.simulate(signal(), tolerance=1e-4)
        errors.append(error_of(rom, signal(), full))
    np.testing.assert_allclose(before, exact, rtol=1e-9)
    # All modes are the whole space: the full order.
    assert errors[0] > 2.0 * errors[1] > 4.0 * errors[2]
    assert errors[-1] < 1e-7
    assert rom.reduced.order == model.size


def test_more_vectors_of_pod_are_better_until_they_are_all(model):
    trained, test, errors = signal(), signal(0.018, rate=5.0), []
    full = model.simulate(test, tolerance=1e-4)
    for rank in (1, 2, 4, 8):
        rom = vm.reduce(model, "fixed_basis", training=[trained], rank=rank, tolerance=1e-4)
        errors.append(relative_error(rom.simulate(test).outputs, full.outputs))
    assert errors[0] > 2 * errors[1] > 4 * errors[2] > 8 * errors[3]
    any_basis = np.random.default_rng(0).standard_normal((model.size, model.size))
    modes = modes_within(model.system.structure, any_basis)
    exact = replace(rom.reduced, basis=modes, tolerance=1e-4)
    assert relative_error(exact.simulate(test, "equilibrium").outputs, full.outputs) < 1e-7


@pytest.fixture(scope="module")
def small(model):
    return vm.reduce(model, "craig_bampton", training=[signal()], highest=60.0, tolerance=1e-4)


# In use


def test_a_saved_truck_is_the_same_to_the_bit_and_so_are_many_runs(tmp_path):
    rom = vm.reduce(truck(), "craig_bampton", training=[bumps()], highest=30.0, **SHORT)
    again, runs = vm.load(rom.save(tmp_path / "truck.nc")), [bumps(0.01), bumps(0.02)]
    alone = [rom.simulate(given).outputs for given in runs]
    np.testing.assert_array_equal([again.simulate(given).outputs for given in runs], alone)
    for jobs in (1, 2):
        found = vm.simulate_many(again, runs, jobs=jobs)
        np.testing.assert_array_equal(found["values"], alone)
    loaded = vm.simulate_many(rom, runs, parameters={"payload": [0.0, 4000.0]})
    for given, payload, values in zip(runs, (0.0, 4000.0), loaded["values"], strict=True):
        other = rom.for_parameters({"payload": payload}).simulate(given)
        np.testing.assert_array_equal(values, other.outputs)
    assert np.ptp(loaded["values"].isel(time=0).sel(output="Fz_RL").values) > 5000.0


def test_another_payload_keeps_the_basis_and_other_parameters_make_anew(model):
    heavy = {"payload": 30.0}
    for method, settings in (("craig_bampton", {"highest": 60.0}), ("fixed_basis", {"rank": 5})):
        rom = vm.reduce(model, method, training=[signal()], tolerance=1e-4, **settings)
        other = rom.for_parameters(heavy)
        modes, others = rom.reduced.basis, other.reduced.basis
        assert (
            np.linalg.matrix_rank(np.hstack([modes, others])) == modes.shape[1] == others.shape[1]
        )
        assert other.parameters["payload"] == 30.0
        full = other.model.simulate(signal(), tolerance=1e-4)
        apart = relative_error(rom.simulate(signal()).outputs, full.outputs)
        assert apart > 20.0 * error_of(other, signal(), full)
        anew = vm.reduce(other.model, method, training=[signal()], tolerance=1e-4, **settings)
        assert error_of(other, signal(), full) < 2.0 * error_of(anew, signal(), full) + 1e-3
    with pytest.raises(InputError, match="fixed_basis is trained on runs of one model"):
        rom.for_parameters({"stiffness": 3e4})


def test_a_rougher_road_than_trained_is_not_trusted():
    rom = vm.reduce(truck(), "fixed_basis", training=[bumps()], rank=5, **SHORT)
    assert rom.simulate(bumps()).status == "ok"
    for rougher in (bumps(0.022), vm.road("E", 3)):
        run = rom.simulate(rougher)
        assert run.status == "untrusted"
        assert "leaves its known range by a factor of" in run.message
        assert np.isfinite(run.outputs).all()
    assert rom.trust(rom.state(), np.full(8, 0.1)).reason.startswith("input road_")
    assert "road_FL is 0.6; the model holds" in rom.trust(rom.state(), np.full(8, 0.6)).reason


def test_a_basis_without_a_mode_is_refused_in_one_line():
    with pytest.raises(InputError, match=r"no mode is below 0.001 Hz: the first has"):
        vm.reduce(truck(), "craig_bampton", training=[bumps()], highest=1e-3)


def test_structures_are_not_exported_and_start_from_rest_alone(small, tmp_path):
    for target in ("c", "fmu"):
        with pytest.raises(InputError, match="can't be exported: its equations are no"):
            vm.export(small, target, tmp_path / target)
    with pytest.raises(InputError, match="unknown start 'dropped'"):
        small.state("dropped")
    with pytest.raises(InputError, match="have no parameters"):
        small.jacobian(small.state(), [0.0, 0.0], "stiffness")
    for wrong in (vm.maneuver("lane_change"), signal(0.4)):
        with pytest.raises(InputError, match=r"input|z is"):
            small.simulate(wrong)


def corrugated(hertz, size):
    """A road of one frequency on both sides."""

    def heights(t):
        paths = [
            size * np.sin(2.0 * np.pi * hertz * s) * np.clip(s, 0.0, 1.0) for s in (t, t - 0.2)
        ]
        return np.column_stack([paths[0], paths[0], paths[1], paths[1]])

    further = {"inputs": HEIGHTS, "step": 0.05 / hertz, "output_step": 0.01}
    return vm.Signal.from_function(heights, 2.0, **further)


@pytest.mark.parametrize(
    ("method", "settings"), [("craig_bampton", {"highest": 64.0}), ("fixed_basis", {"rank": 5})]
)
def test_quick_roads_are_not_trusted_however_small_they_are(method, settings):
    rom = vm.reduce(truck(), method, training=[vm.road("D", 5, 25.0)], **settings, **SHORT)
    assert rom.simulate(corrugated(3.0, 0.01)).status == "ok"
    run = rom.simulate(corrugated(100.0, 1e-4))
    assert (run.status, "64 to 128 Hz" in run.message) == ("untrusted", True)


@pytest.mark.parametrize("method", [m for m in names("method") if learns_nothing(m)])
def test_training_that_is_never_read_changes_no_status(method):
    found = []
    for training in (ROAD, ROAD.perturbed(amplitude=5.0)):
        rom = vm.reduce(truck(), method, training=[training], **SHORT)
        run = rom.simulate(vm.road("D", 1))
        found.append((run.status, run.message, run.outputs.tobytes()))
        dataset = vm.simulate(truck(), method, maneuver=ROAD, training=training, **SHORT)
        found[-1] += (dataset["remark"].item(),)
    assert found[0] == found[1]
    assert found[0][0] == "ok"
