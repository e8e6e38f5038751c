"""What every registered reduction method keeps, on every registered model that it accepts."""

import copy
from contextlib import suppress
from dataclasses import replace
from functools import cache, cached_property
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from tests.models import CAR, TRUCK
from tests.oracles import complex_step
from tests.reducing import training_runs
from vehiclemor.codegen.derivatives import JacobianProduct
from vehiclemor.exceptions import InputError
from vehiclemor.exporting.systems import exported_system
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.inputs.signal import Signal
from vehiclemor.multibody.definition import KINDS
from vehiclemor.reduction.interface import FittedModel, Method
from vehiclemor.reduction.reduced_model import ReducedOrderModel, load
from vehiclemor.reduction.settings import Settings
from vehiclemor.reduction.training import own_speed
from vehiclemor.reduction.trust import input_range
from vehiclemor.reduction.validation import fitted, validated
from vehiclemor.registry import component, names
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import STATUSES, trajectory_dataset
from vehiclemor.study.scenario import Scenario

METHODS = names("method")


def _declares(method, model):
    """Whether the method has settings for models of that kind."""
    return component("model", model).kind in component("method", method).settings


COARSE = {"elements_per_bay": 1.0}
PAIRS = [(m, method) for m in names("model") for method in METHODS if _declares(method, m)]
# What they leave out or linearise shows in a lane change: findings, no defects.
LINEAR = ("linear_single_track", "modal_truncation", "balanced_truncation")
LEARNED = (
    *("operator_inference", "sparse_identification", "dynamic_mode_decomposition"),
    *("gaussian_process", "neural_network", "single_track", "trajectory_network"),
)
ROUGH = ("fixed_basis", *LINEAR, *LEARNED)
# One run doesn't determine what these fit: (frequency, amplitude) factors of their training.
TRAINED_ON: dict[str, tuple[tuple[float, float], ...]] = dict.fromkeys(
    ("slow_manifold", "guarded"),
    ((1.0, 1.0), (1.0, -0.6), (0.8, 1.2), (1.3, -1.2), (1.2, 0.8), (0.7, -0.8)),
)


# Quick enough for a test; trusted as far as these runs go.
SETTINGS: dict[str, dict[str, object]] = {
    "slow_manifold": {"steps": 1},
    "guarded": {"steps": 1},
    **{name: {"rank": 4, "steps": 1} for name in LEARNED},
    "single_track": {"iterations": 2},
    "trajectory_network": {"rank": 4, "epochs": 2},
    # Squares that one run does not determine diverge.
    "operator_inference": {"rank": 4, "steps": 1, "form": "linear"},
    "sparse_identification": {"rank": 4, "steps": 1, "degree": 1},
    "neural_network": {"rank": 4, "steps": 1, "epochs": 5},
}


# Methods share models and runs.  The truck's contracts are those of any mesh.
built = cache(lambda name: build(name, overrides=COARSE if name == TRUCK else None))
training = cache(training_runs)


class Pair:
    """A method on a model: fits and runs it."""

    def __init__(self, model, method):
        self.model: Model = built(model)
        self.name, self.method = method, component("method", method)
        self.maneuver: Maneuver = component("maneuver", component("model", model).maneuver)
        self.full = training(self.model, self.maneuver, "matched")[0]
        self._fitted: dict[str, FittedModel] = {}

    @cached_property
    def nominal(self):
        return self.run(self.fit())

    def fit(self, preset="recommended"):
        # Some fits take seconds; a fit does not change once it is made.
        if preset not in self._fitted:
            self._fitted[preset] = self.fresh_fit(preset)
        return self._fitted[preset]

    def fresh_fit(self, preset="recommended"):
        chosen = SETTINGS.get(self.name, {})
        if self.name == "trajectory_network":
            pytest.importorskip("jax_sysid")
        settings = validated(self.method, self.model.kind, chosen, preset)
        self.method.check(self.model, settings)
        before = copy.deepcopy(settings)
        factors = TRAINED_ON.get(self.name, ())
        known = [self.maneuver, "set", factors] if factors else [self.maneuver, "matched"]
        runs = training(self.model, *known)
        reduced = fitted(self.method, self.model, runs, settings)
        assert settings == before
        return reduced

    def space(self):
        """How it is stepped; a test is skipped if it is not."""
        if not hasattr(self.fit(), "step"):
            pytest.skip(f"{self.name} gives whole runs alone")
        return self.fit()

    def run(self, reduced, maneuver=None):
        return reduced.simulate(maneuver or self.maneuver, self.model.starts[0])


