"""Reduced states come back to full ones as the formulas say, with what tells how far they go."""

from dataclasses import replace

import numpy as np
import pytest

from tests.reducing import CARS
from vehiclemor.exceptions import InputError
from vehiclemor.reduction.vehicle.features import feature_columns
from vehiclemor.simulation.build import build


def lifted(reduced, maneuver, start):
    """States (samples, 2 n) by the formulas, in NumPy."""
    path = reduced.path(maneuver, start)
    k, shape = reduced.features.states, reduced.shape
    inputs = maneuver.at(maneuver.times)
    features = reduced.decoded_features
    assert len(features.terms) < len(reduced.features.terms)
    columns = feature_columns(features, path[:, :k], inputs, reduced.parameters)
    shapes = shape.reference + columns @ reduced.decoding
    return shape.states(shapes, path[:, [k + 1, k + 2, k]])


@pytest.mark.parametrize("start", ["equilibrium", "dropped"])
def test_the_compiled_lifting_is_the_formula(reduced, start):
    model, maneuver = reduced.model, CARS[reduced.model.name].perturbed(1.2, 0.8)
    run, states = reduced.simulate(maneuver, start), lifted(reduced, maneuver, start)
    outputs = model.outputs_at(states, run.inputs)
    # At the samples themselves there is only rounding.
    path = reduced.path(maneuver, start)
    scale = np.abs(states).max(axis=0) + 1e-3
    np.testing.assert_allclose(reduced.decode(path, run.inputs) / scale, states / scale, atol=1e-9)
    # The start is known better; between points, a small part of the integrator's tolerance.
    np.testing.assert_array_equal(run.states[0], model.start(start))
    for name, tenth in (("lateral_position", 5e-3), ("yaw", 7.59e-6), ("pitch", 5.18e-5)):
        column = model.outputs.index(name)
        assert np.abs(run.outputs[1:, column] - outputs[1:, column]).max() < tenth, name
    np.testing.assert_allclose(run.inputs, maneuver.at(maneuver.times), rtol=1e-12, atol=1e-15)


def at_speed(reduced, start, speed):
    """State (2 n,) of a start at another speed."""
    return build(reduced.model.name, overrides={"initial_speed": speed}).start(start)


@pytest.mark.parametrize("speed", [18.0, 20.3, 22.0])
def test_straight_running_at_another_speed_is_known_to_stay_as_it_is(reduced, speed):
    maneuver = CARS[reduced.model.name].perturbed(1.0, 0.0)
    start = at_speed(reduced, "equilibrium", speed)
    shapes = reduced.shape.of(reduced.simulate(maneuver, start).states)
    size = np.abs(reduced.shape.reference).max()
    assert np.abs(shapes - shapes[0]).max() < 1e-3 * size


def test_what_was_run_before_leaves_no_trace(reduced):
    maneuver = CARS[reduced.model.name]
    starts = [at_speed(reduced, s, v) for v in (19.3, 20.4) for s in ("dropped", "equilibrium")]
    apart = [replace(reduced).simulate(maneuver, start).states for start in starts]
    together = [reduced.simulate(maneuver, start).states for start in starts]
    np.testing.assert_array_equal(together, apart)
    assert np.isfinite(apart).all()
    # An array that is changed is another start.
    state = starts[0].copy()
    reduced.simulate(maneuver, state)
    state[:] = starts[2]
    np.testing.assert_array_equal(reduced.simulate(maneuver, state).states, apart[2])
    with pytest.raises(InputError, match="shape"):
        reduced.simulate(maneuver, state[None])