@pytest.fixture(scope="module", params=PAIRS, ids="-".join)
def pair(request):
    pair = Pair(*request.param)
    accepted, reason = pair.method.accepts(pair.model)
    if not accepted:
        assert reason
        assert "\n" not in reason
        pytest.skip(reason)
    return pair


@pytest.mark.parametrize("name", METHODS)
def test_a_method_describes_itself_and_its_settings(name):
    method: Method = component("method", name)
    assert (method.name, bool(method.summary)) == (name, True)
    assert method.settings
    assert set(method.presets) <= set(method.settings) <= set(KINDS)
    for kind in set(KINDS) - set(method.settings):
        assert method.names_of(kind) == ()
        accepted, reason = method.accepts(SimpleNamespace(name="box", kind=kind))
        assert not accepted
        assert reason.endswith(f"box is of kind {kind}")
    for kind, declared in method.settings.items():
        assert issubclass(declared, Settings)
        fields = declared.model_fields
        for text in (method.summary, *(field.description for field in fields.values())):
            assert text
            assert "\n" not in text
        defaults = {key: field.default for key, field in fields.items()}
        # What cells store is what they are made of again.
        for values in ({}, defaults):
            assert validated(method, kind, values).model_dump() == defaults
        with pytest.raises(InputError, match="unknown setting"):
            validated(method, kind, {"no_such_setting": 1})
        presets = method.presets_of(kind)
        assert "recommended" in presets
        for preset, values in presets.items():
            complete = validated(method, kind, {}, preset).model_dump()
            assert set(complete) == set(method.names_of(kind))
            assert {key: complete[key] for key in values} == values


def test_a_fit_reads_no_more_of_the_training_than_is_declared(pair):
    readable = {"nothing": (), "inputs": (SimpleNamespace(maneuver=pair.maneuver),)}
    if pair.method.learns_from == "runs":
        pytest.skip(f"{pair.name} reads whole runs")
    settings = validated(pair.method, pair.model.kind, SETTINGS.get(pair.name, {}))
    reduced = pair.method.fit(pair.model, readable[pair.method.learns_from], settings)
    run, known = pair.run(reduced), pair.nominal
    np.testing.assert_array_equal(run.outputs, known.outputs)
    assert (run.counts, run.status, run.message) == (known.counts, known.status, known.message)


def test_every_preset_simulates_the_nominal_maneuver(pair):
    for preset in pair.method.presets_of(pair.model.kind):
        run = pair.nominal if preset == "recommended" else pair.run(pair.fit(preset))
        if pair.name not in LEARNED or run.status != "untrusted":
            assert (run.status, run.message) == ("ok", "")
        for name in ("coordinates", "speeds", "outputs"):
            shape = pair.maneuver.samples, len(getattr(pair.model, name))
            assert getattr(run, name).shape == shape
        np.testing.assert_array_equal(run.times, pair.maneuver.times)
        np.testing.assert_array_equal(run.inputs, pair.maneuver.at(pair.maneuver.times))
        assert np.isfinite(run.states).all()
        assert np.isfinite(run.outputs).all()
        assert set(run.counts) == set(pair.model.counts)
        assert all(type(count) is int and count >= 0 for count in run.counts.values())
        assert run.seconds >= 0.0
        if pair.model.kind == "structural":
            # Its runs have no named states of which outputs are a function.
            continue
        # Outputs are those of the states.  A path map fits both, and where a run is recorded at a
        # few points in each step, cubics give both between: that may cost a thousandth of an
        # output's range, or as much as its states are off.  Rounding of slips is stiff.
        outputs = pair.model.outputs_at(run.states, run.inputs)
        apart = np.abs(run.outputs - outputs).max(axis=0)
        off = np.abs(outputs - pair.full.outputs).max(axis=0)
        allowed = np.maximum(1e-3 * np.ptp(pair.full.outputs, axis=0), off)
        rounding = 1e-8 * np.maximum(1.0, np.abs(outputs).max(axis=0))
        assert (apart <= allowed + rounding).all()


def test_matched_training_comes_near_the_full_order(pair):
    structure = pair.model.kind == "structural"
    dynamic = pair.model.kind in ("ode", "dae")
    if (dynamic and pair.name in ROUGH) or pair.name in LEARNED:
        pytest.skip("not near a lane change: a finding, no defect")
    run, full = pair.nominal, pair.full
    size = full.outputs.max(axis=0) - full.outputs.min(axis=0)
    moving = size > 0.0
    error = np.abs(run.outputs - full.outputs).max(axis=0)
    # In equations of motion errors accumulate; vertical speed, tire forces and slips follow the
    # fast modes, which three vectors don't hold.  The full model's constraints drift by rounding.
    bound = 0.01 if pair.model.kind == "ae" else 0.05
    # Pitch in a lane change is a hundredth of roll: what it is slaved to is fitted.  The speed, of
    # which it is a hundredth too, is fitted by the place that it leads to.
    fast = ("vertical_speed", "_FL", "_FR", "_RL", "_RR", "_drift")
    if pair.name in ("slow_manifold", "guarded"):
        fast = (*fast, "pitch", "longitudinal_speed")
    if structure and pair.name in ("pod", "fixed_basis"):
        # Nor do twenty vectors of motion hold accelerations and strains.
        bound, fast = 0.1, ("_acceleration",)
    chosen = moving & np.array([not name.endswith(fast) for name in pair.model.outputs])
    assert np.all(error[chosen] < bound * size[chosen])


def test_it_is_exported_or_refused_and_its_runs_are_labelled(pair):
    fitted, model = pair.fit(), pair.model
    with suppress(InputError):
        assert exported_system(fitted, "car").name == "car"
    dataset = trajectory_dataset(model, pair.nominal)
    for name in ("coordinate", "output", "input"):
        if name == "coordinate" and model.kind == "structural":
            continue
        assert tuple(dataset[name].values) == getattr(model, f"{name}s")
    with pytest.raises(InputError, match="unknown start"):
        fitted.simulate(pair.maneuver, "upside_down")


def test_results_are_deterministic(pair):
    reduced = pair.fit()
    other = pair.maneuver.perturbed(0.9, 0.8)
    first, _, again = pair.nominal, pair.run(reduced, other), pair.run(reduced)
    runs = [again]
    if pair.method.learns_from == "runs" and (pair.name not in LEARNED or pair.model.name == CAR):
        # A learner draws alike whatever the model.  Methods that learn from no run are fitted a
        # second time where they read no more than they declare.
        runs.append(pair.run(pair.fresh_fit()))
    for run in runs:
        np.testing.assert_array_equal(run.states, first.states)
        np.testing.assert_array_equal(run.outputs, first.outputs)
        assert (run.counts, run.status, run.message) == (first.counts, first.status, first.message)


def test_untrained_inputs_give_a_result_or_say_why_not(pair):
    for factors in ((1.2, 1.2), (2.0, 0.5)):
        perturbed = pair.maneuver.perturbed(*factors)
        run = pair.run(pair.fit(), perturbed)
        assert run.status in STATUSES
        assert np.isfinite(run.outputs).all() == run.finished
        assert bool(run.message) == (run.status != "ok")
        np.testing.assert_allclose(run.inputs, perturbed.at(perturbed.times), rtol=1e-15)


def test_reduced_model_tells_its_size_cost_and_floor(pair):
    reduced, full = pair.fit(), pair.full
    states = len(pair.model.coordinates) + len(pair.model.speeds)
    # Coordinates of a structure have no names.
    assert 0 <= reduced.order <= getattr(pair.model, "size", states)
    assert reduced.offline.seconds >= 0.0
    assert reduced.offline.evaluations >= 0
    best = reduced.best_approximation(full.states)
    if best is not None:
        assert best.shape == full.states.shape
        # A projection: what it gives is its own best approximation.
        again = reduced.best_approximation(best)
        np.testing.assert_allclose(again, best, rtol=0, atol=1e-12)


@pytest.mark.parametrize("zero", [True, False], ids=["held", "linear"])
def test_steps_are_the_run(pair, zero):
    pair.space()
    # So that what is left is no error of the integration.
    tight = {"tolerance": 1e-9} if "tolerance" in pair.method.names_of(pair.model.kind) else {}
    # With a fallback the reduced model is stepped; runs that are steered like this are not its own.
    reduced = replace(getattr(pair.fit(), "reduced", pair.fit()), **tight)
    count, dt = 8, 0.13
    times = 2.0 * dt * np.arange(count + 1)
    inputs = pair.maneuver.at(np.linspace(0.0, 3.0, count + 1))
    hold, names = "zero" if zero else "linear", pair.maneuver.inputs
    maneuver = Signal.from_samples(times, inputs, hold, inputs=names, output_step=dt)
    run = pair.run(reduced, maneuver)
    assert run.finished
    state = reduced.begin(pair.model.starts[0], inputs[0])
    assert len(reduced.states) == len(state)
    if pair.model.kind == "structural":
        _steps_of_a_structure(reduced, maneuver, run, dt)
        return
    dynamic = pair.model.kind != "ae"
    scale = pair.model.error_scale if dynamic else 1.0
    for sample in range(1, 2 * count + 1):
        k, half = divmod(sample - 1, 2)
        rise = 0.0 if zero else 0.5 * (inputs[k + 1] - inputs[k])
        u, ends = inputs[k] + half * rise, None if zero else inputs[k] + (half + 1) * rise
        state = reduced.step(state, u, dt, (sample - 1) * dt, ends)
        now = u if ends is None else ends
        if zero and half:
            # What follows the inputs at once jumps there.
            continue
        (found,) = reduced.decode(state[None], now[None])
        np.testing.assert_allclose(found / scale, run.states[sample] / scale, rtol=1e-6, atol=1e-6)


def _steps_of_a_structure(reduced, maneuver, run, dt):
    """Outputs of steps of a millisecond are near those of the run, whose own are shorter."""
    zero, path = maneuver.hold == "zero", []
    inputs = maneuver.for_inputs(run.model.inputs).at(run.times)
    state = reduced.begin("equilibrium", inputs[0])
    for u, ends in pairwise(inputs):
        path.append(reduced.outputs(state[None], u[None])[0])
        state = reduced.step(state, u, dt, 0.0, None if zero else ends)
    error = np.abs(path - run.outputs[:-1]).max(axis=0)
    # Where the road jumps, forces and accelerations do.
    assert (error < 0.02 * np.ptp(run.outputs, axis=0)).all()


def test_a_state_is_what_a_run_begins_with(pair):
    fit, _ = pair.fit(), pair.space()
    rom, run = ReducedOrderModel(pair.model, pair.name, {}, (), fit), pair.nominal
    for start in pair.model.starts[::-1]:
        state = rom.state(start, run.inputs[0])
        after = rom.step(state, run.inputs[0], 1e-9)
        np.testing.assert_allclose(after, state, rtol=1e-6, atol=1e-6)
    # The last one is the run's.
    found = rom.outputs(state, run.inputs[0])
    if pair.name in TRAINED_ON:
        # Their runs are recorded from the start itself, of which a state is the slow part.
        found = pair.model.outputs_at(pair.model.start()[None], run.inputs[:1])[0]
    np.testing.assert_allclose(found, run.outputs[0], rtol=1e-6, atol=1e-6)


def test_rates_are_those_of_the_steps(pair):
    pair.space()
    if pair.model.kind == "ae":
        pytest.skip("there are no rates")
    fitted, time, dt = getattr(pair.fit(), "reduced", pair.fit()), 1.63, 1e-5
    space = replace(fitted, tolerance=1e-11)
    u = pair.maneuver.at(np.array([time]))[0]
    state = space.step(space.begin(pair.model.starts[0], u), u, 0.1, time - 0.1)
    later = space.step(state, u, dt, time)
    # The trapezoidal rule, whose error is of the third order.
    mean = 0.5 * (space.rates(state, u, time) + space.rates(later, u, time + dt))
    # Steps of a structure are of first order.
    bound = 1e-3 * np.abs(mean).max() if pair.model.kind == "structural" else 1e-6
    np.testing.assert_allclose((later - state) / dt, mean, rtol=1e-6, atol=bound)


# Derivatives of the high-fidelity vehicle's longest kernels take a quarter of a minute each to
# compile: NumPy runs them here.  The 14-DOF vehicle's are compiled.
LONG_TO_COMPILE = ("fixed_basis", "pod")


@pytest.mark.parametrize("by", ["state", "inputs"])
def test_jacobians_are_the_slopes_of_rates_and_outputs(pair, by, monkeypatch):
    if pair.model.kind == "dae" and pair.name in LONG_TO_COMPILE:
        monkeypatch.setattr(JacobianProduct, "_products", complex_step.products)
    pair.space()
    rom, time = ReducedOrderModel(pair.model, pair.name, {}, (), pair.fit()), 1.63
    u = pair.maneuver.at(np.array([time]))[0]
    state = rom.state(inputs=u)
    if pair.model.kind == "ae":
        if pair.name in LONG_TO_COMPILE:
            with pytest.raises(InputError, match="no analytic derivatives"):
                rom.jacobian(state, u, by, of="coordinates")
            return
        if by == "state":
            pytest.skip("coordinates follow from the inputs")
        results = {
            "coordinates": lambda _, v: rom.state(inputs=v),
            "outputs": lambda _, v: rom.outputs(rom.state(inputs=v), v),
        }
    else:
        state = rom.step(rom.step(state, u, 0.3, time - 0.3), u, 1e-3, time)
        results = {"rhs": lambda x, v: rom.rhs(x, v, time), "outputs": rom.outputs}
    rng = np.random.default_rng(3)
    for of, function in results.items():
        found = rom.jacobian(state, u, by, of, time)
        size = np.maximum(np.abs(state if by == "state" else u), 1e-2)
        assert found.shape[1] == len(size)
        along = size * rng.uniform(-1.0, 1.0, len(size))
        moved = [
            function(state + h * along, u) if by == "state" else function(state, u + h * along)
            for h in (1e-4, -1e-4, 5e-5, -5e-5)
        ]
        far, near = (moved[0] - moved[1]) / 2e-4, (moved[2] - moved[3]) / 1e-4
        difference = (4.0 * near - far) / 3.0
        largest = np.abs(found) @ np.abs(along)
        right = np.abs(found @ along - difference) <= 1e-6 * largest + 1e-6
        if of == "outputs":
            # Norms of what is zero but for rounding.
            right |= [output.endswith("_drift") for output in pair.model.outputs]
        assert right.all(), of


def test_a_saved_model_is_the_same_to_the_bit(pair, tmp_path):
    if pair.name in LEARNED:
        pytest.skip("what a library has fitted isn't saved: that is said in one line")
    settings = validated(pair.method, pair.model.kind, SETTINGS.get(pair.name, {})).model_dump()
    training = (Scenario(pair.maneuver, pair.model.starts[0]),)
    known = input_range(pair.model, [(pair.maneuver, own_speed(pair.model) or 0.0)])
    made = ReducedOrderModel(pair.model, pair.name, settings, training, pair.fit(), known)
    again = load(made.save(tmp_path / "model.nc"))
    assert (again.method, again.settings) == (made.method, settings)
    assert again.reduced.offline == made.reduced.offline
    assert again.reduced.order == made.reduced.order
    for maneuver in (pair.maneuver, pair.maneuver.perturbed(0.9, 1.3)):
        first, second = made.simulate(maneuver), again.simulate(maneuver)
        np.testing.assert_array_equal(second.states, first.states)
        np.testing.assert_array_equal(second.outputs, first.outputs)
        for name in ("counts", "status", "message", "remark", "trust"):
            assert getattr(second, name) == getattr(first, name)
    best, nearest = (rom.reduced.best_approximation(pair.full.states) for rom in (made, again))
    assert (best is None) == (nearest is None)
    if best is not None:
        np.testing.assert_array_equal(nearest, best)
    if made.states:
        assert again.states == made.states
        inputs = np.full(len(made.inputs), 1e-3)
        steps = [rom.step(rom.state(inputs=inputs), inputs, 1e-2) for rom in (made, again)]
        np.testing.assert_array_equal(steps[1], steps[0])
        if pair.model.kind != "ae":
            slopes = [rom.jacobian(steps[0], inputs, of="outputs") for rom in (made, again)]
            np.testing.assert_array_equal(slopes[1], slopes[0])
